// The document of a certificate (JSON), written as its rows are proved.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "engine/bvh/surface_rows.h"
#include "engine/narrow/proof.h"
#include "engine/query/job_state.h"

namespace clearance {

/// What proves a bound of two pieces, or of all of a run of pieces of each body. The elements of a surface count as
/// pieces, in their order, in its place (piece_place()).
struct PieceProof {
  std::uint32_t piece_a, piece_b;  ///< of their bodies; both kNone: the direction is for every pair of pieces
  NarrowProof proof;
  int order = 1;                           ///< of a direction: 2: bodies are looked at as they move along it
  std::uint32_t seer = kNone;              ///< before whose eyes they move; kNone: the world's
  std::uint32_t count_a = 1, count_b = 1;  ///< of a direction: how many pieces from these on
  /// Of a witness: which body (0: a, 1: b) has a solid, of which its piece is an element, that a vertex of the other's
  /// piece is within; kNone: none
  std::uint32_t within = kNone;
};

/// Which of the body's pieces a piece, or the first element of its surface, is, where elements count as pieces.
std::uint32_t piece_place(const Body& body, std::uint32_t piece);

/// A span of a motion, looked at at one time, and what is not known of a pair there. A row without motions has one.
struct SpanPlace {
  double begin = 0, end = 1, at = 0;
  Slack slack;  ///< of the pair
  SlackParts parts_a, parts_b;
  double joints = 0;                    ///< of links of one robot: joints_between()
  double between_a = 0, between_b = 0;  ///< BodyPoses::beside_chains()
};

/// Points that are no farther apart than an upper bound, or a surface that says how deep an overlap is.
struct WitnessProof {
  double time = 0;
  Pose X_wa, X_wb;  ///< as computed
  PieceProof proof;
};

/// Until when a motion is free, and when something is within its margin.
struct FirstContactProof {
  double free_until = 0, hit_at = 0;    ///< 0 to 1; inf: all along, never
  BodyPair pair{kNone, kNone};          ///< that is within its margin
  std::optional<WitnessProof> witness;  ///< none: nothing is, or it is not proved
};

/// docs/certificates.md says what it holds. Rows come first, then the bodies that they name, their pieces, and where
/// configurations put them.
class CertificateText {
 public:
  /// \param scene, plan must outlive this. \param most bytes
  CertificateText(const Scene& scene, const Plan& plan, std::uint64_t most) : scene_(scene), plan_(plan), most_(most) {}

  /// All that add to it throw QueryError where it is larger than it may be.
  void begin(const ReplyInfo& info);
  void begin_row(std::uint64_t row, std::uint64_t configuration, BodyPair pair, const PairAnswer& answer);
  /// Of bodies with usable poses. \param here any configuration, until the pair ends. \param lower what is proved of it
  void begin_pair(BodyPair pair, const BodyPoses& here, double margin, double lower);
  void begin_span(BodyPair pair, const SpanPlace& place);
  void add_lower(const PieceProof& proof);
  void end_span();
  /// The pair's spans of its row are there: others that prove it free until first contact follow. \param lower as
  /// begin_pair() has it
  void begin_free(double lower);
  void end_pair();
  /// \param witness none: the upper bound is infinite, or not proved. \param contact none: nobody asks. \param proved
  /// by what the row holds, or by its status
  void end_row(const std::optional<WitnessProof>& witness, const std::optional<FirstContactProof>& contact,
               bool proved);
  /// What is left. Returns true once all is written, false where the slice is over.
  bool end(WorkMeter& meter);
  std::vector<std::byte> take() { return std::move(text_); }

 private:
  enum class Part { kRows, kBodies, kPieces, kConfigurations, kOver };

  void add(const std::string& text);
  void add_item(const std::string& text, bool& is_first);
  void add_body(std::uint32_t id);
  bool lists_elements(const Surface& surface, WorkMeter& meter);
  void add_piece(WorkMeter& meter);
  void add_configuration(std::uint64_t k);
  void name(std::uint32_t id, const BodyPoses& here);
  const RobotJoint* joint_of(std::uint32_t id) const;
  std::uint32_t carrier_of(std::uint32_t id) const;

  const Scene& scene_;
  const Plan& plan_;
  std::uint64_t most_;
  std::vector<std::byte> text_;
  Part part_ = Part::kRows;
  const BodyPoses* here_ = nullptr;  // of the pair that is written
  bool first_row_ = true, first_pair_ = true, first_span_ = true, first_lower_ = true;
  bool is_free_ = false;                   // of the pair: begin_free()
  std::map<std::uint32_t, double> known_;  // bodies, with the ages of their poses, seconds
  std::set<std::uint32_t> in_pairs_;       // whose pieces are written
  std::vector<std::uint32_t> bodies_;      // in the order in which rows name them
  std::map<const Piece*, std::size_t> places_;
  std::vector<const Piece*> pieces_;
  std::set<std::uint64_t> configurations_;
  std::size_t next_body_ = 0, next_piece_ = 0, next_vertex_ = 0;
  std::optional<SurfaceLister> elements_;  // of the piece whose turn it is
  bool first_configuration_ = true;
};

}  // namespace clearance
