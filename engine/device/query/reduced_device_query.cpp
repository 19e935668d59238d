// Queries that are reduced on the device: nearest, least, within a distance.
#include <algorithm>

#include "engine/device/query/device_query.h"
#include "engine/device/query/reply_columns.h"
#include "engine/reduce/reduction.h"

namespace clearance::cuda {

namespace {

// Rows of a chunk of configurations: a few chunks, so that the next one's poses are uploaded while one is answered.
constexpr std::uint64_t kFewestRows = 1u << 16, kMostRows = 1u << 20;
constexpr std::uint64_t kMostGroups = 1u << 20;  // of a chunk
constexpr std::uint64_t kMostMembers = 4096;     // pairs of a configuration for one team of threads

}  // namespace

// Teams are not used if the device could not resolve any pair and the CPU would finish all of them.
bool is_for_teams(const engine::Scene& scene, const Plan& plan) {
  const QueryView& q = plan.query;
  return q.reduce == Reduce::kMin && plan.size.pairs <= kMostMembers && !q.signed_distance &&
         q.precision == Precision::kF64 && (q.rel_tol > 0 || q.abs_tol > 0) && !(q.fields & kFieldPairLower) &&
         uncertain_body(scene, plan) == kNone;
}

namespace {

class ReducedDeviceQuery final : public DeviceQuery {
 public:
  /// \param list of the pairs; null if `table` is set
  /// \param table the whole table; null if `list` is set
  /// \param elements of bodies in the list; if null, all are hulls
  ReducedDeviceQuery(const JobContext& context, Plan&& plan, const ReplyView& reply,
                     std::shared_ptr<const PairListOnDevice> list, std::shared_ptr<const TableOnDevice> table,
                     std::shared_ptr<const ElementsOnDevice> elements)
      : DeviceQuery(context, std::move(plan), reply),
        list_(std::move(list)),
        table_(std::move(table)),
        elements_(std::move(elements)),
        groups_(plan_.query.reduce == Reduce::kNearest ? scene().bodies().size() : 1) {}

  void begin() override {
    workspace_ = backend_.device().borrow_reduced();
    const std::uint64_t P = plan_.size.pairs, K = plan_.size.configurations;
    // A launch takes as long as its slowest configurations, so use half as many chunks.
    const auto chunks = static_cast<std::uint64_t>(backend_.device().chunks_wanted() / 2);
    const std::uint64_t rows = std::clamp((K * P + chunks - 1) / chunks, kFewestRows, kMostRows);
    configurations_ = std::clamp<std::uint64_t>(std::min(rows / P, kMostGroups / groups_), 1, K);
    chunks_ = (K + configurations_ - 1) / configurations_;
    QuerySetup s = setup(*workspace_);
    if (list_) s.pairs = list_->resident.get();
    if (table_) s.table = table_->resident.get();
    s.chunks = chunks_;
    s.reduce = plan_.query.reduce;
    s.groups = static_cast<std::uint32_t>(groups_);
    s.most_rows = plan_.size.rows;
    s.by_teams = !elements_ && is_for_teams(scene(), plan_);
    if (elements_) {
      s.elements = elements_->bodies;
      s.element_kinds = list_->kinds;
    }
    if (plan_.query.reduce == Reduce::kAny) {
      s.margins = plan_.margins.each();
      s.margin = plan_.margins.most();
      s.beyond = beyond_all_margins(plan_);
    }
    begin_chunks(*workspace_, s);
  }

 private:
  bool within() const { return plan_.query.reduce == Reduce::kWithin; }

  void end() override { info.rows = written_; }

  void launch(std::uint64_t index) override {
    const int slot = static_cast<int>(index % slots_);
    ChunkSetup s = chunk_of_configurations(index, configurations_);
    s.first_row = s.first_configuration * plan_.size.pairs;
    give_configurations(*workspace_, slot, s);
    ReplyView direct;  // the place of rows is known in advance except for Reduce::kWithin
    const auto shift = [&](auto* column, auto*& to, std::uint64_t width) {
      to = column && !within() ? column + s.first_configuration * groups_ * width : nullptr;
    };
    for_each_column(shift, direct_, direct);
    workspace_->launch(slot, s, direct);
  }

  void finish(std::uint64_t index) override {
    const int slot = static_cast<int>(index % slots_);
    ReducedResult r = workspace_->finish(slot);
    if (!r.rest.empty()) {
      answer_open_rows(index * configurations_, r.rest);
      r = workspace_->finish_with(slot, answers_);
    }
    const std::uint64_t rows = std::min(r.row_count, plan_.size.rows - written_);
    const auto copy = [&](auto* from, auto* to, auto* direct, std::size_t width) {
      if (!from || (direct && !within())) return;
      add_column(from, to + written_ * width, rows * width * sizeof(*from));
    };
    for_each_column(copy, r.rows, reply_, direct_);
    copy_all();
    written_ += rows;
    info.total += r.total;
    evaluated_ += r.converged;
    backend_.converged.fetch_add(r.converged, std::memory_order_relaxed);
  }

  // Answers a chunk's unresolved rows, in its order.
  void answer_open_rows(std::uint64_t first_configuration, std::span<const std::uint32_t> rows) {
    order_.clear();
    for (std::uint32_t i = 0; i < rows.size(); ++i) order_.emplace_back(rows[i], i);
    std::sort(order_.begin(), order_.end());
    answers_.resize(rows.size());
    const std::uint64_t P = plan_.size.pairs;
    answer_on_cpu(
        order_.size(),
        [&](std::size_t i) { return OpenRow{first_configuration + order_[i].first / P, order_[i].first % P}; },
        [&](std::size_t i, const PlacedBodies&, const PairAnswer& answer) { answers_[order_[i].second] = answer; });
  }

  std::shared_ptr<const PairListOnDevice> list_;  // one of list_ and table_ is set
  std::shared_ptr<const TableOnDevice> table_;
  std::shared_ptr<const ElementsOnDevice> elements_;
  std::uint64_t groups_, configurations_ = 1;  // per configuration; per chunk
  std::uint64_t written_ = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> order_;
  std::vector<PairAnswer> answers_;
  std::shared_ptr<ReducedWorkspace> workspace_;  // last member: destroyed first, which waits for the device
};

}  // namespace

std::unique_ptr<DeviceQuery> make_reduced_device_query(const JobContext& context, Plan& plan, const ReplyView& reply) {
  if (plan.pairs.size() == 0 || plan.pairs.size() >= std::uint64_t{1} << 32) return nullptr;
  if (plan.query.reduce == Reduce::kWithin && plan.pairs.is_whole_table() && plan.query.configuration_count == 0) {
    auto table = context.device->table(plan);
    if (!table->resident) return nullptr;
    return std::make_unique<ReducedDeviceQuery>(context, std::move(plan), reply, nullptr, std::move(table), nullptr);
  }
  auto list = context.device->list(plan);
  if (!list->resident) return nullptr;
  std::shared_ptr<const ElementsOnDevice> elements;
  if (!list->of_elements.empty()) {
    if (plan.query.signed_distance) return nullptr;
    elements = context.device->elements(*context.scene, list->of_elements);
    if (!elements) return nullptr;
  }
  return std::make_unique<ReducedDeviceQuery>(context, std::move(plan), reply, std::move(list), nullptr,
                                              std::move(elements));
}

}  // namespace clearance::cuda
