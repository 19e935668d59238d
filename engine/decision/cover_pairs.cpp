// The pairs of a CoverPlan: obstacles, and radii with slack and margin.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "engine/decision/cover_plan_builder.h"

namespace clearance {

using namespace cover_plan;

namespace {

constexpr std::size_t kFewObstacles = 32;  // all in one leaf
constexpr std::size_t kMostInLeaf = 4;

// Bound on the distance of an obstacle's points from its centre, in metres.
double reach_of(const Obstacle& o) {
  const double x = o.half[0], y = o.half[1], z = o.half[2];
  const auto longer = [&](double core) { return (core + o.radius + o.error) * (1 + 0x1p-40); };
  switch (o.kind) {
    case Obstacle::Kind::kSegment:
      return longer(z);
    case Obstacle::Kind::kBox:
      return longer(std::sqrt(x * x + y * y + z * z));
    case Obstacle::Kind::kCylinder:
      return longer(std::sqrt(x * x + z * z));
    case Obstacle::Kind::kPlanes:
      return longer(o.outer_radius);
    case Obstacle::Kind::kHalfSpace:
    case Obstacle::Kind::kCloud:
      break;
  }
  return kNever;
}

// A box that holds an obstacle's core, and how far the obstacle's points are from it at most.
std::pair<ObstacleBox, double> box_of(const Obstacle& o) {
  using Kind = Obstacle::Kind;
  const double round = o.half[0], z = o.half[2];
  ObstacleBox box{o.at, {}};
  if (o.kind == Kind::kHalfSpace || o.kind == Kind::kCloud) return {box, HUGE_VAL};
  if (o.kind == Kind::kPlanes) return {box, double{o.outer_radius} + o.radius};
  const double half[3] = {o.kind == Kind::kSegment ? 0 : round,
                          o.kind == Kind::kSegment    ? 0
                          : o.kind == Kind::kCylinder ? round
                                                      : o.half[1],
                          z};
  for (std::size_t i = 0; i < 3; ++i) {
    double sum = o.is_aligned ? half[i] : 0;
    for (std::size_t k = 0; k < 3 && !o.is_aligned; ++k) sum += std::abs(double{o.axes[3 * k + i]}) * half[k];
    box.half[i] = up(sum * (1 + 0x1p-20));
  }
  return {box, o.radius};
}

}  // namespace

// Whether a body is a cloud without points, which is beyond every distance.
bool CoverPlanBuilder::is_nowhere(std::uint32_t b) const {
  return b < slot_.size() && scene_.bodies()[b].cloud == CloudState::kEmpty &&
         snapshot_.placed[b].status == Status::kOk;
}

// The first of a body's obstacles; kNone for a body that balls cannot see.
std::uint32_t CoverPlanBuilder::obstacles_of(std::uint32_t b) {
  if (obstacle_of_[b] != kUnseen) return obstacle_of_[b];
  obstacle_of_[b] = kNone;
  const Body& body = scene_.bodies()[b];
  const BodyPlacement& placed = snapshot_.placed[b];
  if (placed.status != Status::kOk || (is_cloud(body) && body.cloud != CloudState::kPoints) || body.parts.empty())
    return kNone;
  const Pose X = in_frame(placed.pose.X_wb);
  if (check(X) == PoseQuality::kBad) return kNone;
  const Mat3d rotation = in_frame(placed.pose.R_wb);
  const double world_error = kWorldUnit * (norm(frame_inverse_.translation) + norm(placed.pose.t_w));
  std::vector<Obstacle> obstacles;
  for (const ConvexPartPtr& part : body.parts) {
    const std::shared_ptr<const ObstacleShape> shape = store_.obstacle_shapes().of(part);
    if (!shape) return kNone;
    std::optional<Obstacle> obstacle = make_obstacle(*shape, rotation, X.translation, reach_);
    if (!obstacle) return kNone;
    obstacle->error = up(obstacle->error + world_error);
    obstacles.push_back(std::move(*obstacle));
  }
  obstacle_of_[b] = static_cast<std::uint32_t>(out_->obstacles_.size());
  parts_of_.resize(obstacle_of_[b] + obstacles.size());
  parts_of_[obstacle_of_[b]] = static_cast<std::uint32_t>(obstacles.size());
  for (Obstacle& obstacle : obstacles) out_->obstacles_.push_back(std::move(obstacle));
  return obstacle_of_[b];
}

void CoverPlanBuilder::take(std::uint64_t position) {
  const BodyPair pair = plan_.pairs.at(position);
  const auto slot_of = [&](std::uint32_t b) { return b < slot_.size() ? slot_[b] : kNone; };
  std::uint32_t a = slot_of(pair.a), b = slot_of(pair.b), other = pair.b;
  if (a != kNone && b != kNone) return take_moved(position, a, b);
  if (a == kNone) a = b, other = pair.a;
  if (a != kNone && cover(a) && is_nowhere(other)) return;
  const std::uint32_t first = a == kNone || other >= slot_.size() || !cover(a) ? kNone : obstacles_of(other);
  if (first == kNone) return out_->unknown_.push_back(position);
  const Slack slack = slack_.of(pair);
  for (std::uint32_t o = first; o < first + parts_of_[first]; ++o)
    obstacle_pairs_.push_back({o, a, position, plan_.margins.of(position), slack});
}

void CoverPlanBuilder::take_moved(std::uint64_t position, std::uint32_t a, std::uint32_t b) {
  if (!cover(a) || !cover(b)) return out_->unknown_.push_back(position);
  const BodyPair pair = plan_.pairs.at(position);
  const Slack slack = slack_.of(pair);
  const double margin = plan_.margins.of(position), sizes = double{cover(a)->root.outer} + cover(b)->root.outer;
  const double error = errors_[a] + errors_[b] + 8 * kUnit * (sizes + margin + 2 * reach_);
  out_->moved_pairs_.push_back({a, b, position, up((margin + slack.inner + error) * (1 + 0x1p-40)),
                                down(margin - (slack.outer + error) * (1 + 0x1p-40)), out_->tables_.at(position)});
}

// Puts obstacles into the order of their tree.
void CoverPlanBuilder::sort_obstacles() {
  std::vector<Obstacle>& obstacles = out_->obstacles_;
  std::vector<std::uint32_t> order(obstacles.size()), rank(obstacles.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto near = std::stable_partition(
      order.begin(), order.end(), [&](std::uint32_t o) { return obstacles[o].kind == Obstacle::Kind::kHalfSpace; });
  const auto unbounded = static_cast<std::uint32_t>(near - order.begin());
  if (unbounded > 0) out_->nodes_.push_back({{0, 0, 0}, 0, unbounded, 1});
  divide_obstacles(std::span(order).subspan(unbounded), unbounded);
  std::vector<Obstacle> sorted;
  for (const std::uint32_t o : order) {
    rank[o] = static_cast<std::uint32_t>(sorted.size());
    sorted.push_back(std::move(obstacles[o]));
  }
  obstacles = std::move(sorted);
  for (ObstaclePair& pair : obstacle_pairs_) pair.obstacle = rank[pair.obstacle];
}

// Adds a node for some obstacles, and those below.
// \param first their number in the order of the tree
void CoverPlanBuilder::divide_obstacles(std::span<std::uint32_t> order, std::uint32_t first) {
  if (order.empty()) return;
  const auto at = [&](std::uint32_t o) -> const std::array<float, 3>& { return out_->obstacles_[o].at; };
  std::array<float, 3> low = at(order[0]), high = low, middle{};
  for (const std::uint32_t o : order)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], at(o)[k]), high[k] = std::max(high[k], at(o)[k]);
  std::size_t axis = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    middle[k] = 0.5f * low[k] + 0.5f * high[k];
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  }
  const std::size_t node = out_->nodes_.size(), half = order.size() / 2;
  const bool is_leaf = order.size() <= (out_->obstacles_.size() <= kFewObstacles ? kFewObstacles : kMostInLeaf);
  out_->nodes_.push_back({middle, first, is_leaf ? first + static_cast<std::uint32_t>(order.size()) : first, 0});
  if (!is_leaf) {
    std::nth_element(
        order.begin(), order.begin() + static_cast<std::ptrdiff_t>(half), order.end(),
        [&](std::uint32_t a, std::uint32_t b) { return std::pair(at(a)[axis], a) < std::pair(at(b)[axis], b); });
    divide_obstacles(order.first(half), first);
    divide_obstacles(order.subspan(half), first + static_cast<std::uint32_t>(half));
  }
  out_->nodes_[node].skip = static_cast<std::uint32_t>(out_->nodes_.size());
}

