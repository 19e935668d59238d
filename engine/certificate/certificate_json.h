// JSON values of a certificate's document (docs/trust/certificates.md).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "engine/certificate/certificate_text.h"

namespace clearance::certificate_json {

using Json = nlohmann::ordered_json;

/// JSON has no infinity; the library writes all other numbers so that they read back unchanged.
Json number(double x);
/// A pair of float64 whose sum is the number.
Json number(const DoubleDouble& x);
template <class T>
Json vector(const Vec3<T>& v) {
  return Json::array({number(v.x), number(v.y), number(v.z)});
}
Json pose(const Pose& X);
/// 64-bit integers are written as strings, because many JSON readers hold numbers as float64.
std::string hex(std::uint64_t x);
/// Null for kNone.
Json id_json(std::uint32_t body);
Json lower_json(const PartProof& proof);
Json witness_json(const std::optional<WitnessProof>& witness);
Json contact_json(const FirstContactProof& contact);
Json slack_json(const SpanPlace& span, const Body& a, const Body& b);

std::string text_of(const Json& json);
/// An object without its closing brace, to be continued.
std::string open_text(const Json& json);

}  // namespace clearance::certificate_json
