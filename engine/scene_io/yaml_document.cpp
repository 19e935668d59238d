#include "engine/scene_io/yaml_document.h"

#include <sys/stat.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <set>
#include <sstream>
#include <unordered_map>

#include "engine/pose/pose_order.h"
#include "engine/scene/scene.h"

namespace clearance {

namespace {

// What a scene file may hold. A million points as text fit; a file made to exhaust memory does not.
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMaxValues = 2'500'000;
constexpr std::size_t kMaxDepth = 32;
// Values read through aliases as well, over the whole file: "points: *p" in each of a thousand bodies reads p a
// thousand times.
constexpr std::uint64_t kMaxReads = 20'000'000;

enum class Kind : std::uint8_t { kNull, kScalar, kList, kMap };

struct Child {
  std::uint32_t node;
  std::uint32_t line;
};

struct Node {
  Kind kind = Kind::kNull;
  bool quoted = false;
  std::string scalar;
  std::vector<Child> children;  // of a map: key, value, key, value, ...
};

std::string cut(const std::string& text) {
  std::string out;
  for (const char c : text.substr(0, 60)) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return text.size() > 60 ? out + "..." : out;
}

// Edits (insert, delete, replace, swap neighbours) from a to b.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

// A decimal number, all of the text; no hexadecimal, no inf, no nan.
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

struct YamlTree {
  std::string file;
  std::vector<Node> nodes;
  mutable std::uint64_t reads = 0;
  mutable std::vector<std::string> warnings;
};

namespace {

[[noreturn]] void fail_at(const std::string& file, int line, const std::string& message) {
  throw SceneError(file + ":" + std::to_string(line) + ": " + message);
}

class TreeBuilder final : public YAML::EventHandler {
 public:
  explicit TreeBuilder(YamlTree* tree) : tree_(tree) {}

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (documents_++) fail_at(tree_->file, mark.line + 1, "a second YAML document begins; expected one");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(mark, anchor); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) fail_at(tree_->file, mark.line + 1, "an alias of nothing");
    if (std::find(open_.begin(), open_.end(), found->second) != open_.end())
      fail_at(tree_->file, mark.line + 1, "an alias inside of what it stands for");
    link(mark, found->second);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    Node& node = add(mark, anchor);
    node.kind = Kind::kScalar;
    node.quoted = tag == "!";
    node.scalar = value;
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, anchor, Kind::kList);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, anchor, Kind::kMap);
  }
  void OnMapEnd() override { open_.pop_back(); }

 private:
  void link(const YAML::Mark& mark, std::uint32_t node) {
    if (!open_.empty())
      tree_->nodes[open_.back()].children.push_back({node, static_cast<std::uint32_t>(mark.line + 1)});
  }
  Node& add(const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (tree_->nodes.size() >= kMaxValues)
      fail_at(tree_->file, mark.line + 1, "more than " + std::to_string(kMaxValues) + " values in one scene file");
    const auto id = static_cast<std::uint32_t>(tree_->nodes.size());
    if (anchor) anchors_[anchor] = id;
    link(mark, id);
    tree_->nodes.emplace_back();
    return tree_->nodes.back();
  }
  void open(const YAML::Mark& mark, YAML::anchor_t anchor, Kind kind) {
    if (open_.size() >= kMaxDepth)
      fail_at(tree_->file, mark.line + 1, "nested deeper than " + std::to_string(kMaxDepth) + " levels");
    add(mark, anchor).kind = kind;
    open_.push_back(static_cast<std::uint32_t>(tree_->nodes.size() - 1));
  }

  YamlTree* tree_;
  std::vector<std::uint32_t> open_;  // lists and maps that have begun and not ended
  std::unordered_map<YAML::anchor_t, std::uint32_t> anchors_;
  int documents_ = 0;
};

std::string read_file(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) throw SceneError(path + ": " + std::generic_category().message(errno));
  if (S_ISDIR(info.st_mode)) throw SceneError(path + ": expected a scene file, got a folder");
  if (!S_ISREG(info.st_mode)) throw SceneError(path + ": expected a scene file, got a device, pipe or socket");
  if (static_cast<std::uint64_t>(info.st_size) > kMaxFileBytes)
    throw SceneError(path + ": " + std::to_string(info.st_size) + " bytes; a scene file may have at most " +
                     std::to_string(kMaxFileBytes));
  std::ifstream in(path, std::ios::binary);
  if (!in) throw SceneError(path + ": cannot be opened: " + std::generic_category().message(errno));
  std::string content(static_cast<std::size_t>(info.st_size), '\0');
  in.read(content.data(), info.st_size);
  content.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return content;
}

}  // namespace

YamlValue YamlValue::load(const std::string& path) {
  auto tree = std::make_shared<YamlTree>();
  tree->file = path;
  const std::string content = read_file(path);
  if (const std::size_t at = content.find('\0'); at != std::string::npos)
    fail_at(path,
            1 + static_cast<int>(std::count(content.begin(), content.begin() + static_cast<std::ptrdiff_t>(at), '\n')),
            "not a text file: it holds a zero byte");
  try {
    std::istringstream stream(content);
    YAML::Parser parser(stream);
    TreeBuilder builder(tree.get());
    while (parser.HandleNextDocument(builder)) {
    }
  } catch (const YAML::ParserException& e) {
    fail_at(path, e.mark.line + 1, "not valid YAML: " + e.msg);
  } catch (const YAML::Exception& e) {
    throw SceneError(path + ": not valid YAML: " + e.what());
  }
  if (tree->nodes.empty()) throw SceneError(path + ": the file is empty; expected a map with the key \"bodies\"");
  return YamlValue(tree, 0, 1, "");
}

