#include "engine/device/query/device_plan.h"

#include <algorithm>
#include <cassert>
#include <string>

#include "engine/device/query/body_kinds.h"
#include "engine/device/query/device_query.h"
#include "engine/device/query/reply_columns.h"
#include "engine/reduce/reduction.h"

namespace clearance::cuda {

namespace {

// Maximum pair-configurations of a chunk, which bounds the memory of its lists: 130 bytes each for a reduction.
constexpr std::uint64_t kMostPlanRows = 1u << 22;

[[noreturn]] void reject(const std::string& why) {
  throw engine::QueryError(QueryErrorCode::kNotSupported, "a plan on a device: " + why);
}

// Reason why no device query can be made of this query, or empty.
std::string beyond_plans(const engine::Scene& scene, const Plan& plan) {
  const QueryView& q = plan.query;
  if (q.reduce == Reduce::kNearest || q.reduce == Reduce::kWithin) return "reduce: expected none, min or any";
  if (q.max_evaluations > 0) return "max_evaluations: motions are not for plans yet";
  if (q.fields & kFieldFreeScale) return "the column free_scale";
  if (q.fields & kSecondOrderFields)
    return "fields: hessian_joints, rate, rate_bounds, curvature and smooth_radius are the CPU's";
  if (q.signed_distance) return "signed_distance: depths are the CPU's";
  // Poses arrive after the query is made, and kernels have no clock.
  if (q.max_pose_age_ns > 0) return "max_pose_age_ns: a plan does not know how old poses are when it runs";
  if (const std::uint32_t body = ageing_body(scene, plan); body != kNone)
    return "'" + scene.bodies()[body].name + "' has slack that grows as time goes by (max_speed)";
  return {};
}

// The device's part of a query, begun once and launched on every run.
class ResidentQuery : public DevicePlan, protected DeviceQuery {
 public:
  ResidentQuery(const JobContext& context, Plan&& plan) : DeviceQuery(context, std::move(plan), {}) {}

  void begin() override {
    if (const std::string pair = unsupported_pair(scene(), backend_.device(), plan_, false); !pair.empty())
      reject(pair);
    workspace_ = backend_.device().make_resident(plan_.query.reduce);
    if (!workspace_) reject("the engine has several devices: make one of a single device");
    in_order_ = backend_.list(plan_);
    QuerySetup s = setup(*workspace_);
    s.fields = plan_.size.fields;
    assign_pairs(s);
    workspace_->begin(s);
    workspace_->reserve(most_rows_, static_cast<std::uint32_t>(configurations_));
  }

  const QuerySize& size() const override { return plan_.size; }
  int device() const override { return workspace_->device(); }
  std::uint64_t scene_revision() const override { return plan_.snapshot->scene_revision; }
  std::uint64_t snapshot_revision() const override { return plan_.snapshot->revision; }

  ReplyView own_rows() override {
    if (own_.rows == plan_.size.rows) return own_;
    const QuerySize& size = plan_.size;
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, size.rows, size.fields, &bytes, size.joints);
    try {
      own_ = reply_view_over(workspace_->row_buffer(bytes), size.rows, size.fields, nullptr, size.joints);
    } catch (const DeviceError& error) {
      reject(error.what());
    }
    return own_;
  }

  std::uint64_t bytes() const override {
    const std::uint64_t lists = plan_.query.reduce == Reduce::kNone ? 2 : 1;
    return workspace_->bytes() + lists * plan_.size.pairs * (sizeof(PairRef) + sizeof(std::uint32_t));
  }

  void run(const GivenOnDevice& given, const ReplyView& rows, void* stream) override {
    for (std::uint64_t first = 0; first < plan_.size.configurations;) first = run_from(first, given, rows, stream);
  }

  std::uint64_t run_from(std::uint64_t first, const GivenOnDevice& given, const ReplyView& rows,
                         void* stream) override {
    assert(first < plan_.size.configurations);
    if (plan_.query.configuration_count > 0) {
      if (!given.poses && plan_.given_bodies > 0) reject("poses: expected some");
      if (!given.positions && !plan_.joints.empty()) reject("positions: expected some");
    }
    check_columns(rows);
    try {
      launch_configurations(first, given, rows, stream);
    } catch (const DeviceError& error) {
      backend_.note(error);
      reject(error.what());
    }
    return std::min<std::uint64_t>(first + configurations_, plan_.size.configurations);
  }

 protected:
  /// Assigns the pairs to chunks, and sets the number of configurations and rows of a chunk.
  virtual void assign_pairs(QuerySetup& setup) = 0;
  /// Launches some configurations.
  /// \param chunk settings shared by all
  virtual void launch_chunks(const ChunkSetup& chunk, const ReplyView& rows, void* stream) = 0;

  std::shared_ptr<const PairListOnDevice> in_order_;
  std::shared_ptr<const ChunkPlan> chunk_plan_;       // Reduce::kNone only
  std::uint64_t configurations_ = 1, most_rows_ = 0;  // of a chunk
  ReplyView own_;
  std::shared_ptr<ResidentWorkspace> workspace_;  // last member: destroyed first, which waits for the device

