#include "device_job.h"

#include <algorithm>
#include <cstring>

#include "engine/parallel_job.h"
#include "reply_columns.h"

namespace clearance::cuda {

namespace {

constexpr std::size_t kCopyBytes = 1u << 18;  // what one thread copies at a time
constexpr std::uint64_t kRestUnit = 16;       // rows that a thread finishes at a time

class DeviceJob final : public ParallelJob {
 public:
  DeviceJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply),
        backend_(*context.device),
        deal_(backend_.deal(plan_)),
        workspace_(backend_.device().borrow()) {
    for (int i = 0; i < workers(); ++i) evaluators_.emplace_back(scene(), options_);
    rooms_.resize(static_cast<std::size_t>(workers()));
    const std::uint64_t rounds = (plan_.size.configurations + deal_->configurations - 1) / deal_->configurations;
    chunks_ = rounds * deal_->parts.size();
    if (chunks_ == 0) return;
    find_direct_columns();
    begin();
  }

  bool advance(std::chrono::nanoseconds budget) override {
    const auto deadline = budget == std::chrono::nanoseconds::max() ? Clock::time_point::max() : Clock::now() + budget;
    while (finished_ < chunks_) {
      while (launched_ < chunks_ && launched_ < finished_ + Workspace::kSlots) launch(launched_++);
      finish(finished_++);
      if (finished_ < chunks_ && Clock::now() >= deadline) return false;
    }
    info.rows = info.total = plan_.size.rows;
    info.pairs_evaluated = evaluated_;
    context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    backend_.queries.fetch_add(1, std::memory_order_relaxed);
    return true;
  }

 private:
  struct Chunk {
    const PairDeal::Part* part;
    std::uint64_t first_configuration;
    std::uint32_t configurations;
    std::uint64_t first_row;
  };
  Chunk chunk(std::uint64_t index) const {
    const std::uint64_t first = index / deal_->parts.size() * deal_->configurations;
    const PairDeal::Part& part = deal_->parts[index % deal_->parts.size()];
    const auto configurations =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(deal_->configurations, plan_.size.configurations - first));
    return {&part, first, configurations, first * plan_.size.pairs + part.first};
  }

  void find_direct_columns() {
    std::uint32_t bit = 0;
    direct_ = reply_;
    const auto column = [&](auto*& direct, int) {
      if (direct) fields_ |= 1u << bit;
      ++bit;
      if (!is_pinned(direct)) direct = nullptr;
    };
    for_each_column(column, direct_);
  }

  void begin() {
    QuerySetup s;
    s.question = {options_.limits.max_distance,
                  options_.limits.abs_tol,
                  options_.limits.rel_tol,
                  options_.limits.max_iterations,
                  options_.cull,
                  options_.want_points,
                  options_.want_nonsmooth,
                  !options_.limits.signed_distance};
    s.fields = fields_;
    s.components = options_.cull ? kPoseComponents + kBoxComponents : kPoseComponents;
    place_fixed(s.components);
    s.fixed = fixed_;
    s.fixed_state = fixed_state_;
    if (plan_.query.configuration_count > 0) chain_moved(s);
    s.pairs = deal_->resident.get();
    workspace_->begin(s);
  }

  // The snapshot's bodies, one component after another.
  void place_fixed(std::uint32_t components) {
    const std::vector<BodyPlacement>& placed = plan_.snapshot->placed;
    const std::size_t n = placed.size();
    fixed_.resize(n * components);
    fixed_state_.resize(n);
    for (std::size_t b = 0; b < n; ++b) {
      const BodyPlacement& at = placed[b];
      const bool stale = !options_.stale.empty() && options_.stale[b];
      fixed_state_[b] =
          static_cast<std::uint8_t>(static_cast<std::uint8_t>(at.status) | (at.renormalised ? kStateRenormalised : 0) |
                                    (stale ? kStateStale : 0));
      if (at.status != Status::kOk) continue;
      const auto put = [&](std::size_t c, const Vec3d& v) {
        for (int i = 0; i < 3; ++i) fixed_[(c + static_cast<std::size_t>(i)) * n + b] = v[i];
      };
      for (std::size_t r = 0; r < 3; ++r) put(3 * r, at.pose.R_wb.row[r]);
      put(9, at.pose.t_w);
      if (components == kPoseComponents) continue;
      const Aabb box = body_box(scene().bodies()[b], at);
      put(12, box.low);
      put(15, box.high);
    }
  }

