#include "engine/joint_table/joint_table_maker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/hull/primitive.h"
#include "engine/joint_table/block_planes.h"
#include "engine/joint_table/mesh_gap.h"
#include "engine/narrow/part_batch.h"
#include "engine/pose/placed.h"
#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kCellsShift[2] = {12, 16};  // cells of a table for one joint, and for two
constexpr std::uint32_t kLeastShift = 3;            // of each of two columns
constexpr std::uint32_t kFiner = 2;                 // halvings of a cell in each column, where the links are close
constexpr double kFar = JointTable::kUnit * TableCell::kNoHigh;  // greater distances are not distinguished
constexpr double kDeep = 0.03;                                   // nor deeper overlaps; metres
constexpr double kPrecision = 8;                                 // a distance to 1 / kPrecision suffices
constexpr std::size_t kMostEvaluated = 400'000;  // positions; the rest keeps the bounds of larger blocks
constexpr std::size_t kMostOfMeshes = 100'000;   // the same for meshes, which take longer
constexpr std::size_t kBatch = 1024;             // positions of one evaluation
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kAbove = 1 + 0x1p-40;

// Evaluates blocks of positions, and halves them until their bounds suffice.
class JointTableMaker {
 public:
  explicit JointTableMaker(const TablePair& pair)
      : pair_(pair),
        robot_(pair.robot->kinematics),
        paths_(paths_between(robot_, pair.a.link, pair.a.ball, pair.b.link, pair.b.ball)) {
    for (const TableLink* link : {&pair.a, &pair.b}) {
      Body& body = bodies_.emplace_back();
      body.parts = link->parts;
      body.reach = link->extent;
      has_mesh_ |= has_surface(body);
    }
    table_.column_count = static_cast<std::uint32_t>(pair.columns.size());
    for (std::size_t c = 0; c < pair.columns.size(); ++c)
      table_.columns[c] = *table_column(*pair.robot, pair.columns[c]);
    take_error();
    take_cells();
    planes_.emplace(pair, travel_);
  }

  JointTable take() { return std::move(table_); }
  std::optional<JointTable> make(const std::atomic<bool>* stopped) {
    std::vector<Block> blocks{{{0, 0}, -kInf, kInf}}, evaluated, next;
    std::uint32_t shift[2] = {fine_shift(0), fine_shift(1)};  // of the blocks' sizes, in fine cells
    std::size_t seen = 0;
    for (;;) {
      const double half[2] = {half_of(0, shift[0]), half_of(1, shift[1])};
      const double way = way_of(half);
      planes_->take_size(std::span(half).first(table_.column_count));
      const bool is_last =
          shift[0] + shift[1] == 0 || (seen += blocks.size()) > (has_mesh_ ? kMostOfMeshes : kMostEvaluated);
      next.clear();
      evaluated.clear();
      // The wider axis is halved next.
      const int axis = shift[1] > 0 && (shift[0] == 0 || way_along(1, half[1]) >= way_along(0, half[0])) ? 1 : 0;
      const auto halve = [&](const Block& block) {
        next.push_back(block);
        next.push_back(block);
        next.back().at[axis] += 1u << (shift[axis] - 1);
      };
      for (const Block& block : blocks)
        if (is_last || may_suffice(block, shift, way))
          evaluated.push_back(block);
        else
          halve(block);
      for (std::size_t begin = 0; begin < evaluated.size(); begin += kBatch) {
        if (stopped && *stopped) return {};
        const std::size_t count = std::min(kBatch, evaluated.size() - begin);
        evaluate(std::span(evaluated).subspan(begin, count), shift, way, is_last);
        for (std::size_t i = 0; i < count; ++i) {
          Block block = evaluated[begin + i];
          block.lower = bounds_[i].least, block.upper = bounds_[i].most;
          if (is_last || suffice(bounds_[i], block.lower, block.upper, way) || is_hopeless(bounds_[i], shift))
            fill(block, shift, cell(block.lower, block.upper));
          else
            halve(block);
        }
      }
      if (next.empty()) break;
      --shift[axis];
      std::swap(blocks, next);
    }
    table_.join_cells();
    return std::move(table_);
  }

