// JSON of a glTF 2.0 file: typed members with errors that name their place, and extensions that change the geometry.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace clearance::gltf {

using Json = nlohmann::json;

/// Throws LoadError.
[[noreturn]] void fail(const std::string& what);

/// An entry of a list, as errors name it: "nodes[3]".
std::string place(const char* list, std::uint64_t i);

/// The value of a key, or null without it.
const Json* find(const Json& object, const char* key);

/// A count, index or size in bytes. Sums and products of two of them do not overflow.
/// \param otherwise without the key; if empty, the key is required
std::uint64_t unsigned_in(const Json& object, const char* key, const std::string& where,
                          std::optional<std::uint64_t> otherwise = {});

/// N finite numbers of a key, or nothing without the key.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_in(const Json& object, const char* key, const std::string& where) {
  const Json* value = find(object, key);
  if (!value) return {};
  std::array<double, N> out;
  bool good = value->is_array() && value->size() == N;
  for (std::size_t i = 0; good && i < N; ++i) {
    good = (*value)[i].is_number();
    if (good) out[i] = (*value)[i].get<double>();
    good = good && std::isfinite(out[i]);
  }
  if (!good) fail(where + '.' + key + ": expected " + std::to_string(N) + " finite numbers");
  return out;
}

/// Rejects extensions that change the geometry of an object, required or not.
/// \param changing lists those that do; if empty, all but those known to keep the geometry
void check_extensions(const Json& object, const std::string& where,
                      std::initializer_list<std::string_view> changing = {});

/// A file's JSON, of version 2, without required extensions that are not read.
class Document {
 public:
  explicit Document(std::string_view json);

  const Json& root() const { return root_; }
  /// An entry of a list that belongs to the geometry: its extensions are checked.
  const Json& entry(const char* list, std::uint64_t i) const;

 private:
  void check_required() const;

  Json root_;
};

}  // namespace clearance::gltf
