// A query made ready: validated, its pairs resolved, its size known.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "engine/scene/link_motion.h"
#include "engine/selection/margins.h"
#include "engine/selection/pair_lister.h"
#include "engine/selection/query.h"
#include "engine/selection/query_key.h"
#include "engine/state/pose_store.h"
#include "engine/uncertainty/pose_uncertainty.h"

namespace clearance {

/// A query, copied and resolved against one snapshot.
struct Plan {
  QueryView query;                       ///< its spans point into the members below
  std::vector<std::uint32_t> bodies;     ///< (M,) the query's, then the links of `motions`
  std::size_t given_bodies = 0;          ///< of `bodies`: the query's, whose poses are `configurations`
  std::span<const Pose> configurations;  ///< (K, given_bodies); the caller's until they are kept
  std::vector<Pose> kept_configurations;
  std::vector<std::uint32_t> joints;  ///< (J,)
  std::span<const double> positions;  ///< (K, J); as `configurations`
  std::vector<double> kept_positions;
  std::vector<double> weights;       ///< of the joints, for kFieldFreeScale
  std::vector<LinkMotion> motions;   ///< of each robot that some of the joints move
  std::vector<std::uint32_t> moved;  ///< bodies and their followers, parents first
  std::shared_ptr<const PoseSnapshot> snapshot;
  PairList pairs;
  Margins margins;  ///< of the pairs, for Reduce::kAny and motions
  QuerySize size;
  std::int64_t begun_ns = 0;  ///< monotonic_ns(): ages of poses are as of then
  std::vector<PoseUncertainty>
      uncertainties;                 ///< of each body in the snapshot, as of then; empty: nothing is doubted of any
  std::optional<QueryKey> question;  ///< what it answers, if the same may be asked again; none: it is not kept
  std::uint64_t round = 0;           ///< how often it was asked again before

  /// A number that no other configuration has, nor the same one in another round: what was found there can be known by
  /// it.
  std::uint64_t number(std::uint64_t configuration) const { return round * size.configurations + configuration; }
  /// Takes the configurations of a query for those that it has. Throws QueryError where they are not as many numbers.
  void take_configurations(const QueryView& asked);
  /// Copies configurations and positions, whose memory is the caller's.
  void keep_configurations();
};

/// A plan in the making.
class Planner {
 public:
  /// Checks the query. Throws QueryError. \param query what it points to must stay, its configurations longer than
  /// this.
  /// \param scene must outlive this. \param with_configurations false: only sizes and pairs are wanted.
  /// \param with_question the plan may be asked again (kept_jobs.h)
  Planner(const QueryView& query, const Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
          std::uint64_t max_rows, bool with_configurations, bool with_question = false);
  /// Lists pairs until the slice is over. Returns true once the plan is whole. Throws QueryError.
  bool advance(WorkMeter& meter);
  /// Once advance() has returned true.
  Plan& plan() { return plan_; }
  const Plan& plan() const { return plan_; }

 private:
  void settle_size();

  Plan plan_;
  const Scene& scene_;
  std::uint64_t max_rows_;
  std::optional<PairLister> lister_;  // until all pairs are listed
};

/// The same at once.
Plan make_plan(const QueryView& query, const Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
               std::uint64_t max_rows, bool with_configurations);

/// What warm state is kept for: the same pairs in as many configurations. A false match would cost time only.
std::uint64_t warm_question(const Plan& plan);

}  // namespace clearance
