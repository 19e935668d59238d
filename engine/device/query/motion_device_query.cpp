// Motions on the device: whether all pairs stay beyond their margins, or their least distance. The CPU's search answers
// motions that the device leaves open, each as a whole.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/device/motion_layout.h"
#include "engine/device/query/device_query.h"
#include "engine/motion/motion_block.h"
#include "engine/narrow/group.h"
#include "engine/reduce/reduction.h"

namespace clearance::cuda {

namespace {

constexpr std::uint64_t kFewestMotions = 1024, kMostMotions = 16384;  // of a chunk
constexpr std::uint64_t kMostPairMotions = 1u << 22;                  // of a chunk: its lists have the capacity
constexpr std::uint64_t kMostPairsOfMotion = 1u << 16;
constexpr std::uint64_t kOpenMotions = 16;     // per thread and unit
constexpr std::uint64_t kRowsOfThread = 1024;  // written per thread and unit

class MotionDeviceQuery final : public DeviceQuery {
 public:
  MotionDeviceQuery(const JobContext& context, Plan&& plan, const ReplyView& reply,
                    std::shared_ptr<const PairListOnDevice> list, std::shared_ptr<MotionWorkspace> workspace)
      : DeviceQuery(context, std::move(plan), reply),
        list_(std::move(list)),
        bounds_(scene(), plan_),
        motion_options_(options_),
        workspace_(std::move(workspace)) {
    set_motion_options(plan_, motion_options_);
    fits_ = bounds_.flatten(arrays_);
  }

  /// Whether kernels support the movers of the bodies.
  bool fits() const { return fits_; }

  void begin() override {
    const std::uint64_t K = plan_.size.configurations, P = plan_.size.pairs;
    const auto chunks = static_cast<std::uint64_t>(backend_.device().chunks_wanted());
    motions_ = std::clamp((K + chunks - 1) / chunks, kFewestMotions, kMostMotions);
    motions_ = std::clamp<std::uint64_t>(std::min(motions_, kMostPairMotions / P), 1, K);
    chunks_ = (K + motions_ - 1) / motions_;
    beyond_ = {{kNone, kNone}, 0, beyond_all_margins(plan_)};
    QuerySetup s = setup(*workspace_);
    s.pair_limits.abs_tol = motion_options_.limits.abs_tol;
    s.pair_limits.rel_tol = motion_options_.limits.rel_tol;
    s.pair_limits.max_distance = motion_options_.limits.max_distance;
    s.pair_limits.want_points = true;  // also the separating directions
    s.pairs = list_->resident.get();
    s.chunks = chunks_;
    s.reduce = plan_.query.reduce;
    s.margins = plan_.margins.each();
    s.margin = plan_.margins.most();
    s.motions = &arrays_;
    s.max_evaluations = plan_.query.max_evaluations;
    s.least = {finds_least(), plan_.query.abs_tol, plan_.query.rel_tol};
    begin_chunks(*workspace_, s);
  }

 private:
  bool finds_least() const { return plan_.query.reduce == Reduce::kMin; }
  void end() override { info.rows = info.total = plan_.size.rows; }

  void launch(std::uint64_t index) override {
    const int slot = static_cast<int>(index % slots_);
    ChunkSetup s = chunk_of_configurations(index, motions_);
    give_configurations(*workspace_, slot, s);
    workspace_->launch(slot, s);
  }

  void finish(std::uint64_t index) override {
    const MotionResult r = workspace_->finish(static_cast<int>(index % slots_));
    const std::uint64_t first = index * motions_;
    open_.clear();
    for (std::uint64_t i = 0; i < r.outcomes.size(); ++i)
      if (r.outcomes[i] == MotionOutcome::kOpen) open_.push_back(first + i);
    write_decided(first, r);
    finish_open();
    evaluated_ += r.converged;
    backend_.converged.fetch_add(r.converged, std::memory_order_relaxed);
  }

