// The shapes of a robot, of its attached bodies and of a world as bodies of one engine, and the pairs to check.
#pragma once

#include <clearance/engine.h>
#include <clearance_moveit/collision_env.h>
#include <geometric_shapes/shapes.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "robot_frames.h"

namespace clearance_moveit {

/// A link, an attached body or an object of the world, and the bodies made from it.
struct Item {
  std::string name;
  collision_detection::BodyType type;
  const moveit::core::LinkModel* link;        ///< that it follows, or null
  std::vector<shapes::ShapeConstPtr> shapes;  ///< empty for a link, whose shapes do not change
  EigenSTL::vector_Isometry3d poses;          ///< X_link_shape, or X_world_shape; empty for a link
  std::set<std::string> touch_links;
  double padding, scale;
  std::string cells;  ///< of its octrees, which MoveIt changes in place

  std::vector<std::vector<std::string>> bodies = {};  ///< names in the engine, by shape
  std::vector<std::uint32_t> ids = {};                ///< of all of them
  bool is_whole = true;                               ///< whether the engine has all its shapes
};

/// Cells of the octrees among shapes: equal as long as these have the same occupied ones.
std::string cells_of(const std::vector<shapes::ShapeConstPtr>& shapes);
/// Adds a shape to an engine: one body, or for an octree one for each size of its occupied cells. A closed mesh is the
/// solid that it encloses, an open one its triangles. Throws for other shapes.
/// \param body name, parent, pose and padding
/// \param scale about the shape's centre, as in MoveIt
/// \param names of the bodies are appended
void add_shape(clearance::Engine& engine, clearance::NewBody body, const shapes::Shape& shape, double scale,
               std::vector<std::string>& names);

using Matrix = collision_detection::AllowedCollisionMatrix;
using ItemPair = std::pair<const Item*, const Item*>;
using ActiveLinks = std::set<const moveit::core::LinkModel*>;

/// Whether a matrix allows items to touch. A conditional entry does not.
bool is_allowed(const Matrix* matrix, const ItemPair& pair);

/// Pairs of items that a request includes.
struct Plan {
  Against against;
  std::optional<ActiveLinks> active;
  std::vector<clearance::IdPair> pairs = {};
  std::size_t pairs_with_depth = 0;      ///< the first ones; those behind have an octree
  std::vector<ItemPair> checked = {};    ///< the same pairs, of items
  std::vector<ItemPair> allowed = {};    ///< pairs left out since the matrix allows them
  std::optional<ItemPair> unknown = {};  ///< a pair that cannot be checked, since an item is not whole
  std::mutex mutex = {};                 ///< of the next
  std::vector<clearance::Prepared> checks = {}, motions = {};  ///< idle ones
};

/// Items in an engine. Thread-safe except become().
class Bodies {
 public:
  explicit Bodies(const RobotFrames& frames);
  Bodies(const Bodies&) = delete;
  Bodies& operator=(const Bodies&) = delete;

  bool are(const std::vector<Item>& items) const;
  /// Adds, moves and removes bodies. An item that the engine does not take is logged, and is not whole.
  void become(std::vector<Item> items);

  /// Returns a plan that leaves out no pair which the matrix does not allow. It may check pairs that the matrix allows,
  /// unless `is_exact`.
  /// \param active links, one of which each pair has; null for all
  std::shared_ptr<Plan> plan(Against against, const Matrix* matrix, const ActiveLinks* active, bool is_exact);
  /// Verdict of Reduce::kAny on a plan's pairs, at one row or from one to another.
  clearance::Result run(Plan& plan, const Rows& rows) const;
  /// Answers a query of a plan's pairs at a row, with depths if it is signed and the pair has one.
  std::vector<clearance::Result> distances(const Plan& plan, const Rows& rows, clearance::Query query) const;
  /// Items of row `i` of a result.
  ItemPair items(const clearance::Result& result, std::size_t i) const;

 private:
  void add(Item& item);
  std::shared_ptr<Plan> make_plan(Against against, const Matrix* matrix, const ActiveLinks* active) const;

  clearance::Engine engine_;
  std::vector<std::uint32_t> joints_, movers_;
  std::vector<Item> items_;
  std::vector<const Item*> items_by_id_;
  std::uint64_t made_ = 0;  // for names
  std::mutex plans_mutex_;
  std::vector<std::shared_ptr<Plan>> plans_;  // newest first
};

}  // namespace clearance_moveit
