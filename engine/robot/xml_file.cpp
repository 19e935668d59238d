#include "engine/robot/xml_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <pugixml.hpp>
#include <system_error>

namespace clearance {

namespace {

using pugi::xml_node;

constexpr std::size_t kMaxBytes = std::size_t{8} << 20;  // forty times the largest known robot
constexpr int kMaxDepth = 64;
constexpr const char* kSpaces = " \t\r\n";

xml_node node_of(void* node) {
  return xml_node(static_cast<pugi::xml_node_struct*>(node));
}

// The next element in the order of the text, with its depth; null at the end. Not recursive, since the file determines
// the depth.
xml_node next_in_text(xml_node at, int* depth) {
  if (at.first_child()) {
    ++*depth;
    return at.first_child();
  }
  while (at && !at.next_sibling()) {
    at = at.parent();
    --*depth;
  }
  return at.next_sibling();
}

// Whether xacro replaces a part of an attribute's value.
bool has_macro(std::string_view value) {
  if (const std::size_t at = value.find("${"); at != std::string_view::npos && value.find('}', at) != std::string::npos)
    return true;
  for (std::size_t at = value.find("$("); at != std::string_view::npos; at = value.find("$(", at + 1)) {
    const std::string_view rest = value.substr(at + 2);
    const std::string_view word = rest.substr(0, rest.find_first_of(" )"));
    for (const char* known : {"find", "arg", "env", "optenv", "anon", "eval", "dirname", "cwd"})
      if (word == known) return true;
  }
  return false;
}

// Whether an element's prefix is xacro, or one that the file declares for xacro's namespace.
bool is_macro(xml_node node) {
  const std::string_view name = node.name();
  const std::size_t colon = name.find(':');
  if (colon == std::string_view::npos) return false;
  if (name.substr(0, colon) == "xacro") return true;
  const std::string declared = "xmlns:" + std::string(name.substr(0, colon));
  for (; node; node = node.parent())
    if (const auto space = node.attribute(declared.c_str()))
      return std::string_view(space.value()).find("/xacro") != std::string_view::npos;
  return false;
}

}  // namespace

std::string read_text(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) throw RobotError(path + ": " + std::generic_category().message(errno));
  if (!S_ISREG(info.st_mode)) throw RobotError(path + ": not a plain file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw RobotError(path + ": " + std::generic_category().message(errno));
  std::string text;
  text.resize(std::min(static_cast<std::size_t>(info.st_size), kMaxBytes) + 1);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

std::string excerpt(std::string_view text) {
  std::string out = "\"";
  for (const char c : text.substr(0, 60)) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return out + (text.size() > 60 ? "...\"" : "\"");
}

struct XmlElement::File {
  std::string name, text;
  std::vector<std::ptrdiff_t> ends;  // of lines, in `text`
  pugi::xml_document document;

  File(std::string file, std::string_view content) : name(std::move(file)), text(content) {
    for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1))
      ends.push_back(static_cast<std::ptrdiff_t>(at));
  }
  std::size_t line_at(std::ptrdiff_t offset) const {
    return 1 + static_cast<std::size_t>(std::lower_bound(ends.begin(), ends.end(), offset) - ends.begin());
  }
  [[noreturn]] void fail_at(std::ptrdiff_t offset, const std::string& message) const {
    throw RobotError(name + ":" + std::to_string(line_at(offset)) + ": " + message);
  }
};

XmlElement XmlElement::load(const std::string& path, const char* root) {
  return parse(read_text(path), path, root);
}

XmlElement XmlElement::parse(std::string_view text, const std::string& name, const char* root) {
  if (text.size() > kMaxBytes) throw RobotError(name + ": larger than 8 MiB");
  const auto file = std::make_shared<File>(name, text.starts_with("\xEF\xBB\xBF") ? text.substr(3) : text);
  if (const std::size_t zero = file->text.find('\0'); zero != std::string::npos)
    file->fail_at(static_cast<std::ptrdiff_t>(zero), "a zero byte; expected text");
  const pugi::xml_parse_result result =
      file->document.load_buffer(file->text.data(), file->text.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!result) file->fail_at(result.offset, std::string("invalid XML: ") + result.description());
  int depth = 0;
  for (xml_node at = file->document.first_child(); at; at = next_in_text(at, &depth)) {
    if (depth >= kMaxDepth) file->fail_at(at.offset_debug(), "nested deeper than 64 elements");
    std::vector<std::string_view> seen;
    for (const auto attribute : at.attributes()) {
      if (std::find(seen.begin(), seen.end(), attribute.name()) != seen.end())
        XmlElement(file, at.internal_object()).fail_attribute(attribute.name(), "is set twice");
      seen.emplace_back(attribute.name());
      if (seen.size() > kMaxDepth) XmlElement(file, at.internal_object()).fail("more than 64 attributes");
    }
  }
  const xml_node first = file->document.document_element();
  if (std::strcmp(first.name(), root) != 0)
    file->fail_at(first.offset_debug(), std::string("expected the element <") + root + ">, got <" +
                                            std::string(first.name()).substr(0, 60) + ">");
  if (first.next_sibling(root)) file->fail_at(first.next_sibling(root).offset_debug(), "a second outermost element");
  return {file, first.internal_object()};
}

