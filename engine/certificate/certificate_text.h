// The document of a certificate (JSON), written as its rows are proved.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "engine/bvh/surface_rows.h"
#include "engine/narrow/proof.h"
#include "engine/query/job_state.h"

namespace clearance {

/// Proof of a bound on two convex parts, or on two ranges of parts. The elements of a surface count as parts, in their
/// order, in place of the surface (part_place()).
struct PartProof {
  std::uint32_t part_a, part_b;  ///< of their bodies; if both are kNone, the direction is for all pairs of parts
  NarrowProof proof;
  int order = 1;                           ///< of a direction; 2 follows the bodies along it as they move
  std::uint32_t seer = kNone;              ///< body whose frame the motion is measured in; kNone is the world
  std::uint32_t count_a = 1, count_b = 1;  ///< of a direction: number of parts from these on
  /// Of a witness: the body (0 is a, 1 is b) whose solid contains a vertex of the other's part. This body's part is any
  /// element of that solid. kNone if there is none.
  std::uint32_t within = kNone;
};

/// Index of a part, or of the first element of its surface, if elements count as parts.
std::uint32_t part_place(const Body& body, std::uint32_t part);

/// A span of a motion, evaluated at one time, and the pair's uncertainty there. A row without motions has one span.
struct SpanPlace {
  double begin = 0, end = 1, at = 0;
  Slack slack;  ///< of the pair
  SlackParts parts_a, parts_b;
  double joints = 0;                    ///< between links of one robot: joints_between()
  double between_a = 0, between_b = 0;  ///< BodyPoses::chain_slack()
  std::span<const double> progress[2];  ///< CurveSides::progress(); none if unused
};

/// Two points no farther apart than an upper bound, or a closed surface that proves a penetration depth.
struct WitnessProof {
  double time = 0;
  Pose X_wa, X_wb;  ///< as computed
  PartProof proof;
};

/// Time until which a motion is free, and time at which a pair is within its margin.
struct FirstContactProof {
  double free_until = 0, hit_at = 0;    ///< in [0, 1]; infinity if free throughout, or never within a margin
  BodyPair pair{kNone, kNone};          ///< the pair within its margin
  std::optional<WitnessProof> witness;  ///< unset if no pair is, or if that is not proved
};

/// Writes the document of docs/trust/certificates.md: rows, then the bodies they name, their parts, and the values that
/// configurations give them.
class CertificateText {
 public:
  /// \param scene, plan must outlive this
  /// \param most size limit, in bytes
  CertificateText(const engine::Scene& scene, const Plan& plan, std::uint64_t most)
      : scene_(scene), plan_(plan), most_(most) {}

  /// All functions that write throw QueryError beyond the size limit.
  void begin(const ReplyInfo& info);
  void begin_row(std::uint64_t row, std::uint64_t configuration, BodyPair pair, const PairAnswer& answer);
  /// Starts a pair of bodies with usable poses.
  /// \param here any configuration; must stay valid until the pair ends
  /// \param lower lower bound that is proved
  void begin_pair(BodyPair pair, const BodyPoses& here, double margin, double lower);
  void begin_span(BodyPair pair, const SpanPlace& place);
  void add_lower(const PartProof& proof);
  void end_span();
  /// Ends the pair's spans of the row and starts those that prove it free until first contact.
  /// \param lower as for begin_pair()
  void begin_free(double lower);
  void end_pair();
  /// \param witness unset if the upper bound is infinite or not proved
  /// \param contact unset if not requested
  /// \param proved whether the row's content or its status proves it
  void end_row(const std::optional<WitnessProof>& witness, const std::optional<FirstContactProof>& contact,
               bool proved);
  /// Writes the remainder. Returns true once all is written, and false if the slice ended first.
  bool end(WorkMeter& meter);
  std::vector<std::byte> take() { return std::move(text_); }

 private:
  enum class Part { kRows, kBodies, kPieces, kConfigurations, kOver };

  void add(const std::string& text);
  void add_item(const std::string& text, bool& is_first);
  void add_body(std::uint32_t id);
  bool lists_elements(const Surface& surface, WorkMeter& meter);
  void add_convex_part(WorkMeter& meter);
  void add_configuration(std::uint64_t k);
  void name(std::uint32_t id, const BodyPoses& here);
  const RobotJoint* joint_of(std::uint32_t id) const;
  std::uint32_t carrier_of(std::uint32_t id) const;

  const engine::Scene& scene_;
  const Plan& plan_;
  std::uint64_t most_;
  std::vector<std::byte> text_;
  Part part_ = Part::kRows;
  const BodyPoses* here_ = nullptr;  // of the current pair
  bool first_row_ = true, first_pair_ = true, first_span_ = true, first_lower_ = true;
  bool is_free_ = false;                   // the current pair has passed begin_free()
  std::map<std::uint32_t, double> known_;  // named bodies and the ages of their poses, in seconds
  std::set<std::uint32_t> in_pairs_;       // bodies whose parts are written
  std::vector<std::uint32_t> bodies_;      // in the order in which rows name them
  std::map<const ConvexPart*, std::size_t> places_;
  std::vector<const ConvexPart*> parts_;
  std::set<std::uint64_t> configurations_;
  std::size_t next_body_ = 0, next_part_ = 0, next_vertex_ = 0;
  std::optional<SurfaceLister> elements_;  // of the current part
  bool first_configuration_ = true;
};

}  // namespace clearance
