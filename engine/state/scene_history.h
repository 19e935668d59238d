// What the changes of a scene have changed: whether a question that names an older revision still means the same.
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

/// Changes are numbered. A revision (a digest, which may come back) is known by the number of the last change under
/// which it was the scene's; whatever a question names must not have changed since. Thread-safe.
class SceneHistory {
 public:
  /// Revisions, and changed pairs, that are remembered; what is older is answered as unknown.
  static constexpr std::size_t kRemembered = 4096;

  SceneHistory() = default;
  SceneHistory(const SceneHistory&) = delete;

  /// A body follows another one (kNone: none) from now on. \param revision the scene's before that. \param ignored
  /// pairs that have become or ceased to be ignored with it.
  void attached(std::uint64_t revision, std::uint32_t child, std::uint32_t was, std::uint32_t is,
                std::span<const BodyPair> ignored);
  /// Pairs have become or ceased to be ignored.
  void ignored(std::uint64_t revision, std::span<const BodyPair> pairs);
  struct State {
    const Scene& scene;
    std::span<const std::uint32_t> parents;  ///< of each body
    std::span<const BodyPair> ignored;       ///< ascending
  };
  /// Another scene has come: bodies of the same id, name and pieces are the same.
  void replaced(const SceneHistory& old, std::uint64_t old_revision, const State& was, const State& is);
  /// Changes so far: a snapshot keeps it, so that nothing is judged by changes that came after it.
  std::uint64_t changes() const;

  /// Whether body ids and group selectors of a revision mean the same after `changes` changes. \param with_parents also
  /// that those bodies have the parents that they had: their poses are relative to them.
  bool ids_valid_since(std::uint64_t revision, std::uint64_t changes, std::span<const std::uint32_t> selectors,
                       bool with_parents) const;
  /// What a query names of the scene.
  struct RevisionCheck {
    std::uint64_t revision;                 ///< the scene that it was asked of
    std::span<const std::uint32_t> bodies;  ///< that it moves
    std::span<const BodyPair> pairs;        ///< selectors
    std::span<const MarginEntry> margins;   ///< their selectors; every body means the same in any scene
    bool a_row_for_each_body;
  };
  /// Whether a question has the same bodies and pairs, in the same order. \param scene the one after the changes.
  bool ids_valid_since(const RevisionCheck& question, std::uint64_t changes, const Scene& scene) const;

 private:
  struct ChangedPair {
    std::uint64_t change;
    std::uint32_t a, b;
  };

  void begin_change(std::uint64_t revision);
  void note(std::span<const BodyPair> changed);
  void forget_old();
  /// The change under which a revision was the scene's last; false: it is unknown, or others have come after `changes`.
  bool find(std::uint64_t revision, std::uint64_t changes, std::uint64_t& since) const;
  bool unchanged(std::uint32_t selector, std::uint64_t since, bool with_parents) const;
  bool pairs_unchanged(BodyPair pair, std::uint64_t since, const Scene& scene) const;

  mutable std::mutex mutex_;
  std::uint64_t changes_ = 0;
  std::unordered_map<std::uint64_t, std::uint64_t> seen_;                     // by revision
  std::deque<std::pair<std::uint64_t, std::uint64_t>> order_;                 // revision and change, the oldest first
  std::vector<std::uint64_t> body_changed_, parent_changed_, group_changed_;  // by id: the last change
  std::uint64_t bodies_changed_ = 0;                                          // of any of them
  std::deque<ChangedPair> pairs_;                                             // that became or ceased to be enabled
  std::uint64_t forgotten_ = 0;                                               // changes up to this one
};

}  // namespace clearance