std::string XmlElement::name() const {
  return node_of(node_).name();
}

std::string XmlElement::place() const {
  const xml_node node = node_of(node_);
  std::string path;
  for (xml_node at = node; at.parent().parent(); at = at.parent()) {
    std::string step = std::string(at.name()).substr(0, 60);
    if (const auto name = at.attribute("name")) step.append(" ").append(excerpt(name.value()));
    path = path.empty() ? step : step.append(": ").append(path);
  }
  return file_->name + ":" + std::to_string(file_->line_at(node.offset_debug())) +
         (path.empty() ? std::string() : ": " + path);
}

void XmlElement::fail(const std::string& message) const {
  throw RobotError(place() + ": " + message);
}

void XmlElement::fail_attribute(const char* attribute, const std::string& message) const {
  fail(std::string(attribute).substr(0, 60) + ": " + message);
}

void XmlElement::reject_macros(Macros where, const char* example) const {
  const std::string hint = std::string("; expand the file first: xacro FILE > ") + example;
  int depth = 0;
  for (xml_node at = node_of(node_); at; at = next_in_text(at, &depth)) {
    if (at != node_of(node_) && (where != Macros::kInside || depth <= 0)) return;
    const XmlElement element(file_, at.internal_object());
    if (is_macro(at)) element.fail("a macro of xacro" + hint);
    for (const auto attribute : at.attributes())
      if (where != Macros::kName && has_macro(attribute.value()))
        element.fail_attribute(attribute.name(), "xacro replaces a part of " + excerpt(attribute.value()) + hint);
  }
}

std::vector<XmlElement> XmlElement::children(const char* name) const {
  std::vector<XmlElement> out;
  for (const xml_node child : node_of(node_).children())
    if (child.type() == pugi::node_element && (!name || std::strcmp(child.name(), name) == 0))
      out.push_back({file_, child.internal_object()});
  return out;
}

std::optional<XmlElement> XmlElement::child(const char* name) const {
  const std::vector<XmlElement> found = children(name);
  if (found.size() > 1) found[1].fail("there is one already; expected one at most");
  return found.empty() ? std::nullopt : std::optional(found[0]);
}

XmlElement XmlElement::required_child(const char* name) const {
  const auto found = child(name);
  if (!found) fail(std::string("expected an element <") + name + ">");
  return *found;
}

bool XmlElement::has(const char* attribute) const {
  return node_of(node_).attribute(attribute);
}

std::string XmlElement::text(const char* attribute) const {
  const auto found = node_of(node_).attribute(attribute);
  if (!found) fail(std::string("expected the attribute ") + attribute);
  if (!*found.value()) fail_attribute(attribute, "expected a text, got none");
  return found.value();
}

double XmlElement::number_of(const char* attribute, std::string_view word) const {
  std::string_view digits = word;
  if (digits.starts_with('+') && !digits.starts_with("+-")) digits.remove_prefix(1);  // which from_chars rejects
  double x = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (error == std::errc::invalid_argument || end != digits.data() + digits.size())
    fail_attribute(attribute, "expected a number, got " + excerpt(word));
  if (error == std::errc::result_out_of_range)
    x = std::strtod(std::string(digits).c_str(), nullptr);  // 0, or too large
  if (!std::isfinite(x)) fail_attribute(attribute, "expected a finite number, got " + excerpt(word));
  return x;
}

double XmlElement::number(const char* attribute) const {
  const std::string value = text(attribute);
  const std::size_t begin = value.find_first_not_of(kSpaces), end = value.find_last_not_of(kSpaces);
  return number_of(attribute, begin == std::string::npos ? "" : std::string_view(value).substr(begin, end - begin + 1));
}

double XmlElement::positive(const char* attribute) const {
  const double x = number(attribute);
  if (!(x > 0)) fail_attribute(attribute, "expected a number > 0, got " + excerpt(text(attribute)));
  return x;
}

Vec3d XmlElement::vector(const char* attribute) const {
  const std::string value = text(attribute);
  Vec3d out{0, 0, 0};
  int count = 0;
  for (std::size_t at = value.find_first_not_of(kSpaces); at != std::string::npos;) {
    const std::size_t end = std::min(value.find_first_of(kSpaces, at), value.size());
    if (count < 3) out[count] = number_of(attribute, std::string_view(value).substr(at, end - at));
    ++count;
    at = value.find_first_not_of(kSpaces, end);
  }
  if (count != 3) fail_attribute(attribute, "expected 3 numbers, got " + excerpt(value));
  return out;
}

}  // namespace clearance