// From the leaves up.
void CoverPlanBuilder::bound_nodes() {
  CoverPlan& out = *out_;
  const std::size_t columns = out.root_x_.size();
  out.node_bound_.assign(out.nodes_.size() * columns, -kNever);
  for (std::size_t n = out.nodes_.size(); n-- > 0;) {
    const ObstacleNode& node = out.nodes_[n];
    float* const bound = out.node_bound_.data() + n * columns;
    const auto take = [&](const float* radii, const std::array<float, 3>& at, double reach) {
      const double more = norm(Vec3d{at[0], at[1], at[2]} - Vec3d{node.at[0], node.at[1], node.at[2]}) + reach;
      for (std::size_t c = 0; c < columns; ++c)
        if (radii[c] > -kNever) bound[c] = std::max(bound[c], up((radii[c] + more) * (1 + 0x1p-20)));
    };
    for (std::uint32_t o = node.first; o < node.last; ++o)
      take(out.root_outer_.data() + o * columns, out.obstacles_[o].at, reach_of(out.obstacles_[o]));
    if (node.first < node.last) continue;
    for (std::size_t below = n + 1; below < node.skip; below = out.nodes_[below].skip)
      take(out.node_bound_.data() + below * columns, out.nodes_[below].at, 0);
  }
}

// Puts a moved pair into a row with a free place for it.
void CoverPlanBuilder::add_to_row(std::uint32_t k) {
  const MovedPair& pair = out_->moved_pairs_[k];
  const std::uint32_t lane = pair.b % kColumns;
  std::vector<MovedRow>& rows = out_->moved_rows_;
  auto row = std::find_if(rows.begin(), rows.end(), [&](const MovedRow& r) {
    return r.a == pair.a && r.begin == pair.b - lane && r.pair[lane] == kNone;
  });
  if (row == rows.end()) {
    row = rows.insert(row, {pair.a, pair.b - lane, {}, {}});
    std::fill_n(row->reach, kColumns, -kNever);
    std::fill_n(row->pair, kColumns, kNone);
  }
  row->reach[lane] = up(double{out_->moved_reach_[k]} * (1 + 0x1p-20));
  row->pair[lane] = k;
}

