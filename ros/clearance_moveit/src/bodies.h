// The shapes of a robot, of its attached bodies and of a world as bodies of one engine, and the pairs to check.
#pragma once

#include <clearance/engine.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <moveit/collision_detection/collision_env.hpp>
#include <mutex>
#include <optional>
#include <set>
#include <shared_mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "robot_frames.h"

namespace clearance_moveit {

/// A link, an attached body or an object of the world, as MoveIt has it at present.
struct ItemView {
  const std::string& name;
  collision_detection::BodyType type;
  const moveit::core::LinkModel* link;  ///< that it follows, or null
  const std::vector<shapes::ShapeConstPtr>& shapes;
  const EigenSTL::vector_Isometry3d& poses;  ///< X_link_shape, or X_world_shape
  const std::set<std::string>* touch_links;  ///< of an attached body, otherwise null
  double padding, scale;
};

/// A copy of it, with the bodies made from it.
struct Item {
  explicit Item(const ItemView& view);
  bool has_shapes_of(const ItemView& view) const;  ///< the same ones, however placed
  bool is(const ItemView& view) const;

  std::string name;
  collision_detection::BodyType type;
  const moveit::core::LinkModel* link;
  std::vector<shapes::ShapeConstPtr> shapes;
  EigenSTL::vector_Isometry3d poses;
  std::set<std::string> touch_links;
  double padding, scale;
  std::vector<std::vector<std::string>> bodies;  ///< names in the engine, by shape
  std::vector<std::uint32_t> ids;                ///< of all of them
  bool is_whole = true;                          ///< whether the engine has all its shapes
};

enum class Against { kSelf, kWorld };
using Matrix = collision_detection::AllowedCollisionMatrix;
using ItemPair = std::pair<const Item*, const Item*>;
using ActiveLinks = std::set<const moveit::core::LinkModel*>;

/// Pairs of items that a request includes, and queries of these pairs.
struct Plan {
  Against against;
  std::optional<ActiveLinks> active;
  bool has_matrix;
  std::vector<clearance::IdPair> pairs;
  std::size_t pairs_with_depth = 0;  ///< the first ones; those behind have an octree
  std::vector<ItemPair> checked;     ///< the same pairs, of items
  std::vector<ItemPair> allowed;     ///< pairs left out since the matrix allows them
  std::optional<ItemPair> unknown;   ///< a pair that cannot be checked, since an item is not whole
  std::mutex mutex;
  std::vector<clearance::Prepared> checks, motions;  ///< idle ones
};

/// Items in an engine. Lock `mutex` for sharing to query, alone to call become().
class Bodies {
 public:
  explicit Bodies(const RobotFrames& frames);
  Bodies(const Bodies&) = delete;
  Bodies& operator=(const Bodies&) = delete;

  bool are(const std::vector<ItemView>& views) const;
  /// Adds, moves and removes bodies. An item that the engine does not take is logged, and is not whole.
  void become(const std::vector<ItemView>& views);

  /// Returns a plan that leaves out no pair which the matrix does not allow. It may check pairs that the matrix allows,
  /// unless `is_exact`.
  /// \param active links, one of which each pair has; null for all
  std::shared_ptr<Plan> plan(Against against, const Matrix* matrix, const ActiveLinks* active, bool is_exact);
  /// A query of a plan's pairs, at a state or from one to another. Refers to both.
  clearance::Query query(const Plan& plan, const Rows& rows) const;
  /// Answers a query, with depths if it is signed and the pair has one, and calls f(result, row) for each row.
  template <class F>
  void each_row(const Plan& plan, clearance::Query query, F&& f) const {
    const std::size_t signed_pairs = query.signed_distance ? plan.pairs_with_depth : 0;
    for (const bool is_signed : {true, false}) {
      const std::span<const clearance::IdPair> pairs(plan.pairs);
      query.pairs = is_signed ? pairs.first(signed_pairs) : pairs.subspan(signed_pairs);
      query.signed_distance = is_signed;
      if (query.pairs.empty()) continue;
      const clearance::Result result = engine_.distances(query);
      for (std::size_t i = 0; i < result.rows(); ++i) f(result, i);
    }
  }
  /// Verdict of Reduce::kAny, at one row or from one to another.
  clearance::Result run(Plan& plan, const Rows& rows, bool is_motion);
  const Item& item(std::uint32_t body) const { return *items_by_id_.at(body); }

  std::shared_mutex mutex;

 private:
  void add(Item& item);
  void place(const Item& item);
  std::shared_ptr<Plan> make_plan(Against against, const Matrix* matrix, const ActiveLinks* active) const;

  clearance::Engine engine_;
  std::vector<std::uint32_t> joints_, movers_;
  std::vector<std::unique_ptr<Item>> items_;
  std::vector<const Item*> items_by_id_;
  std::uint64_t made_ = 0;  // for names
  std::mutex plans_mutex_;
  std::vector<std::shared_ptr<Plan>> plans_;
};

/// Whether a matrix, or the kind of the pair, allows items to touch. A conditional entry does not.
bool is_allowed(const Matrix* matrix, const Item& a, const Item& b);

}  // namespace clearance_moveit
