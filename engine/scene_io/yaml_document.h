// A YAML file as a tree whose every access checks what it finds and names the place of what is wrong.
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

/// One value of the file, with its place. Every failing call throws SceneError "file:line: bodies[3].radius: ...".
class YamlValue {
 public:
  /// Reads a file of one document. Bounded in bytes, values and depth; an alias costs nothing here.
  static YamlValue load(const std::string& path);

  bool is_map() const;
  bool is_list() const;
  bool is_text() const;  ///< a scalar, also one that reads as a number

  /// Ends with SceneError at this place.
  [[noreturn]] void fail(const std::string& message) const;
  /// The same: "expected <expected>, got <what is here>".
  [[noreturn]] void fail_expected(const std::string& expected) const;

  /// Any scalar, as it stands.
  std::string text(const std::string& expected) const;
  bool boolean() const;
  double number(const std::string& expected = "a number") const;    ///< finite
  double positive() const;                                          ///< > 0
  double not_negative() const;                                      ///< >= 0
  std::int64_t integer(std::int64_t low, std::int64_t high) const;  ///< "1e3" is an integer as well
  std::uint64_t unsigned_integer() const;
  /// A list of exactly `count` numbers. \param expected "7 numbers [x, y, z, qw, qx, qy, qz]".
  std::vector<double> numbers(std::size_t count, const std::string& expected) const;
  std::vector<Vec3d> vectors() const;  ///< a list of [x, y, z]
  /// [x, y, z, qw, qx, qy, qz] that can be used. Warns of a quaternion that looks like one in the order x, y, z, w.
  Pose pose() const;
  /// What pose() warned of in this file, with places.
  const std::vector<std::string>& warnings() const;

  std::size_t size() const;  ///< entries of a list or map
  std::vector<YamlValue> list(const std::string& expected) const;
  /// Keys and values in the file's order; keys are distinct scalars.
  std::vector<std::pair<std::string, YamlValue>> map(const std::string& expected) const;

  /// A value by its key; of a map only.
  std::unique_ptr<YamlValue> find(const std::string& key) const;
  /// Fails for a key that is not among the known ones, and suggests the nearest.
  void check_keys(std::initializer_list<const char*> known) const;

 private:
  YamlValue(std::shared_ptr<const YamlTree> tree, std::uint32_t node, std::uint32_t line, std::string place)
      : tree_(std::move(tree)), node_(node), line_(line), place_(std::move(place)) {}
  YamlValue entry(std::size_t i) const;
  std::string described() const;

  std::shared_ptr<const YamlTree> tree_;
  std::uint32_t node_;
  std::uint32_t line_;
  std::string place_;  ///< "bodies[3].radius"
};

}  // namespace clearance