 private:
  struct Block {
    std::uint32_t at[2];  // first fine cell in each column
    double lower, upper;  // known of the distance, from a block that holds it
  };
  struct Bounds {
    double lower, upper;  // in the middle
    double least, most;   // throughout the block
  };

  void take_error();
  void take_cells();
  void evaluate(std::span<const Block> blocks, const std::uint32_t (&shift)[2], double way, bool is_last);
  void evaluate_parts(double way, bool is_last);
  void narrow_block(const PartTask& task, const Vec3d& normal, const Vec3d& middle, Bounds& bounds);
  void evaluate_meshes(double way);
  std::uint32_t fine_shift(int c) const {
    return c < static_cast<int>(table_.column_count) ? table_.columns[c].shift + kFiner : 0;
  }
  double fine_width(int c) const { return 1 / (table_.columns[c].cells_per_unit * (1 << kFiner)); }
  // Half of a block's width, enlarged by the rounding of cells and their positions.
  double half_of(int c, std::uint32_t shift) const {
    if (c >= static_cast<int>(table_.column_count)) return 0;
    const TableColumn& column = table_.columns[c];
    return std::ldexp(fine_width(c), static_cast<int>(shift)) / 2 * kAbove +
           0x1p-40 * (std::abs(column.least) + std::abs(column.most));
  }
  double way_of(const double (&half)[2]) const {
    std::vector<double> change(robot_.columns(), 0);
    for (std::size_t c = 0; c < table_.column_count; ++c) change[table_.columns[c].column] = half[c];
    double least = kInf;
    for (const MotionPath& path : paths_) least = std::min(least, path.way(change, travel_));
    return least;
  }
  double way_along(int c, double by) const {
    const double half[2] = {c == 0 ? by : 0, c == 1 ? by : 0};
    return way_of(half);
  }
  static bool suffice(const Bounds& at_centre, double lower, double upper, double way) {
    return lower >= kFar || upper <= -kDeep || way * kPrecision <= std::max(at_centre.lower, -at_centre.upper);
  }
  // Whether the bounds at a block's middle may end its halving.
  bool may_suffice(const Block& block, const std::uint32_t (&shift)[2], double way) const {
    return block.upper >= kFar || block.lower <= -kDeep || is_cell(shift) ||
           way * kPrecision <= std::max(block.upper, -block.lower);
  }
  bool is_cell(const std::uint32_t (&shift)[2]) const { return has_mesh_ && shift[0] <= kFiner && shift[1] <= kFiner; }
  // Meshes that overlap in a cell have no depth that would decide more of it.
  bool is_hopeless(const Bounds& at_centre, const std::uint32_t (&shift)[2]) const {
    return at_centre.lower <= 0 && is_cell(shift);
  }
  // Rounded outward.
  static TableCell cell(double lower, double upper) {
    constexpr double kRounding = 0x1p-20;  // more than that of sums and of the division
    const double low = std::floor(lower / JointTable::kUnit - kRounding),
                 high = std::ceil(upper / JointTable::kUnit + kRounding);
    const auto limited = [](double x) {
      return static_cast<std::int16_t>(std::clamp(x, double{TableCell::kNoLow}, double{TableCell::kNoHigh}));
    };
    return {limited(low), limited(high)};
  }
  void fill(const Block& block, const std::uint32_t (&shift)[2], TableCell bounds) {
    std::size_t begin[2], end[2];
    for (int c = 0; c < 2; ++c) {
      const std::uint32_t finer = c < static_cast<int>(table_.column_count) ? kFiner : 0;
      begin[c] = block.at[c] >> finer;
      end[c] = ((block.at[c] + (1u << shift[c]) - 1) >> finer) + 1;
    }
    for (std::size_t i = begin[0]; i < end[0]; ++i)
      for (std::size_t j = begin[1]; j < end[1]; ++j) {
        TableCell& at = table_.cells[(i << table_.columns[1].shift) + j];
        at = {std::min(at.low, bounds.low), std::max(at.high, bounds.high)};
      }
  }