 private:
  void check_columns(const ReplyView& rows) const {
    int bit = 0;
    const auto column = [&](const auto* at, int) {
      const bool known = (plan_.size.fields >> bit++ & 1) != 0;
      if (!at) return;
      if (!known) reject("rows: a column that the plan was not made for");
      if (reinterpret_cast<std::uintptr_t>(at) % std::min<std::size_t>(alignof_rows(*at), 16) != 0)
        reject("rows: a column that is not aligned");
    };
    for_each_column(column, rows);
    if (rows.gradient_joints && rows.joints != plan_.size.joints)
      reject("rows: gradient_joints of " + std::to_string(rows.joints) + " joints, and the plan has " +
             std::to_string(plan_.size.joints));
  }
  static std::size_t alignof_rows(float) { return 8; }  // written in pairs
  template <class T>
  static std::size_t alignof_rows(const T&) {
    return alignof(T);
  }

  void launch_configurations(std::uint64_t first, const GivenOnDevice& given, const ReplyView& rows, void* stream) {
    ChunkSetup s;
    s.configurations =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(configurations_, plan_.size.configurations - first));
    s.first_configuration = first;
    if (given.poses) s.poses = given.poses + first * plan_.given_bodies;
    if (given.positions) s.positions = given.positions + first * plan_.joints.size();
    s.given_on_device = true;
    launch_chunks(s, rows, stream);
  }

  // Members of DeviceQuery that device queries do not use.
  void launch(std::uint64_t) override { assert(false); }
  void finish(std::uint64_t) override { assert(false); }
  void end() override { assert(false); }
};

// A row per configuration and pair.
class ResidentRows final : public ResidentQuery {
 public:
  using ResidentQuery::ResidentQuery;

 private:
  void assign_pairs(QuerySetup& setup) override {
    chunk_plan_ = backend_.make_chunk_plan(plan_, kMostPlanRows);
    assert(in_order_->resident || plan_.size.pairs == 0);
    setup.pairs = chunk_plan_->resident.get();
    configurations_ = chunk_plan_->configurations;
    for (const ChunkPlan::Part& part : chunk_plan_->parts)
      most_rows_ = std::max(most_rows_, std::uint64_t{part.count} * chunk_plan_->configurations);
  }

  void launch_chunks(const ChunkSetup& chunk, const ReplyView& rows, void* stream) override {
    for (const ChunkPlan::Part& part : chunk_plan_->parts) {
      ChunkSetup s = chunk_of(part, chunk.configurations == chunk_plan_->configurations ? part.whole : part.last);
      s.configurations = chunk.configurations;
      s.first_configuration = chunk.first_configuration;
      s.poses = chunk.poses;
      s.positions = chunk.positions;
      s.given_on_device = true;
      s.first_row = chunk.first_configuration * plan_.size.pairs + part.first;
      workspace_->launch(s, rows_from(s.first_row, rows), *in_order_->resident, part.first, stream);
    }
  }
};

// A row per configuration.
class ResidentReduction final : public ResidentQuery {
 public:
  using ResidentQuery::ResidentQuery;

 private:
  void assign_pairs(QuerySetup& setup) override {
    const std::uint64_t P = plan_.size.pairs, K = plan_.size.configurations;
    if (P == 0) reject("no pairs");
    if (P >= std::uint64_t{1} << 32) reject("too many pairs");
    assert(in_order_->resident && in_order_->of_elements.empty());
    configurations_ = std::clamp<std::uint64_t>(kMostPlanRows / P, 1, K);
    most_rows_ = configurations_ * P;
    setup.pairs = in_order_->resident.get();
    setup.reduce = plan_.query.reduce;
    setup.by_teams = is_for_teams(scene(), plan_);
    if (plan_.query.reduce != Reduce::kAny) return;
    setup.margins = plan_.margins.each();
    setup.margin = plan_.margins.most();
    setup.beyond = beyond_all_margins(plan_);
  }
  void launch_chunks(const ChunkSetup& chunk, const ReplyView& rows, void* stream) override {
    ChunkSetup s = chunk;
    s.pair_count = static_cast<std::uint32_t>(plan_.size.pairs);
    s.first_row = chunk.first_configuration;
    workspace_->launch(s, rows_from(s.first_row, rows), *in_order_->resident, 0, stream);
  }
};

}  // namespace

std::unique_ptr<DevicePlan> make_device_plan(const JobContext& context, Plan&& plan) {
  if (!context.device || !context.device->usable())
    reject(context.device ? context.device->error() : "the engine has no device (backend cuda or auto)");
  const std::string beyond = beyond_plans(*context.scene, plan);
  if (!beyond.empty()) reject(beyond);
  try {
    std::unique_ptr<ResidentQuery> query;
    if (plan.query.reduce == Reduce::kNone)
      query = std::make_unique<ResidentRows>(context, std::move(plan));
    else
      query = std::make_unique<ResidentReduction>(context, std::move(plan));
    query->begin();
    return query;
  } catch (const DeviceError& error) {
    context.device->note(error);
    reject(error.what());
  }
}

}  // namespace clearance::cuda
