#include "engine/device/device_plan.h"

#include <algorithm>
#include <cassert>
#include <string>

#include "engine/device/device_query.h"
#include "engine/device/reply_columns.h"

namespace clearance::cuda {

namespace {

[[noreturn]] void refuse(const std::string& why) {
  throw QueryError(QueryErrorCode::kNotSupported, "a plan on a device: " + why);
}

// What plans do not answer, beyond what a device does not (beyond_the_device()); empty: nothing.
std::string beyond_plans(const Scene& scene, const Plan& plan) {
  const QueryView& q = plan.query;
  if (q.reduce != Reduce::kNone) return "reduce: expected none";
  if (q.max_steps > 0) return "max_steps: motions are not for a device yet";
  if (!q.joints.empty()) return "joints are not for a device yet: give the poses of bodies";
  if (q.signed_distance) return "signed_distance: depths are the CPU's";
  // Slack may grow as time goes by, and a plan's poses come later.
  if (const std::uint32_t body = doubted_body(scene, plan); body != kNone)
    return "'" + scene.bodies()[body].name + "' has slack (docs/bounds.md)";
  return {};
}

// The device's part of a dense query, begun once and launched as often as it is asked.
class StandingQuery final : public DevicePlan, private DeviceQuery {
 public:
  StandingQuery(const JobContext& context, Plan&& plan) : DeviceQuery(context, std::move(plan), {}) {}

  void begin() override {
    workspace_ = backend_.device().make_standing();
    if (!workspace_) refuse("the engine has several devices: make one of a single device");
    deal_ = backend_.deal_anew(plan_, kMostRows);
    for (const PairDeal::Part& part : deal_->parts)
      if (!part.on_cpu.empty()) refuse_pair(part.first + part.on_cpu.front());
    in_order_ = backend_.list(plan_);
    assert(in_order_->resident || plan_.size.pairs == 0);
    QuerySetup s = setup(*workspace_);
    s.fields = plan_.size.fields;
    s.pairs = deal_->resident.get();
    workspace_->begin(s);
    std::uint64_t rows = 0;
    for (const PairDeal::Part& part : deal_->parts)
      rows = std::max(rows, std::uint64_t{part.count} * deal_->configurations);
    workspace_->make_room(rows, deal_->configurations);
  }

  const QuerySize& size() const override { return plan_.size; }
  int device() const override { return workspace_->device(); }

  ReplyView own_rows() override {
    if (own_.rows == plan_.size.rows) return own_;
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, plan_.size.rows, plan_.size.fields, &bytes);
    try {
      own_ = reply_view_over(workspace_->room_for_rows(bytes), plan_.size.rows, plan_.size.fields);
    } catch (const DeviceError& error) {
      refuse(error.what());
    }
    return own_;
  }

  void run(const Pose* poses, const ReplyView& rows, void* stream) override {
    if (plan_.query.configuration_count > 0 && !poses && !plan_.bodies.empty()) refuse("poses: expected some");
    check_columns(rows);
    try {
      for (std::uint64_t first = 0; first < plan_.size.configurations; first += deal_->configurations)
        for (const PairDeal::Part& part : deal_->parts) launch_part(part, first, poses, rows, stream);
    } catch (const DeviceError& error) {
      backend_.note(error);
      refuse(error.what());
    }
  }

 private:
  static constexpr std::uint64_t kMostRows = 1u << 22;  // of a chunk: what its lists take is bounded

  [[noreturn]] void refuse_pair(std::uint64_t index) {
    BodyPair pair{};
    plan_.pairs.copy(index, 1, &pair);
    const std::uint32_t body = backend_.device().hull_of(pair.a) == kNone ? pair.a : pair.b;
    refuse("the device does not hold '" + scene().bodies()[body].name + "'");
  }

  void check_columns(const ReplyView& rows) const {
    int bit = 0;
    const auto column = [&](const auto* at, int) {
      const bool known = (plan_.size.fields >> bit++ & 1) != 0;
      if (!at) return;
      if (!known) refuse("rows: a column that the plan was not made for");
      if (reinterpret_cast<std::uintptr_t>(at) % std::min<std::size_t>(alignof_rows(*at), 16) != 0)
        refuse("rows: a column that is not aligned");
    };
    for_each_column(column, rows);
  }
  static std::size_t alignof_rows(const CompactAnswer&) { return 16; }  // written in pieces of 16 bytes
  template <class T>
  static std::size_t alignof_rows(const T&) {
    return alignof(T);
  }

  void launch_part(const PairDeal::Part& part, std::uint64_t first, const Pose* poses, const ReplyView& rows,
                   void* stream) {
    const auto configurations =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(deal_->configurations, plan_.size.configurations - first));
    ChunkSetup s = chunk_of(part, configurations == deal_->configurations ? part.whole : part.last);
    s.configurations = configurations;
    s.first_configuration = first;
    s.poses = poses + first * plan_.bodies.size();
    s.given_on_device = true;
    s.first_row = first * plan_.size.pairs + part.first;
    workspace_->launch(s, rows_from(s.first_row, rows), *in_order_->resident, part.first, stream);
  }

  // A DeviceQuery's, which a plan has no use for.
  void launch(std::uint64_t) override { assert(false); }
  void finish(std::uint64_t) override { assert(false); }
  void end() override { assert(false); }

  std::shared_ptr<const PairDeal> deal_;
  std::shared_ptr<const PairListOnDevice> in_order_;
  ReplyView own_;
  std::shared_ptr<StandingWorkspace> workspace_;  // the last member: the first to go, and to wait for the device
};

}  // namespace

std::unique_ptr<DevicePlan> make_device_plan(const JobContext& context, Plan&& plan) {
  if (!context.device || !context.device->usable())
    refuse(context.device ? context.device->error() : "the engine has no device (backend cuda or auto)");
  std::string beyond = beyond_plans(*context.scene, plan);
  if (beyond.empty()) beyond = beyond_the_device(plan);
  if (!beyond.empty()) refuse(beyond);
  try {
    auto query = std::make_unique<StandingQuery>(context, std::move(plan));
    query->begin();
    return query;
  } catch (const DeviceError& error) {
    context.device->note(error);
    refuse(error.what());
  }
}

}  // namespace clearance::cuda