// Columns of the kernel.
// Leaves pairs that the query lists before to the exact engine: a body and an obstacle have one cell.
void CoverPlanBuilder::leave_repeats(std::size_t columns) {
  std::vector<std::uint8_t> is_taken(columns * out_->obstacles_.size());
  std::vector<std::uint64_t>& unknown = out_->unknown_;
  const std::size_t before = unknown.size();
  std::erase_if(obstacle_pairs_, [&](const ObstaclePair& p) {
    std::uint8_t& taken = is_taken[p.obstacle * columns + p.body];
    if (taken) unknown.push_back(p.position);
    return std::exchange(taken, 1) != 0;
  });
  if (unknown.size() == before) return;
  std::ranges::sort(unknown);
  unknown.erase(std::unique(unknown.begin(), unknown.end()), unknown.end());
}

void CoverPlanBuilder::finish() {
  CoverPlan& out = *out_;
  sort_obstacles();
  const std::size_t columns = (out.bodies_.size() + kColumns - 1) / kColumns * kColumns,
                    cells = columns * out.obstacles_.size();
  leave_repeats(columns);
  for (auto* of_columns : {&out.root_x_, &out.root_y_, &out.root_z_}) of_columns->assign(columns, 0);
  for (auto* radii : {&out.moved_root_outer_, &out.moved_root_inner_}) radii->assign(columns, -kNever);
  for (std::size_t i = 0; i < out.bodies_.size(); ++i)
    if (const Cover* const c = out.covers_[i].get()) {
      out.root_x_[i] = c->root.centre[0], out.root_y_[i] = c->root.centre[1], out.root_z_[i] = c->root.centre[2];
      out.moved_root_outer_[i] = c->root.outer, out.moved_root_inner_[i] = c->root.inner;
    }
  const std::size_t moved =
      (out.moved_pairs_.size() + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls;
  for (auto* bodies : {&out.moved_a_, &out.moved_b_}) bodies->assign(moved, 0);
  out.moved_reach_.assign(moved, -kNever);
  for (std::size_t k = 0; k < out.moved_pairs_.size(); ++k) {
    const MovedPair& pair = out.moved_pairs_[k];
    out.moved_a_[k] = static_cast<std::int32_t>(pair.a), out.moved_b_[k] = static_cast<std::int32_t>(pair.b);
    out.moved_reach_[k] = up(double{cover(pair.a)->root.outer} + cover(pair.b)->root.outer + pair.grow);
    add_to_row(static_cast<std::uint32_t>(k));
  }
  for (auto* radii : {&out.box_reach_, &out.root_outer_, &out.root_inner_, &out.grow_, &out.shrink_})
    radii->assign(cells, -kNever);
  std::vector<double> boxed;  // by obstacle: from its box to a root's surface that may touch it, at least
  for (const Obstacle& o : out.obstacles_) {
    const auto [box, reach] = box_of(o);
    const auto length = [](const std::array<float, 3>& v) { return norm(Vec3d{v[0], v[1], v[2]}); };
    out.boxes_.push_back(box);
    boxed.push_back(reach + 16 * kUnit * (reach_ + length(box.at) + length(box.half)));
  }
  out.position_.assign(cells, 0);
  out.table_of_cell_.assign(cells, kNoTable);
  for (const std::uint64_t position : out.unknown_) out.tables_.disable(position);
  for (const ObstaclePair& p : obstacle_pairs_) {
    const CoverBall& root = cover(p.body)->root;
    const std::size_t at = p.obstacle * columns + p.body;
    const double error = errors_[p.body] + out.obstacles_[p.obstacle].error +
                         4 * kUnit * (double{root.outer} + std::abs(root.inner) + p.margin + p.slack.inner);
    const double grow = (p.margin + p.slack.inner + error) * (1 + 0x1p-40),
                 shrink = p.margin - (p.slack.outer + error) * (1 + 0x1p-40);
    out.grow_[at] = up(grow);
    out.shrink_[at] = down(shrink);
    out.box_reach_[at] = up((root.outer + grow + boxed[p.obstacle]) * (1 + 0x1p-20));
    out.root_outer_[at] = up(root.outer + grow);
    out.root_inner_[at] = down(root.inner + shrink);
    out.position_[at] = p.position;
    out.table_of_cell_[at] = out.tables_.at(p.position);
  }
  bound_nodes();
  out.view_ = {out.bodies_.data(),
               static_cast<std::uint32_t>(out.bodies_.size()),
               static_cast<std::uint32_t>(columns),
               out.root_x_.data(),
               out.root_y_.data(),
               out.root_z_.data(),
               out.moved_root_outer_.data(),
               out.moved_root_inner_.data(),
               out.obstacles_.data(),
               static_cast<std::uint32_t>(out.obstacles_.size()),
               out.boxes_.data(),
               out.box_reach_.data(),
               out.root_outer_.data(),
               out.root_inner_.data(),
               out.grow_.data(),
               out.shrink_.data(),
               out.position_.data(),
               out.moved_pairs_.data(),
               out.moved_a_.data(),
               out.moved_b_.data(),
               out.moved_reach_.data(),
               static_cast<std::uint32_t>(out.moved_pairs_.size()),
               out.moved_rows_.data(),
               static_cast<std::uint32_t>(out.moved_rows_.size()),
               out.table_of_cell_.data(),
               out.tables_.pairs().data(),
               static_cast<std::uint32_t>(out.tables_.pairs().size()),
               out.nodes_.data(),
               static_cast<std::uint32_t>(out.nodes_.size()),
               out.node_bound_.data()};
}

}  // namespace clearance
