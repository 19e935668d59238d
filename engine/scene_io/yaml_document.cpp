#include "engine/scene_io/yaml_document.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "engine/pose/pose_order.h"
#include "engine/scene_io/yaml_tree.h"
#include "wire/api/unknown_name.h"

namespace clearance {

namespace {

// Limit on values read from one file, aliases counted at each use: "points: *p" in a thousand bodies reads p a thousand
// times.
constexpr std::uint64_t kMaxReads = 20'000'000;

std::string cut(const std::string& text) {
  std::string out;
  for (const char c : text.substr(0, 60)) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return text.size() > 60 ? out + "..." : out;
}

// Parses all of the text as a decimal number; no hexadecimal, inf or nan.
bool parse_number(const std::string& text, double* out) {
  const char* begin = text.data();
  const char* end = begin + text.size();
  if (begin != end && *begin == '+') ++begin;
  const char* digits = begin;
  if (digits != end && begin == text.data() && *digits == '-') ++digits;
  if (digits == end || !(*digits == '.' || (*digits >= '0' && *digits <= '9'))) return false;
  const auto [rest, error] = std::from_chars(begin, end, *out);
  return error == std::errc() && rest == end;
}

}  // namespace

YamlValue YamlValue::load(const std::string& path) {
  return YamlValue(read_yaml_tree(path), 0, 1, "");
}

bool YamlValue::is_map() const {
  return tree_->nodes[node_].kind == YamlKind::kMap;
}
bool YamlValue::is_list() const {
  return tree_->nodes[node_].kind == YamlKind::kList;
}
bool YamlValue::is_text() const {
  return tree_->nodes[node_].kind == YamlKind::kScalar;
}

void YamlValue::fail(const std::string& message) const {
  fail_at(tree_->file, static_cast<int>(line_), place_.empty() ? message : place_ + ": " + message);
}

void YamlValue::fail_expected(const std::string& expected) const {
  fail("expected " + expected + ", got " + described());
}

std::string YamlValue::described() const {
  const YamlNode& node = tree_->nodes[node_];
  switch (node.kind) {
    case YamlKind::kNull:
      return "nothing";
    case YamlKind::kList:
      return "a list of " + std::to_string(node.children.size());
    case YamlKind::kMap:
      return "a map";
    case YamlKind::kScalar:
      break;
  }
  double x;
  return !node.quoted && parse_number(node.scalar, &x) ? node.scalar : '"' + cut(node.scalar) + '"';
}

std::string YamlValue::text(const std::string& expected) const {
  if (!is_text()) fail_expected(expected);
  return tree_->nodes[node_].scalar;
}

bool YamlValue::boolean() const {
  const YamlNode& node = tree_->nodes[node_];
  if (node.kind == YamlKind::kScalar && !node.quoted) {
    if (node.scalar == "true" || node.scalar == "True" || node.scalar == "TRUE") return true;
    if (node.scalar == "false" || node.scalar == "False" || node.scalar == "FALSE") return false;
  }
  fail_expected("true or false");
}

double YamlValue::number(const std::string& expected) const {
  const YamlNode& node = tree_->nodes[node_];
  double x = 0;
  if (node.kind != YamlKind::kScalar || node.quoted || !parse_number(node.scalar, &x) || !std::isfinite(x))
    fail_expected(expected);
  return x;
}

double YamlValue::positive() const {
  const double x = number("a number > 0");
  if (!(x > 0)) fail_expected("a number > 0");
  return x;
}

double YamlValue::not_negative() const {
  const double x = number("a number >= 0");
  if (!(x >= 0)) fail_expected("a number >= 0");
  return x;
}

std::int64_t YamlValue::integer(std::int64_t low, std::int64_t high) const {
  const std::string expected = "an integer from " + std::to_string(low) + " to " + std::to_string(high);
  const double x = number(expected);
  if (x != std::floor(x) || x < static_cast<double>(low) || x > static_cast<double>(high)) fail_expected(expected);
  return static_cast<std::int64_t>(x);
}

std::uint64_t YamlValue::unsigned_integer() const {
  const std::string expected = "an integer from 0 to 18446744073709551615";
  const std::string digits = is_text() && !tree_->nodes[node_].quoted ? tree_->nodes[node_].scalar : "";
  std::uint64_t x = 0;
  const auto [rest, error] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (error != std::errc() || rest != digits.data() + digits.size()) fail_expected(expected);
  return x;
}

std::vector<double> YamlValue::numbers(std::size_t count, const std::string& expected) const {
  if (!is_list() || size() != count) fail_expected(expected);
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(entry(i).number());
  return out;
}

std::vector<Vec3d> YamlValue::vectors() const {
  if (!is_list() || size() == 0) fail_expected("a list of points [x, y, z]");
  std::vector<Vec3d> out;
  out.reserve(size());
  count_reads(4 * size());
  const std::vector<YamlNode>& nodes = tree_->nodes;
  for (std::size_t i = 0; i < nodes[node_].children.size(); ++i) {
    const YamlNode& point = nodes[nodes[node_].children[i].node];
    Vec3d v{0, 0, 0};
    bool good = point.kind == YamlKind::kList && point.children.size() == 3;
    for (int k = 0; good && k < 3; ++k) {
      const YamlNode& x = nodes[point.children[k].node];
      good = x.kind == YamlKind::kScalar && !x.quoted && parse_number(x.scalar, &v[k]) && std::isfinite(v[k]);
    }
    if (!good) {  // again, for the message
      const std::vector<double> x = entry(i).numbers(3, "a point [x, y, z]");
      v = {x[0], x[1], x[2]};
    }
    out.push_back(v);
  }
  return out;
}

Pose YamlValue::pose() const {
  const std::vector<double> x = numbers(7, "7 numbers [x, y, z, qw, qx, qy, qz]");
  const Pose pose{{x[0], x[1], x[2]}, x[3], x[4], x[5], x[6]};
  if (check(pose) == PoseQuality::kBad)
    fail("expected a quaternion (qw, qx, qy, qz) of norm 1e-6 to 1e6 and coordinates up to 1e60 m");
  if (const std::string uncertainty = order_warning(pose); !uncertainty.empty())
    tree_->warnings.push_back(tree_->file + ":" + std::to_string(line_) + ": " + place_ + ": " + uncertainty);
  return pose;
}

const std::vector<std::string>& YamlValue::warnings() const {
  return tree_->warnings;
}

std::size_t YamlValue::size() const {
  const YamlNode& node = tree_->nodes[node_];
  return node.kind == YamlKind::kMap ? node.children.size() / 2 : node.children.size();
}

void YamlValue::count_reads(std::size_t values) const {
  tree_->reads += values;
  if (tree_->reads > kMaxReads) fail("too many values, aliases counted each time they are used");
}

YamlValue YamlValue::entry(std::size_t i) const {
  const YamlChild& child = tree_->nodes[node_].children[i];
  return YamlValue(tree_, child.node, child.line, place_ + "[" + std::to_string(i) + "]");
}

std::vector<YamlValue> YamlValue::list(const std::string& expected) const {
  if (!is_list()) fail_expected(expected);
  count_reads(size());
  std::vector<YamlValue> out;
  out.reserve(size());
  for (std::size_t i = 0; i < size(); ++i) out.push_back(entry(i));
  return out;
}

std::vector<std::pair<std::string, YamlValue>> YamlValue::map(const std::string& expected) const {
  if (!is_map()) fail_expected(expected);
  count_reads(size());
  const YamlNode& node = tree_->nodes[node_];
  std::vector<std::pair<std::string, YamlValue>> out;
  std::set<std::string> seen;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const YamlNode& key = tree_->nodes[node.children[i].node];
    const YamlValue at_key(tree_, node.children[i].node, node.children[i].line, place_);
    if (key.kind != YamlKind::kScalar) at_key.fail_expected("a text as key");
    if (!seen.insert(key.scalar).second) at_key.fail("the key \"" + cut(key.scalar) + "\" occurs twice");
    const std::string place = place_.empty() ? cut(key.scalar) : place_ + "." + cut(key.scalar);
    out.emplace_back(key.scalar, YamlValue(tree_, node.children[i + 1].node, node.children[i].line, place));
  }
  return out;
}

std::unique_ptr<YamlValue> YamlValue::find(const std::string& key) const {
  const YamlNode& node = tree_->nodes[node_];
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const YamlNode& k = tree_->nodes[node.children[i].node];
    if (k.kind != YamlKind::kScalar || k.scalar != key) continue;
    const std::string place = place_.empty() ? key : place_ + "." + key;
    return std::unique_ptr<YamlValue>(new YamlValue(tree_, node.children[i + 1].node, node.children[i].line, place));
  }
  return nullptr;
}

void YamlValue::check_keys(std::initializer_list<const char*> known) const {
  for (const auto& [key, value] : map("a map")) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const std::string near = did_you_mean(key, {known.begin(), known.end()});
    std::string all;
    for (const char* k : known) all += std::string(all.empty() ? "; known: " : ", ") + k;
    const YamlValue at_key(tree_, value.node_, value.line_, place_);
    at_key.fail("unknown key \"" + cut(key) + "\"" + (near.empty() ? all : near));
  }
}

}  // namespace clearance
