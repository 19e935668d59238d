// History of a scene's changes: decides whether a query for an older revision still has the same meaning.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Numbers the changes of a scene. A revision (a digest, which may recur) maps to the last change at which it was
/// current; the bodies and pairs of a query must be unchanged since. Thread-safe.
class SceneHistory {
 public:
  /// Number of revisions, and of changed pairs, that are kept; older ones count as unknown.
  static constexpr std::size_t kMostRecords = 4096;

  SceneHistory() = default;
  SceneHistory(const SceneHistory&) = delete;

  /// Records a changed attachment.
  /// \param revision the scene's revision before the change
  /// \param was, is old and new parent, or kNone
  /// \param ignored pairs that became or ceased to be ignored with it
  void attached(std::uint64_t revision, std::uint32_t child, std::uint32_t was, std::uint32_t is,
                std::span<const BodyPair> ignored);
  /// Records pairs that became or ceased to be ignored.
  void ignored(std::uint64_t revision, std::span<const BodyPair> pairs);
  struct State {
    const engine::Scene& scene;
    std::span<const std::uint32_t> parents;  ///< of each body
    std::span<const BodyPair> ignored;       ///< ascending
  };
  /// Records the replacement of the scene. Bodies with equal id, name and parts are unchanged.
  void replaced(const SceneHistory& old, std::uint64_t old_revision, const State& was, const State& is);
  /// Number of changes so far. A snapshot stores it, so that later changes do not affect it.
  std::uint64_t changes() const;

  /// Returns whether body ids and group selectors of a revision have the same meaning after `changes` changes.
  /// \param with_parents also requires that those bodies have the same parents, to which their poses are relative
  bool ids_valid_since(std::uint64_t revision, std::uint64_t changes, std::span<const std::uint32_t> selectors,
                       bool with_parents) const;
  /// Returns whether body ids and group selectors of a revision have the same names now, whatever their shapes.
  /// Changes between the caller's snapshot and now count, too.
  bool names_valid_since(std::uint64_t revision, std::span<const std::uint32_t> selectors, bool with_parents) const;
  /// The references of a query into the scene.
  struct RevisionCheck {
    std::uint64_t revision;                 ///< the scene revision of the query
    std::span<const std::uint32_t> bodies;  ///< bodies that it moves
    std::span<const BodyPair> pairs;        ///< selectors
    std::span<const MarginEntry> margins;   ///< their selectors; a selector of all bodies is valid in any scene
    bool a_row_for_each_body;
  };
  /// Returns whether a query has the same bodies and pairs, in the same order.
  /// \param scene the one after the changes
  bool ids_valid_since(const RevisionCheck& check, std::uint64_t changes, const engine::Scene& scene) const;

 private:
  struct ChangedPair {
    std::uint64_t change;
    std::uint32_t a, b;
  };

  void begin_change(std::uint64_t revision);
  void note(std::span<const BodyPair> changed);
  void forget_old();
  /// Finds the last change at which a revision was current. Returns false if it is unknown, or if the scene has changed
  /// since `changes`.
  bool find(std::uint64_t revision, std::uint64_t changes, std::uint64_t& since) const;
  bool unchanged(std::uint32_t selector, std::uint64_t since, bool with_parents) const;
  bool pairs_unchanged(BodyPair pair, std::uint64_t since, const engine::Scene& scene) const;

  mutable std::mutex mutex_;
  std::uint64_t changes_ = 0;
  std::unordered_map<std::uint64_t, std::uint64_t> seen_;                     // by revision
  std::deque<std::pair<std::uint64_t, std::uint64_t>> order_;                 // revision and change, oldest first
  std::vector<std::uint64_t> body_changed_, parent_changed_, group_changed_;  // by id: the last change
  std::vector<std::uint64_t> body_renamed_, group_renamed_;                   // by id: last change of names alone
  std::uint64_t bodies_changed_ = 0;                                          // last change of any body
  std::deque<ChangedPair> pairs_;                                             // newly enabled or disabled pairs
  std::uint64_t forgotten_ = 0;                                               // changes up to this one are forgotten
};

}  // namespace clearance
