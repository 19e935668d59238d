// Typed access to a YAML file. Errors name the place of the value.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/vec.h"
#include "engine/pose/pose.h"

namespace clearance {

struct YamlTree;

/// A value of the file, with its place. All failures throw SceneError "file:line: bodies[3].radius: ...".
class YamlValue {
 public:
  /// Reads a file of one document. Limits its bytes, values and depth; an alias is not expanded.
  static YamlValue load(const std::string& path);

  bool is_map() const;
  bool is_list() const;
  bool is_text() const;  ///< a scalar, also one that reads as a number

  /// Throws SceneError at this place.
  [[noreturn]] void fail(const std::string& message) const;
  /// Throws "expected <expected>, got <value>".
  [[noreturn]] void fail_expected(const std::string& expected) const;

  /// Any scalar, unchanged.
  std::string text(const std::string& expected) const;
  bool boolean() const;
  double number(const std::string& expected = "a number") const;    ///< finite
  double positive() const;                                          ///< > 0
  double not_negative() const;                                      ///< >= 0
  std::int64_t integer(std::int64_t low, std::int64_t high) const;  ///< "1e3" is an integer as well
  std::uint64_t unsigned_integer() const;
  /// A list of exactly `count` numbers.
  /// \param expected such as "7 numbers [x, y, z, qw, qx, qy, qz]"
  std::vector<double> numbers(std::size_t count, const std::string& expected) const;
  std::vector<Vec3d> vectors() const;  ///< a list of [x, y, z]
  /// A usable pose [x, y, z, qw, qx, qy, qz]. Warns of a quaternion that is probably in the order x, y, z, w.
  Pose pose() const;
  /// Warnings of pose() about this file, with places.
  const std::vector<std::string>& warnings() const;

  std::size_t size() const;  ///< entries of a list or map
  std::vector<YamlValue> list(const std::string& expected) const;
  /// Keys and values in the file's order; keys are distinct scalars.
  std::vector<std::pair<std::string, YamlValue>> map(const std::string& expected) const;

  /// The value of a key, or null; of a map only.
  std::unique_ptr<YamlValue> find(const std::string& key) const;
  /// Fails for an unknown key, and suggests the nearest known ones.
  void check_keys(std::initializer_list<const char*> known) const;

 private:
  YamlValue(std::shared_ptr<const YamlTree> tree, std::uint32_t node, std::uint32_t line, std::string place)
      : tree_(std::move(tree)), node_(node), line_(line), place_(std::move(place)) {}
  YamlValue entry(std::size_t i) const;
  void count_reads(std::size_t values) const;
  std::string described() const;

  std::shared_ptr<const YamlTree> tree_;
  std::uint32_t node_;
  std::uint32_t line_;
  std::string place_;  ///< "bodies[3].radius"
};

}  // namespace clearance
