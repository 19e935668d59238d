#include "engine/scene_io/yaml_tree.h"

#include <sys/stat.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <system_error>
#include <unordered_map>

#include "engine/geometry/scene_error.h"

namespace clearance {

namespace {

// Limits of a scene file: a million points fit, a file made to exhaust memory does not.
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMaxValues = 2'500'000;
constexpr std::size_t kMaxDepth = 32;

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
    if (found == anchors_.end()) fail_at(tree_->file, mark.line + 1, "an alias without an anchor");
    if (std::find(open_.begin(), open_.end(), found->second) != open_.end())
      fail_at(tree_->file, mark.line + 1, "an alias inside its own anchor");
    link(mark, found->second);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    YamlNode& node = add(mark, anchor);
    node.kind = YamlKind::kScalar;
    node.quoted = tag == "!";
    node.scalar = value;
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, anchor, YamlKind::kList);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, anchor, YamlKind::kMap);
  }
  void OnMapEnd() override { open_.pop_back(); }

 private:
  void link(const YAML::Mark& mark, std::uint32_t node) {
    if (!open_.empty())
      tree_->nodes[open_.back()].children.push_back({node, static_cast<std::uint32_t>(mark.line + 1)});
  }
  YamlNode& add(const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (tree_->nodes.size() >= kMaxValues)
      fail_at(tree_->file, mark.line + 1, "more than " + std::to_string(kMaxValues) + " values in one scene file");
    const auto id = static_cast<std::uint32_t>(tree_->nodes.size());
    if (anchor) anchors_[anchor] = id;
    link(mark, id);
    tree_->nodes.emplace_back();
    return tree_->nodes.back();
  }
  void open(const YAML::Mark& mark, YAML::anchor_t anchor, YamlKind kind) {
    if (open_.size() >= kMaxDepth)
      fail_at(tree_->file, mark.line + 1, "nested deeper than " + std::to_string(kMaxDepth) + " levels");
    add(mark, anchor).kind = kind;
    open_.push_back(static_cast<std::uint32_t>(tree_->nodes.size() - 1));
  }

  YamlTree* tree_;
  std::vector<std::uint32_t> open_;  // lists and maps not yet ended
  std::unordered_map<YAML::anchor_t, std::uint32_t> anchors_;
  int documents_ = 0;
};

std::string read_file(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) throw engine::SceneError(path + ": " + std::generic_category().message(errno));
  if (S_ISDIR(info.st_mode)) throw engine::SceneError(path + ": expected a scene file, got a folder");
  if (!S_ISREG(info.st_mode)) throw engine::SceneError(path + ": expected a scene file, got a device, pipe or socket");
  if (static_cast<std::uint64_t>(info.st_size) > kMaxFileBytes)
    throw engine::SceneError(path + ": " + std::to_string(info.st_size) + " bytes; a scene file may have at most " +
                             std::to_string(kMaxFileBytes));
  std::ifstream in(path, std::ios::binary);
  if (!in) throw engine::SceneError(path + ": cannot be opened: " + std::generic_category().message(errno));
  std::string content(static_cast<std::size_t>(info.st_size), '\0');
  in.read(content.data(), info.st_size);
  content.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return content;
}

}  // namespace

void fail_at(const std::string& file, int line, const std::string& message) {
  throw engine::SceneError(file + ":" + std::to_string(line) + ": " + message);
}

std::shared_ptr<const YamlTree> read_yaml_tree(const std::string& path) {
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
    throw engine::SceneError(path + ": not valid YAML: " + e.what());
  }
  if (tree->nodes.empty())
    throw engine::SceneError(path + ": the file is empty; expected a map with the key \"bodies\"");
  return tree;
}

}  // namespace clearance
