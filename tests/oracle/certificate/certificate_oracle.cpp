#include "tests/oracle/certificate/certificate_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/oracle/certificate/bounds.h"

namespace clearance::certificate_oracle {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Query {
  bool is_signed, is_reduced, decides;
  double max_distance;
};

// Default for a row without a contact: free until it begins, and never hit.
struct Contact {
  double free_until = 0, hit_at = kInf;
};

struct Row {
  std::string_view status;
  double lower, upper;
  std::span<const Value> pairs;
  Contact contact;

  bool is(std::string_view name) const { return status == name; }
};

Query read_query(const Value& document) {
  const std::string_view reduce = document["reduce"].text();
  require(reduce == "none" || reduce == "min" || reduce == "any", "a reduction is not known");
  return {document["signed_distance"].boolean(), document["motions"].boolean() && reduce != "none", reduce == "any",
          document["max_distance"].real()};
}

Contact read_contact(const Value& contact) {
  if (contact.is_null()) return {};
  const Contact found{contact["free_until"].real(), contact["hit_at"].real()};
  require(found.free_until >= 0 && (found.free_until <= 1 || found.free_until == kInf), "free until no time of it");
  require(found.hit_at >= 0, "hit before it begins");
  require(contact["witness"].is_null() == (found.hit_at == kInf), "a hit and its witness do not belong together");
  return found;
}

// The cut-off that a row has to exceed: the least margin, if bodies have margins.
double cut_off(const Row& row, const Query& query) {
  double least = kInf;
  for (const Value& pair : row.pairs) least = std::min(least, pair["margin"].real());
  return query.decides ? least : query.max_distance;
}

void check_status(const Row& row, const Query& query) {
  const double cut = cut_off(row, query);
  require(row.lower <= row.upper, "bounds are crossed");
  require(query.is_signed || row.upper >= 0, "upper is negative");
  if (row.is("ok"))
    require(row.lower > 0 && (query.decides ? row.upper < kInf : row.lower <= cut), "these bounds are not ok's");
  else if (row.is("overlap"))
    require(row.upper <= 0, "these bounds are not an overlap's");
  else if (row.is("contact"))
    require(row.lower <= 0 && row.upper >= 0 && row.upper < kInf, "these bounds are not a contact's");
  else if (row.is("beyond"))
    require(row.lower > cut, "these bounds are not beyond");
  else
    require(row.is("unconverged"), "a status is not known");
}

// Checks that the spans of `claim` prove its bound for two bodies, without a gap from 0 to `end`.
void check_spans(const IdPair& ids, const Value& claim, double end, const Motion& motion) {
  const Dyadic lower = claim["lower"].finite();
  std::vector<ProvedTime> spans;
  for (const Value& span : claim["spans"].list()) spans.push_back(check_span(motion, ids, span, lower));
  std::sort(spans.begin(), spans.end());
  double until = 0;
  for (const ProvedTime& span : spans) {
    require(span.begin == until, "spans leave a gap");
    until = span.end;
  }
  require(!spans.empty() && until == end, "spans leave a gap");
}

bool has_lower(const Row& row, const Query& query) {
  return row.lower > (query.is_signed ? -kInf : 0);
}

// Checks that each pair is no nearer throughout than the row's bound.
void check_lower(const Row& row, const Query& query, const Motion& motion) {
  for (const Value& pair : row.pairs) {
    const double lower = pair["lower"].finite();
    require(row.lower <= lower, "a pair may be nearer than its row says");
    if (query.decides && row.is("beyond")) require(lower > pair["margin"].real(), "a pair may be within its margin");
    check_spans(pair_of(pair["bodies"]), pair, 1, motion);
  }
}

// The pair of a witness.
const Value& named_pair(const Row& row, const IdPair& ids) {
  const auto is_it = [&](const Value& pair) { return pair_of(pair["bodies"]) == ids; };
  require(std::count_if(row.pairs.begin(), row.pairs.end(), is_it) == 1, "the witness is of none of the pairs");
  return *std::find_if(row.pairs.begin(), row.pairs.end(), is_it);
}

void check_upper(const Row& row, const Value& document, const Query& query, const Motion& motion) {
  const IdPair ids = pair_of(document["bodies"]);
  const Value& pair = named_pair(row, ids);
  if (query.decides && !row.is("unconverged"))
    require(row.upper <= pair["margin"].real(), "the witness is beyond its margin");
  check_witness(motion, ids, document["witness"], row.upper);
}

// Before first contact every pair is beyond its margin. A proof for the whole motion covers that time, too.
void check_free(const Row& row, const Query& query, const Motion& motion) {
  const double end = row.contact.free_until == kInf ? 1 : row.contact.free_until;
  for (const Value& pair : row.pairs) {
    const double margin = pair["margin"].real();
    const Value& claim = pair["free"];
    const bool is_free_anyway = end == 0 || (has_lower(row, query) && pair["lower"].finite() > margin);
    if (claim.is_null() && is_free_anyway) continue;
    require(claim["lower"].finite() > margin, "a pair may be within its margin before first contact");
    check_spans(pair_of(pair["bodies"]), claim, end, motion);
  }
}

// Checks that a pair is within its margin at the hit.
void check_hit(const Row& row, const Value& claim, const Motion& motion) {
  const IdPair ids = pair_of(claim["bodies"]);
  require(claim["witness"]["time"].finite() == row.contact.hit_at, "the witness of first contact is at another time");
  check_witness(motion, ids, claim["witness"], named_pair(row, ids)["margin"].finite());
}

void check_row(const Value& document, const Query& query, const std::map<Id, Motion>& motions) {
  const Row row{document["status"].text(), document["lower"].real(), document["upper"].real(), document["pairs"].list(),
                read_contact(document["first_contact"])};
  require(document["proved"].boolean(), "the engine found no proof");
  if (row.is("bad_pose") || row.is("no_pose") || row.is("stale_pose") || row.is("unknown_body")) {
    require(row.lower == -kInf && row.upper == kInf && row.pairs.empty(), "this status says nothing of a distance");
    require(row.contact.free_until == 0 && row.contact.hit_at == kInf, "this status says nothing of contact");
    return;
  }
  require(!row.pairs.empty(), "a row has no pairs");
  if (!query.is_reduced)
    require(row.pairs.size() == 1 && pair_of(row.pairs[0]["bodies"]) == pair_of(document["bodies"]),
            "a row has the pair of another");
  const auto motion = motions.find(document["configuration"].integer());
  require(motion != motions.end(), "there is no such configuration");
  check_status(row, query);
  if (has_lower(row, query)) check_lower(row, query, motion->second);
  if (row.upper < kInf) check_upper(row, document, query, motion->second);
  check_free(row, query, motion->second);
  if (row.contact.hit_at < kInf) check_hit(row, document["first_contact"], motion->second);
}

std::vector<std::string> check_rows(const Value& document) {
  require(document["format"].text() == "clearance certificate" && document["version"].integer() == 3,
          "another format or version");
  std::vector<ConvexPart> parts;
  for (const Value& part : document["pieces"].list()) parts.emplace_back(part);
  Bodies bodies;
  for (const Value& body : document["bodies"].list())
    require(bodies.try_emplace(body["id"].integer(), body, parts).second, "two bodies have one id");
  const Query query = read_query(document["query"]);
  const bool moves = document["query"]["motions"].boolean();
  std::map<Id, Motion> motions;
  for (const Value& place : document["configurations"].list())
    require(motions.try_emplace(place["configuration"].integer(), bodies, place, moves).second,
            "two configurations have one number");
  std::vector<std::string> why;
  for (const Value& row : document["rows"].list()) {
    why.emplace_back();
    try {
      check_row(row, query, motions);
    } catch (const Rejection& rejection) {
      why.back() = rejection.what();
    }
  }
  return why;
}

}  // namespace

std::size_t Findings::proved() const {
  return static_cast<std::size_t>(std::count(why.begin(), why.end(), std::string()));
}

Findings prove_certificate(std::string_view document) {
  Findings findings;
  try {
    findings.why = check_rows(Document(document).root());
  } catch (const Rejection& rejection) {
    findings.no_certificate = rejection.what();
  }
  return findings;
}

}  // namespace clearance::certificate_oracle