  const TablePair& pair_;
  const Kinematics& robot_;
  const std::vector<MotionPath> paths_;
  JointTable table_;
  double travel_ = 0;  // of all positions of the table
  double error_ = 0;   // of the poses' distance, from their exact one
  std::vector<Bounds> bounds_;
  std::vector<double> positions_;
  std::vector<Pose> poses_;
  std::vector<Status> status_;
  std::vector<PoseMatrix> places_;
  std::vector<PartTask> tasks_;
  std::vector<Body> bodies_;  // both links
  bool has_mesh_ = false;
  MeshGapSearch mesh_gaps_;
  std::optional<BlockPlanes> planes_;
};

// Sliding joints are farthest out at a corner of the table.
void JointTableMaker::take_error() {
  std::vector<double> corner(robot_.columns(), 0);
  for (int k = 0; k < 4; ++k) {
    for (std::size_t c = 0; c < table_.column_count; ++c)
      corner[table_.columns[c].column] = k >> c & 1 ? table_.columns[c].most : table_.columns[c].least;
    travel_ = std::max(travel_, robot_.travel(corner) * kAbove);
  }
  error_ = robot_.error_between(pair_.a.link, pair_.a.extent, pair_.b.link, pair_.b.extent).at(travel_, 0);
}

// Cells of both columns move the links by about the same distance.
void JointTableMaker::take_cells() {
  const bool has_two = table_.column_count == 2;
  const std::uint32_t shifts = kCellsShift[has_two];
  double length[2] = {0, 0}, way[2] = {1, 1};
  for (std::size_t c = 0; c < table_.column_count; ++c) {
    const TableColumn& column = table_.columns[c];
    length[c] = column.turns_per_cell > 0 ? kTurn : std::max(column.most - column.least, 1e-9);
    way[c] = std::max(way_along(static_cast<int>(c), length[c]), 1e-9);
  }
  const double share = std::round((shifts + std::log2(way[0] / way[1])) / 2);
  const std::uint32_t first =
      has_two ? static_cast<std::uint32_t>(std::clamp<double>(share, kLeastShift, shifts - kLeastShift)) : shifts;
  for (std::size_t c = 0; c < table_.column_count; ++c) {
    TableColumn& column = table_.columns[c];
    column.shift = c == 0 ? first : shifts - first;
    column.cells_per_unit = column.count() / length[c];
    if (column.turns_per_cell > 0) column.turns_per_cell = 1.0 / column.count();
  }
  if (!has_two) table_.columns[1].least = -kInf, table_.columns[1].most = kInf;
  table_.cells.assign(std::size_t{1} << shifts, {TableCell::kNoHigh, TableCell::kNoLow});
}

void JointTableMaker::evaluate(std::span<const Block> blocks, const std::uint32_t (&shift)[2], double way,
                               bool is_last) {
  const std::size_t count = blocks.size(), columns = robot_.columns(), links = robot_.links();
  positions_.assign(count * columns, 0);
  poses_.resize(count * links);
  status_.resize(count);
  for (std::size_t k = 0; k < count; ++k)
    for (int c = 0; c < static_cast<int>(table_.column_count); ++c)
      positions_[k * columns + table_.columns[c].column] =
          table_.columns[c].begin + (blocks[k].at[c] + 0.5 * (1u << shift[c])) * fine_width(c);
  const std::vector<Pose> roots(robot_.roots().size());
  robot_.place(positions_, roots, poses_, status_);
  places_.clear();
  for (std::size_t k = 0; k < count; ++k)
    for (const std::uint32_t link : {pair_.a.link, pair_.b.link}) {
      const Pose& X = poses_[k * links + link];
      places_.push_back({rotation_of(X), X.translation, X});
    }
  bounds_.assign(count, {kInf, kInf, kInf, kInf});
  if (has_mesh_)
    evaluate_meshes(way);
  else
    evaluate_parts(way, is_last);
  for (std::size_t k = 0; k < count; ++k)
    if (status_[k] != Status::kOk) bounds_[k] = {-kInf, kInf, -kInf, kInf};
}