  void chain_moved(QuerySetup& s) {
    const PoseSnapshot& snapshot = *plan_.snapshot;
    const std::vector<std::uint32_t>& moved = plan_.moved;
    std::vector<std::uint32_t> slot_of(scene().bodies().size(), kNone);
    for (std::uint32_t i = 0; i < moved.size(); ++i) slot_of[moved[i]] = i;
    source_.assign(moved.size(), kNone);
    for (std::uint32_t m = 0; m < plan_.bodies.size(); ++m) source_[slot_of[plan_.bodies[m]]] = m;
    chain_begin_.assign(1, 0);
    base_.resize(moved.size());
    for (std::uint32_t i = 0; i < moved.size(); ++i) {
      own_.push_back(snapshot.local[moved[i]]);
      const std::size_t first = chain_.size();
      std::uint32_t b = moved[i];
      for (; b != kNone && slot_of[b] != kNone; b = snapshot.parent[b]) chain_.push_back(slot_of[b]);
      std::reverse(chain_.begin() + static_cast<std::ptrdiff_t>(first), chain_.end());
      chain_begin_.push_back(static_cast<std::uint32_t>(chain_.size()));
      has_base_.push_back(b != kNone);
      if (b != kNone) base_[i] = snapshot.placed[b];
    }
    s.given_count = static_cast<std::uint32_t>(plan_.bodies.size());
    s.moved_body = moved;
    s.source = source_;
    s.chain_begin = chain_begin_;
    s.chain = chain_;
    s.own = own_;
    s.base = base_;
    s.has_base = has_base_;
  }

  void launch(std::uint64_t index) {
    const Chunk c = chunk(index);
    const bool is_last = c.configurations != deal_->configurations;
    const PairDeal::Part::Groups& g = is_last ? c.part->last : c.part->whole;
    ChunkSetup s;
    const int slot = static_cast<int>(index % Workspace::kSlots);
    if (const std::uint64_t M = plan_.bodies.size(); plan_.query.configuration_count > 0) {
      const std::size_t poses = c.configurations * M;
      copy_bytes(plan_.configurations.data() + c.first_configuration * M, workspace_->room_for_poses(slot, poses),
                 poses * sizeof(Pose));
    }
    s.configurations = c.configurations;
    s.first_configuration = c.first_configuration;
    s.first_pair = c.part->first_pair;
    s.pair_count = c.part->count;
    s.first_tile = g.first_tile;
    s.group_tiles = g.tiles;
    s.strays = g.strays;
    s.stray_tiles = g.stray_tiles;
    ReplyView direct;
    const auto shift = [&](auto* column, auto*& to, std::uint64_t width) {
      to = column ? column + c.first_row * width : nullptr;
    };
    for_each_column(shift, direct_, direct);
    workspace_->launch(slot, s, direct);
  }

  void finish(std::uint64_t index) {
    const Chunk c = chunk(index);
    cpu_rows_.clear();  // the CPU's pairs wait for the columns, which would overwrite them
    const ChunkResult r = workspace_->finish(static_cast<int>(index % Workspace::kSlots));
    const std::uint64_t rows = std::uint64_t{c.configurations} * c.part->count;
    const auto copy = [&](auto* from, auto* to, auto* direct, std::size_t width) {
      if (!from || direct) return;
      copy_bytes(from, to + c.first_row * width, rows * width * sizeof(*from));
    };
    for_each_column(copy, r.rows, reply_, direct_);
    cpu_rows_.assign(r.rest.begin(), r.rest.end());
    evaluated_ += r.settled;
    backend_.settled.fetch_add(r.settled, std::memory_order_relaxed);
    if (launched_ < chunks_) launch(launched_++);  // the device goes on while the CPU finishes this chunk
    for (std::uint32_t k = 0; k < c.configurations; ++k)
      for (const std::uint32_t p : c.part->on_cpu) cpu_rows_.push_back(k * c.part->count + p);
    if (cpu_rows_.empty()) return;
    std::sort(cpu_rows_.begin(), cpu_rows_.end());
    std::uint64_t next = 0;
    run_units(next, (cpu_rows_.size() + kRestUnit - 1) / kRestUnit, Clock::time_point::max(),
              [&](std::uint64_t unit, int worker) { finish_rows(c, unit, worker); });
    backend_.finished_on_cpu.fetch_add(cpu_rows_.size(), std::memory_order_relaxed);
  }