  // Writes motions that are free and motions that hit.
  void write_decided(std::uint64_t first, const MotionResult& r) {
    const std::uint64_t free_units = (r.outcomes.size() + kRowsOfThread - 1) / kRowsOfThread,
                        hit_units = (r.hits.size() + kRowsOfThread - 1) / kRowsOfThread;
    std::uint64_t next = 0;
    WorkMeter unlimited;
    run_units(next, free_units + hit_units, unlimited, [&](std::uint64_t unit, int, WorkMeter&) {
      if (unit < free_units) {
        const std::uint64_t begin = unit * kRowsOfThread, end = std::min(begin + kRowsOfThread, r.outcomes.size());
        for (std::uint64_t i = begin; i < end; ++i)
          if (r.outcomes[i] == MotionOutcome::kFree) write_free(first + i, r.steps[i]);
      } else {
        const std::uint64_t begin = (unit - free_units) * kRowsOfThread,
                            end = std::min(begin + kRowsOfThread, r.hits.size());
        for (std::uint64_t i = begin; i < end; ++i) write_hit(first, r.hits[i], r);
      }
      return true;
    });
  }
  void write_free(std::uint64_t motion, std::uint32_t steps) {
    MotionRow made;
    made.row = beyond_;
    made.row.configuration = static_cast<std::uint32_t>(motion);
    made.free_until = std::numeric_limits<double>::infinity();
    made.steps = steps;
    write_motion_row(reply_, motion, made);
  }
  // A decision leaves the rest of the motion unevaluated, so the least distance may be 0.
  void write_hit(std::uint64_t first, const MotionHitRow& hit, const MotionResult& r) {
    MotionRow made;
    const BodyPair pair = plan_.pairs.at(hit.pair);
    const std::uint64_t motion = first + hit.motion;
    made.row = {pair, static_cast<std::uint32_t>(motion), hit.answer, hit.origin_a, hit.origin_b, pair, {}};
    PairAnswer& answer = made.row.answer;
    made.time = made.hit.time = hit.time;
    if (finds_least()) {
      decide_least(plan_.query, hit.low, false, answer);
      made.hit.time = hit.contact;
    } else {
      answer.lower = std::min(0.0, answer.upper);
      answer.status = decided_status(answer.lower, answer.upper);
    }
    if (!r.free_until.empty()) made.free_until = r.free_until[hit.motion];
    made.steps = r.steps[hit.motion];
    write_motion_row(reply_, motion, made);
  }

  void finish_open() {
    if (open_.empty()) return;
    if (blocks_.empty()) make_blocks();
    std::uint64_t next = 0;
    WorkMeter unlimited;
    run_units(next, (open_.size() + kOpenMotions - 1) / kOpenMotions, unlimited,
              [&](std::uint64_t unit, int worker, WorkMeter& meter) {
                MotionBlock& block = blocks_[static_cast<std::size_t>(worker)];
                const std::size_t begin = unit * kOpenMotions;
                const auto motions = std::span<const std::uint64_t>(open_).subspan(
                    begin, std::min<std::size_t>(kOpenMotions, open_.size() - begin));
                if (!block.has_begun()) block.begin(motions, meter);
                if (!block.advance(meter)) return false;
                std::vector<MotionRow> rows;
                evaluated_.fetch_add(block.end(rows), std::memory_order_relaxed);
                for (std::size_t i = 0; i < rows.size(); ++i) write_motion_row(reply_, motions[i], rows[i]);
                return true;
              });
    backend_.motions_finished_on_cpu.fetch_add(open_.size(), std::memory_order_relaxed);
  }

  void make_blocks() {
    const std::vector<BodyPlacement>& placed = plan_.snapshot->placed;
    for (std::size_t b = 0; b < placed.size(); ++b)
      boxes_.push_back(body_box(scene().bodies()[b], placed[b], plan_.uncertainties[b].slack));
    for (int i = 0; i < workers(); ++i) blocks_.emplace_back(motion_query_, motion_options_, boxes_, kOpenMotions);
  }

  std::shared_ptr<const PairListOnDevice> list_;
  MotionBounds bounds_;
  MotionArrays arrays_;
  bool fits_ = false;
  EvaluateOptions motion_options_;
  MotionQuery motion_query_{scene(), plan_, bounds_};
  // Allocated if a motion is left open:
  std::vector<Aabb> boxes_;
  std::vector<MotionBlock> blocks_;  // per worker
  std::vector<std::uint64_t> open_;
  Row beyond_{};
  std::uint64_t motions_ = 1;                   // of a chunk
  std::shared_ptr<MotionWorkspace> workspace_;  // last member: destroyed first, which waits for the device
};

}  // namespace

std::unique_ptr<DeviceQuery> make_motion_device_query(const JobContext& context, Plan& plan, const ReplyView& reply) {
  if (plan.size.pairs == 0 || plan.size.pairs > kMostPairsOfMotion || plan.size.configurations == 0) return nullptr;
  if (context.reference || uncertain_body(*context.scene, plan) == kNone) return nullptr;
  auto workspace = context.device->device().borrow_motions();
  if (!workspace) return nullptr;
  auto list = context.device->list(plan);
  if (!list->resident || !list->of_elements.empty()) return nullptr;  // these kernels support hulls only
  auto query =
      std::make_unique<MotionDeviceQuery>(context, std::move(plan), reply, std::move(list), std::move(workspace));
  if (query->fits()) return query;
  plan = query->give_up();
  return nullptr;
}

}  // namespace clearance::cuda
