#include "engine/joint_table/joint_table_maker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/hull/primitive.h"
#include "engine/joint_table/block_bounds.h"
#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kCellsShift[2] = {12, 16};  // cells of a table for one joint, and for two
constexpr std::uint32_t kLeastShift = 3;            // of each of two columns
constexpr std::uint32_t kFiner = 2;                 // halvings of a cell in each column, where the links are close
constexpr std::size_t kMostEvaluated = 400'000;     // positions; the rest keeps the bounds of larger blocks
constexpr std::size_t kMostOfMeshes = 100'000;      // the same for meshes, which take longer
constexpr std::size_t kBatch = 64;                  // positions of one evaluation, which a stop waits for
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kAbove = 1 + 0x1p-40;

// Evaluates blocks of positions, and halves them until their bounds suffice.
class JointTableMaker {
 public:
  explicit JointTableMaker(const TablePair& pair)
      : pair_(pair),
        robot_(pair.robot->kinematics),
        paths_(paths_between(robot_, pair.a.link, pair.a.ball, pair.b.link, pair.b.ball)) {
    table_.column_count = static_cast<std::uint32_t>(pair.columns.size());
    for (std::size_t c = 0; c < pair.columns.size(); ++c)
      table_.columns[c] = *table_column(*pair.robot, pair.columns[c]);
    take_travel();
    take_cells();
  }

  JointTable take() { return std::move(table_); }
  std::optional<JointTable> make(const std::atomic<bool>* stopped) {
    BlockBounds bounds(pair_, travel_);
    has_mesh_ = bounds.has_mesh();
    std::vector<Block> blocks{{{0, 0}, -kInf, kInf}}, evaluated, next;
    std::uint32_t shift[2] = {fine_shift(0), fine_shift(1)};  // of the blocks' sizes, in fine cells
    std::size_t seen = 0;
    for (;;) {
      const double half[2] = {half_of(0, shift[0]), half_of(1, shift[1])};
      const double way = way_of(half);
      const bool is_last =
          shift[0] + shift[1] == 0 || (seen += blocks.size()) > (has_mesh_ ? kMostOfMeshes : kMostEvaluated);
      bounds.take_size({std::span(half).first(table_.column_count), way, is_last});
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
        const auto found = bounds.of(middles(std::span(evaluated).subspan(begin, count), shift));
        for (std::size_t i = 0; i < count; ++i) {
          Block block = evaluated[begin + i];
          block.lower = found[i].least, block.upper = found[i].most;
          if (is_last || suffice(found[i], way) || is_hopeless(found[i], shift))
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

  void take_travel();
  void take_cells();
  // Positions in the middles of blocks: (blocks, columns of the robot).
  std::vector<double> middles(std::span<const Block> blocks, const std::uint32_t (&shift)[2]) const;
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
  static bool suffice(const BlockBounds::Bounds& bounds, double way) {
    return bounds.least >= BlockBounds::kFar || bounds.most <= -BlockBounds::kDeep ||
           way * BlockBounds::kPrecision <= std::max(bounds.lower, -bounds.upper);
  }
  // Whether the bounds at a block's middle may end its halving.
  bool may_suffice(const Block& block, const std::uint32_t (&shift)[2], double way) const {
    return block.upper >= BlockBounds::kFar || block.lower <= -BlockBounds::kDeep || is_cell(shift) ||
           way * BlockBounds::kPrecision <= std::max(block.upper, -block.lower);
  }
  bool is_cell(const std::uint32_t (&shift)[2]) const { return has_mesh_ && shift[0] <= kFiner && shift[1] <= kFiner; }
  // Meshes that overlap in a cell have no depth that would decide more of it.
  bool is_hopeless(const BlockBounds::Bounds& bounds, const std::uint32_t (&shift)[2]) const {
    return bounds.lower <= 0 && is_cell(shift);
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
  bool has_mesh_ = false;
};

// Sliding joints are farthest out at a corner of the table.
void JointTableMaker::take_travel() {
  std::vector<double> corner(robot_.columns(), 0);
  for (int k = 0; k < 4; ++k) {
    for (std::size_t c = 0; c < table_.column_count; ++c)
      corner[table_.columns[c].column] = k >> c & 1 ? table_.columns[c].most : table_.columns[c].least;
    travel_ = std::max(travel_, robot_.travel(corner) * kAbove);
  }
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

std::vector<double> JointTableMaker::middles(std::span<const Block> blocks, const std::uint32_t (&shift)[2]) const {
  const std::size_t columns = robot_.columns();
  std::vector<double> positions(blocks.size() * columns, 0);
  for (std::size_t k = 0; k < blocks.size(); ++k)
    for (int c = 0; c < static_cast<int>(table_.column_count); ++c)
      positions[k * columns + table_.columns[c].column] =
          table_.columns[c].begin + (blocks[k].at[c] + 0.5 * (1u << shift[c])) * fine_width(c);
  return positions;
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