  // Answers a unit of cpu_rows_ on the CPU, configuration by configuration.
  void finish_rows(const Chunk& c, std::uint64_t unit, int worker) {
    const auto w = static_cast<std::size_t>(worker);
    Room& room = rooms_[w];
    const std::size_t begin = unit * kRestUnit, end = std::min<std::size_t>(begin + kRestUnit, cpu_rows_.size());
    std::uint64_t evaluated = 0;
    for (std::size_t i = begin, j; i < end; i = j) {
      const std::uint32_t k = cpu_rows_[i] / c.part->count;
      const Placement& here = placement(worker, c.first_configuration + k);
      room.asked.clear();
      for (j = i; j < end && cpu_rows_[j] / c.part->count == k; ++j)
        room.asked.push_back({plan_.pairs.at(c.part->first + cpu_rows_[j] % c.part->count), &here});
      room.answers.resize(std::max(room.answers.size(), room.asked.size()));
      evaluators_[w].run(room.asked, room.answers);
      for (std::size_t n = 0; n < room.asked.size(); ++n) {
        write(c.first_row + cpu_rows_[i + n], static_cast<std::uint32_t>(c.first_configuration + k), room.asked[n], room.answers[n]);
        evaluated += reached_narrow_phase(room.answers[n]);
      }
    }
    evaluated_.fetch_add(evaluated, std::memory_order_relaxed);
  }

  void copy_bytes(const void* from, void* to, std::size_t bytes) {
    const auto blocks = static_cast<std::int64_t>((bytes + kCopyBytes - 1) / kCopyBytes);
    const auto* source = static_cast<const std::byte*>(from);
    auto* target = static_cast<std::byte*>(to);
#pragma omp parallel for num_threads(workers()) if (blocks > 2)
    for (std::int64_t i = 0; i < blocks; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * kCopyBytes;
      std::memcpy(target + at, source + at, std::min(kCopyBytes, bytes - at));
    }
  }

  struct Room {
    std::vector<PlacedBodies> asked;
    std::vector<PairAnswer> answers;
  };

  DeviceBackend& backend_;
  std::shared_ptr<const PairDeal> deal_;
  std::uint32_t fields_ = 0;
  ReplyView direct_;  // columns in pinned memory
  std::vector<double> fixed_;
  std::vector<std::uint8_t> fixed_state_, has_base_;
  std::vector<std::uint32_t> source_, chain_begin_, chain_;
  std::vector<Pose> own_;
  std::vector<BodyPlacement> base_;
  std::uint64_t chunks_ = 0, launched_ = 0, finished_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
  std::vector<std::uint32_t> cpu_rows_;
  std::vector<Room> rooms_;
  std::vector<Evaluator> evaluators_;
  std::shared_ptr<Workspace> workspace_;  // the last member: the first to go, and to wait for the device
};

}  // namespace

void DeviceBackend::append(Counters& counters) const {
  const DeviceCounters d = device_->counters();
  counters.insert(counters.end(), {{"cuda.scene_bytes", d.scene_bytes},
                                   {"cuda.query_bytes", d.query_bytes},
                                   {"cuda.pinned_bytes", d.pinned_bytes},
                                   {"cuda.allocations", d.allocations},
                                   {"cuda.kernel_ns", d.kernel_ns},
                                   {"cuda.chunks", d.launches},
                                   {"cuda.queries", queries},
                                   {"cuda.queries_on_cpu", queries_on_cpu},
                                   {"cuda.pairs_settled", settled},
                                   {"cuda.pairs_finished_on_cpu", finished_on_cpu}});
}

std::unique_ptr<Job::State> make_device_job(const JobContext& context, Plan plan, const ReplyView& reply) {
  return std::make_unique<DeviceJob>(context, std::move(plan), reply);
}

}  // namespace clearance::cuda