void JointTableMaker::evaluate_meshes(double way) {
  for (std::size_t k = 0; k < bounds_.size(); ++k) {
    const MeshGap gap =
        mesh_gaps_.of(bodies_[0], places_[2 * k], bodies_[1], places_[2 * k + 1], way / 4, kFar + way + error_);
    bounds_[k] = {gap.lower, gap.upper, gap.lower - (way + error_), gap.upper + (way + error_)};
  }
}

void JointTableMaker::evaluate_parts(double way, bool is_last) {
  const std::size_t count = bounds_.size();
  tasks_.clear();
  for (std::size_t k = 0; k < count; ++k)
    for (const ConvexPartPtr& a : pair_.a.parts)
      for (const ConvexPartPtr& b : pair_.b.parts)
        tasks_.push_back({a.get(), b.get(), &places_[2 * k], &places_[2 * k + 1], kFar + way + error_,
                          static_cast<std::uint32_t>(k), std::min(kDeep + way + error_, way * kPrecision + error_)});
  const auto take = [&](const PartTask& task, double lower, double upper, const Vec3d& normal, const Vec3d& middle) {
    Bounds of_parts{lower, upper, lower - (way + error_), upper + (way + error_)};
    if (is_last) narrow_block(task, normal, middle, of_parts);
    Bounds& bounds = bounds_[task.id];
    bounds = {std::min(bounds.lower, of_parts.lower), std::min(bounds.upper, of_parts.upper),
              std::min(bounds.least, of_parts.least), std::min(bounds.most, of_parts.most)};
  };
  PartBatch batch({.limits = {.abs_tol = way / 16}, .lanes = &lane_kernels()[0], .f32 = true});
  batch.run(
      tasks_,
      [&](const PartTask& task, const LaneAnswer& lane, const LaneWitness& witness) {
        take(task, lane.lower, lane.upper, witness.n * (1 / witness.n_length), {0, 0, 0});
      },
      [&](const PartTask& task, const NarrowAnswer& answer) {
        const Vec3d middle = (task.pose_a->t_w + answer.point_a + task.pose_b->t_w + answer.point_b) * 0.5;
        take(task, answer.bounds.lower, answer.bounds.upper, answer.normal, middle);
      });
}

// Narrows the bounds of two parts throughout a block that will not be halved.
// \param normal, middle of the parts in its middle; the latter for parts that overlap
void JointTableMaker::narrow_block(const PartTask& task, const Vec3d& normal, const Vec3d& middle, Bounds& bounds) {
  const bool is_apart = bounds.lower > 0 && bounds.least < kFar, overlaps = bounds.upper <= 0 && bounds.most >= 0;
  if (!is_apart && !overlaps) return;
  planes_->take_middle(std::span(poses_).subspan(task.id * robot_.links(), robot_.links()));
  if (is_apart)
    bounds.least = std::max(bounds.least, planes_->gap(*task.a, *task.pose_a, *task.b, *task.pose_b, normal));
  if (!overlaps) return;
  const std::size_t count_b = pair_.b.parts.size(),
                    number = static_cast<std::size_t>(&task - tasks_.data()) % (pair_.a.parts.size() * count_b);
  const double held = planes_->shared(number / count_b, *task.pose_a, number % count_b, *task.pose_b, middle);
  if (held > 0) bounds.most = std::min(bounds.most, -held);
}

}  // namespace

JointTable empty_joint_table(const TablePair& pair) {
  const FpEnvironment environment;
  return JointTableMaker(pair).take();
}

std::optional<JointTable> make_joint_table(const TablePair& pair, const std::atomic<bool>* stopped) {
  const FpEnvironment environment;
  return JointTableMaker(pair).make(stopped);
}

}  // namespace clearance
