#include "server/tasks/query_input.h"

#include <cstring>
#include <string>

#include "server/base/rejected_request.h"

namespace clearance {
namespace {

/// The engine's view of a list on the wire, whose elements have the same layout.
template <class Element, class List>
std::span<const Element> view_as(const List& list) {
  return {reinterpret_cast<const Element*>(list.data()), static_cast<std::size_t>(list.size())};
}

[[noreturn]] void reject_too_large(const std::string& text, std::uint64_t most, const std::string& option) {
  throw RejectedRequest{wire::ErrorCode::kTooLarge, text + " more than the " + std::to_string(most) +
                                                        " that one query may have (limit " + option + "): split it"};
}

}  // namespace

QueryView view_of(const wire::QueryParts& parts, std::uint64_t scene_revision) {
  const wire::QueryHeader& h = parts.header;
  static_assert(sizeof(BodyPair) == sizeof(wire::PairRecord) && sizeof(Pose) == sizeof(wire::ConfigurationRecord));
  QueryView q;
  q.pairs = view_as<BodyPair>(parts.pairs);
  q.bodies = view_as<std::uint32_t>(parts.bodies);
  q.configurations = view_as<Pose>(parts.configurations);
  q.joints = view_as<std::uint32_t>(parts.joints);
  q.positions = view_as<double>(parts.positions);
  q.growths = view_as<double>(parts.growths);
  q.velocities = view_as<double>(parts.velocities);
  q.twists = view_as<double>(parts.twists);
  q.all_pairs = h.all_pairs;
  q.configuration_count = h.configuration_count;
  copy_options(parts.options, q);
  q.margins = view_as<MarginEntry>(parts.margins);
  q.pair_margins = view_as<double>(parts.pair_margins);
  q.weights = view_as<double>(parts.weights);
  q.speed_errors = view_as<double>(parts.speed_errors);
  q.scene_revision = scene_revision;
  return q;
}

std::span<const std::byte> aligned(std::span<const std::byte> payload, std::vector<std::uint64_t>& copy) {
  if (payload.empty() || reinterpret_cast<std::uintptr_t>(payload.data()) % alignof(std::uint64_t) == 0) return payload;
  copy.resize((payload.size() + 7) / 8);
  std::memcpy(copy.data(), payload.data(), payload.size());
  return std::as_bytes(std::span(copy)).first(payload.size());
}

void QueryLimits::check(const QueryCost& cost) const {
  if (cost.part_pairs > max_part_pairs)
    reject_too_large(
        "the pairs that this query names have " + std::to_string(cost.part_pairs) + " pairs of convex parts,",
        max_part_pairs, "max-piece-pairs");
}

void QueryLimits::check(const QuerySize& size) const {
  if (size.pairs && size.configurations > max_pairs / size.pairs)
    reject_too_large(
        std::to_string(size.configurations) + " configurations of " + std::to_string(size.pairs) + " pairs are",
        max_pairs, "max-pairs");
}

}  // namespace clearance
