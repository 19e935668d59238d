// The document of a certificate (JSON), written as its rows are proved.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "engine/narrow/proof.h"
#include "engine/query/job_state.h"

namespace clearance {

/// What proves a bound of two pieces.
struct PieceProof {
  std::uint32_t piece_a, piece_b;  ///< of their bodies; both kNone: the direction is for every pair of pieces
  NarrowProof proof;
};

/// Where the bodies of a row stand, and what is not known of that. A row has one span; what moves would have several.
struct SpanPlace {
  Pose X_wa, X_wb;
  Slack slack;  ///< of the pair
  SlackParts parts_a, parts_b;
  double joints = 0;                                ///< of links of one robot: joints_between()
  bool composed_a = false, composed_b = false;      ///< the pose was composed with that of another body, and rounded
  std::vector<std::uint32_t> follows_a, follows_b;  ///< the bodies that each follows, the nearest first
};

/// docs/certificates.md says what it holds. Rows come first, then the bodies that they name, and their pieces.
class CertificateText {
 public:
  /// \param scene must outlive this. \param most bytes
  CertificateText(const Scene& scene, std::uint64_t most) : scene_(scene), most_(most) {}

  /// All that add to it throw QueryError where it is larger than it may be.
  void begin(const ReplyInfo& info, const QueryView& query);
  void begin_row(std::uint64_t row, std::uint64_t configuration, BodyPair pair, const PairAnswer& answer);
  /// Of bodies with usable poses. \param place of both
  void begin_span(BodyPair pair, const SpanPlace& place);
  void add_lower(const PieceProof& proof);
  /// \param upper none: the bound is infinite, or not proved
  void end_span(const std::optional<PieceProof>& upper);
  /// \param proved by what its span holds, or by its status
  void end_row(bool proved);
  /// Bodies and pieces. Returns true once all is written, false where the slice is over.
  bool end(WorkMeter& meter);
  std::vector<std::byte> take() { return std::move(text_); }

 private:
  enum class Part { kRows, kBodies, kPieces, kOver };

  void add(const std::string& text);
  void add_item(const std::string& text, bool& is_first);
  void add_body(std::uint32_t id);
  void add_piece(WorkMeter& meter);
  void name(std::uint32_t id);

  const Scene& scene_;
  std::uint64_t most_;
  std::vector<std::byte> text_;
  Part part_ = Part::kRows;
  bool first_row_ = true, first_lower_ = true;
  std::set<std::uint32_t> known_;
  std::vector<std::uint32_t> bodies_;  // in the order in which rows name them
  std::map<const Piece*, std::size_t> places_;
  std::vector<const Piece*> pieces_;
  std::size_t next_body_ = 0, next_piece_ = 0, next_vertex_ = 0;
};

}  // namespace clearance