bool YamlValue::is_map() const {
  return tree_->nodes[node_].kind == Kind::kMap;
}
bool YamlValue::is_list() const {
  return tree_->nodes[node_].kind == Kind::kList;
}
bool YamlValue::is_text() const {
  return tree_->nodes[node_].kind == Kind::kScalar;
}

void YamlValue::fail(const std::string& message) const {
  fail_at(tree_->file, static_cast<int>(line_), place_.empty() ? message : place_ + ": " + message);
}

void YamlValue::fail_expected(const std::string& expected) const {
  fail("expected " + expected + ", got " + described());
}

std::string YamlValue::described() const {
  const Node& node = tree_->nodes[node_];
  switch (node.kind) {
    case Kind::kNull:
      return "nothing";
    case Kind::kList:
      return "a list of " + std::to_string(node.children.size());
    case Kind::kMap:
      return "a map";
    case Kind::kScalar:
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
  const Node& node = tree_->nodes[node_];
  if (node.kind == Kind::kScalar && !node.quoted) {
    if (node.scalar == "true" || node.scalar == "True" || node.scalar == "TRUE") return true;
    if (node.scalar == "false" || node.scalar == "False" || node.scalar == "FALSE") return false;
  }
  fail_expected("true or false");
}

double YamlValue::number(const std::string& expected) const {
  const Node& node = tree_->nodes[node_];
  double x = 0;
  if (node.kind != Kind::kScalar || node.quoted || !parse_number(node.scalar, &x) || !std::isfinite(x))
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
  tree_->reads += 4 * size();
  if (tree_->reads > kMaxReads) fail("too many values, aliases counted each time they are used");
  const std::vector<Node>& nodes = tree_->nodes;
  for (std::size_t i = 0; i < nodes[node_].children.size(); ++i) {
    const Node& point = nodes[nodes[node_].children[i].node];
    Vec3d v{0, 0, 0};
    bool good = point.kind == Kind::kList && point.children.size() == 3;
    for (int k = 0; good && k < 3; ++k) {
      const Node& x = nodes[point.children[k].node];
      good = x.kind == Kind::kScalar && !x.quoted && parse_number(x.scalar, &v[k]) && std::isfinite(v[k]);
    }
    if (!good) {  // once more, slowly, for the message
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
  const Node& node = tree_->nodes[node_];
  return node.kind == Kind::kMap ? node.children.size() / 2 : node.children.size();
}

YamlValue YamlValue::entry(std::size_t i) const {
  const Child& child = tree_->nodes[node_].children[i];
  return YamlValue(tree_, child.node, child.line, place_ + "[" + std::to_string(i) + "]");
}

std::vector<YamlValue> YamlValue::list(const std::string& expected) const {
  if (!is_list()) fail_expected(expected);
  tree_->reads += size();
  if (tree_->reads > kMaxReads) fail("too many values, aliases counted each time they are used");
  std::vector<YamlValue> out;
  out.reserve(size());
  for (std::size_t i = 0; i < size(); ++i) out.push_back(entry(i));
  return out;
}

std::vector<std::pair<std::string, YamlValue>> YamlValue::map(const std::string& expected) const {
  if (!is_map()) fail_expected(expected);
  tree_->reads += size();
  if (tree_->reads > kMaxReads) fail("too many values, aliases counted each time they are used");
  const Node& node = tree_->nodes[node_];
  std::vector<std::pair<std::string, YamlValue>> out;
  std::set<std::string> seen;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const Node& key = tree_->nodes[node.children[i].node];
    const YamlValue at_key(tree_, node.children[i].node, node.children[i].line, place_);
    if (key.kind != Kind::kScalar) at_key.fail_expected("a text as key");
    if (!seen.insert(key.scalar).second) at_key.fail("the key \"" + cut(key.scalar) + "\" is there twice");
    const std::string place = place_.empty() ? cut(key.scalar) : place_ + "." + cut(key.scalar);
    out.emplace_back(key.scalar, YamlValue(tree_, node.children[i + 1].node, node.children[i].line, place));
  }
  return out;
}

std::unique_ptr<YamlValue> YamlValue::find(const std::string& key) const {
  const Node& node = tree_->nodes[node_];
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const Node& k = tree_->nodes[node.children[i].node];
    if (k.kind != Kind::kScalar || k.scalar != key) continue;
    const std::string place = place_.empty() ? key : place_ + "." + key;
    return std::unique_ptr<YamlValue>(new YamlValue(tree_, node.children[i + 1].node, node.children[i].line, place));
  }
  return nullptr;
}

void YamlValue::check_keys(std::initializer_list<const char*> known) const {
  for (const auto& [key, value] : map("a map")) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    std::string nearest, all;
    std::size_t best = std::max<std::size_t>(2, key.size() / 3) + 1;
    for (const char* k : known) {
      all += std::string(all.empty() ? "" : ", ") + k;
      const std::size_t d = key.size() > 64 ? best : edit_distance(key, k);
      if (d < best) {
        best = d;
        nearest = k;
      }
    }
    const YamlValue at_key(tree_, value.node_, value.line_, place_);
    at_key.fail("unknown key \"" + cut(key) + "\"; " +
                (nearest.empty() ? "known: " + all : "did you mean \"" + nearest + "\"?"));
  }
}

}  // namespace clearance
