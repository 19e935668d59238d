#include "engine/query/query_key.h"

#include <cstring>

#include "wire/query_options.h"

namespace clearance {

namespace {

template <class T>
bool same_bits(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

template <class T>
std::span<const T> kept(std::span<const T> given, std::vector<T>& copy) {
  copy.assign(given.begin(), given.end());
  return copy;
}

}  // namespace

QueryKey::QueryKey(const QueryView& query) : query_(query), has_growths_(!query.growths.empty()) {
  query_.configurations = {};
  query_.positions = {};
  query_.growths = {};
  query_.velocities = query_.twists = {};
  query_.pairs = kept(query.pairs, pairs_);
  query_.bodies = kept(query.bodies, bodies_);
  query_.joints = kept(query.joints, joints_);
  query_.margins = kept(query.margins, margins_);
  query_.pair_margins = kept(query.pair_margins, pair_margins_);
  query_.weights = kept(query.weights, weights_);
  query_.speed_errors = kept(query.speed_errors, speed_errors_);
}

bool QueryKey::is_of(const QueryView& query) const {
  // Options are rows of a table; other inputs are listed here.
  bool same = query.all_pairs == query_.all_pairs && query.configuration_count == query_.configuration_count &&
              query.scene_revision == query_.scene_revision && query.growths.empty() != has_growths_;
  for_each_query_option([&](const QueryOption&, auto member) {
    if constexpr (requires { member(query); }) {
      const auto a = member(query), b = member(query_);
      same = same && std::memcmp(&a, &b, sizeof a) == 0;
    }
  });
  return same && same_bits(query.pairs, query_.pairs) && same_bits(query.bodies, query_.bodies) &&
         same_bits(query.joints, query_.joints) && same_bits(query.margins, query_.margins) &&
         same_bits(query.pair_margins, query_.pair_margins) && same_bits(query.weights, query_.weights) &&
         same_bits(query.speed_errors, query_.speed_errors);
}

}  // namespace clearance
