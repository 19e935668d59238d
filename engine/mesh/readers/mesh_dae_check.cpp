#include <assimp/fast_atof.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "engine/mesh/mesh_text.h"
#include "engine/mesh/readers/mesh_dae.h"

namespace clearance {

namespace {

using pugi::xml_node;

constexpr int kMostNodes = 100'000;  // including instances, each of which costs assimp a kilobyte or more

// Relative error of one transform of a node: entries, cosines and products are rounded to float32.
constexpr double kStepRounding = 16 * 0x1p-24;
constexpr double kFloatTiny = 1.2e-38;  // underflow in float32

// Exception type for assimp's function, whose own exceptions its library does not export.
struct NoNumber {
  template <class... Text>
  explicit NoNumber(Text&&...) {}
};

// A number of the file with assimp's error.
struct Decimal {
  double exact;
  double off;  // bound on the error of assimp's value
};

// Returns the numbers of an element's text, compared with those that assimp's own function reads.
std::vector<Decimal> numbers(const char* text) {
  std::vector<Decimal> out;
  for (;;) {
    text += std::strspn(text, " \t\r\n");
    if (!*text) return out;
    const std::string word(text, std::strcspn(text, " \t\r\n"));
    float read = 0;
    try {
      Assimp::fast_atoreal_move<float, NoNumber>(word.c_str(), read);
    } catch (const NoNumber&) {
      throw LoadError("expected a number, got " + in_quotes(word));
    }
    char* end = nullptr;
    const double exact = std::strtod(word.c_str(), &end);
    if (*end) throw LoadError("expected a number, got " + in_quotes(word));
    out.push_back({exact, std::abs(exact - static_cast<double>(read))});
    text += word.size();
  }
}

// Bounds of a transform, or a chain of them, for coordinates of at most s: the result is at most scale s + shift, and
// its error in float32 at most off_scale s + off_shift.
struct Growth {
  double scale = 1, shift = 0, off_scale = 0, off_shift = 0;

  Growth after(const Growth& inner) const {
    return {scale * inner.scale, scale * inner.shift + shift,
            off_scale * (inner.scale + inner.off_scale) + scale * inner.off_scale,
            off_scale * (inner.shift + inner.off_shift) + off_shift + scale * inner.off_shift};
  }
};

class DaeCheck {
 public:
  explicit DaeCheck(xml_node root) : root_(root) { index(root); }

  double rounding() {
    Growth unit;
    if (const auto meter = root_.child("asset").child("unit").attribute("meter")) {
      unit.scale = std::abs(step_number(meter.value()));
      unit.off_scale = kStepRounding * unit.scale;
    }
    if (unit.scale == 1) unit.off_scale = 0;
    const std::string scene = root_.child("scene").child("instance_visual_scene").attribute("url").value();
    walk(find("visual_scene", scene), unit);
    return worst_;
  }

 private:
  void index(xml_node node) {
    struct Walker final : pugi::xml_tree_walker {
      std::map<std::string, xml_node>* ids;
      bool for_each(xml_node& n) override {
        if (const auto id = n.attribute("id")) ids->try_emplace(std::string(n.name()) + id.value(), n);
        return true;
      }
    } walker;
    walker.ids = &ids_;
    node.traverse(walker);
  }

  xml_node find(const std::string& kind, const std::string& url) const {
    const auto at = ids_.find(kind + (url.starts_with('#') ? url.substr(1) : url));
    return at == ids_.end() ? xml_node() : at->second;
  }

  // Visits every node of the scene, once for each path to it.
  void walk(xml_node scene, const Growth& unit) {
    struct Visit {
      xml_node node;
      Growth growth;
    };
    std::vector<Visit> stack = {{scene, unit}};
    int nodes = 0;
    while (!stack.empty()) {
      const Visit visit = stack.back();
      stack.pop_back();
      if (++nodes > kMostNodes)
        throw LoadError("its nodes repeat each other to more than " + std::to_string(kMostNodes) +
                        ", or a node holds itself");
      Growth growth = visit.growth;
      bool unread = false;
      for (const xml_node child : visit.node.children()) growth = growth.after(step(child, &unread));
      for (const xml_node child : visit.node.children()) {
        const std::string kind = child.name(), url = child.attribute("url").value();
        xml_node geometry;
        if (kind == "node") stack.push_back({child, growth});
        if (kind == "instance_node")
          if (const xml_node named = find("node", url)) stack.push_back({named, growth});
        if (kind == "instance_geometry") geometry = find("geometry", url);
        if (kind == "instance_controller")
          geometry = find("geometry", find("controller", url).child("skin").attribute("source").value());
        if (!geometry) continue;
        if (unread) throw LoadError("a node that shows a mesh has a <skew> or <lookat>, which is not read");
        const auto [size, off] = extent(geometry);
        const double all = growth.scale * off + growth.off_scale * (size + off) + growth.off_shift;
        worst_ = std::max(worst_, all);
      }
    }
  }

  // Returns a number of a transform if assimp reads it to the precision of float32.
  static double step_number(const char* text) {
    const std::vector<Decimal> one = numbers(text);
    if (one.size() != 1) throw LoadError("expected one number, got " + in_quotes(text));
    return checked(one[0]);
  }
  static double checked(const Decimal& d) {
    if (!(d.off <= 0x1p-22 * std::abs(d.exact) + kFloatTiny)) {
      if (!std::isfinite(d.exact)) throw LoadError("the transform of a node is not finite");
      throw LoadError("a transform holds " + std::to_string(d.exact) +
                      ", which the reading library does not understand");
    }
    return d.exact;
  }

  static Growth step(xml_node element, bool* unread) {
    const std::string kind = element.name();
    if (kind == "skew" || kind == "lookat") *unread = true;
    const std::size_t wanted = kind == "matrix"                         ? 16
                               : kind == "rotate"                       ? 4
                               : kind == "scale" || kind == "translate" ? 3
                                                                        : 0;
    if (wanted == 0) return {};
    std::vector<double> x;
    for (const Decimal& d : numbers(element.text().get())) x.push_back(checked(d));
    if (x.size() != wanted)
      throw LoadError("a <" + kind + "> of " + std::to_string(x.size()) + " numbers; expected " +
                      std::to_string(wanted));
    Growth g;
    double misread = 0;
    if (kind == "matrix") {
      g.scale = 0;
      for (std::size_t r = 0; r < 3; ++r) {
        g.scale = std::max(g.scale, std::abs(x[4 * r]) + std::abs(x[4 * r + 1]) + std::abs(x[4 * r + 2]));
        g.shift = std::max(g.shift, std::abs(x[4 * r + 3]));
      }
    } else if (kind == "rotate") {
      const double length = std::hypot(x[0], x[1], x[2]);
      misread = 4 * std::abs(length - 1);  // assimp does not normalise the axis
      if (x[3] != 0 && misread > 1e-4) throw LoadError("the axis of a <rotate> is not of length 1");
      g.scale = 1.7321;
      misread += std::abs(x[3]) * (0x1p-22 * 3.1416 / 180);  // the angle in float32 radians
      if (x[3] == 0) return {};
    } else if (kind == "scale") {
      g.scale = std::max({std::abs(x[0]), std::abs(x[1]), std::abs(x[2])});
    } else {
      g.shift = std::max({std::abs(x[0]), std::abs(x[1]), std::abs(x[2])});
    }
    if (g.scale == 1 && g.shift == 0 && kind != "matrix") return g;
    g.off_scale = (kStepRounding + misread) * g.scale + kFloatTiny;
    g.off_shift = kStepRounding * g.shift + kFloatTiny;
    return g;
  }

  // Returns a geometry's largest coordinate and the largest error of assimp's reading.
  std::pair<double, double> extent(xml_node geometry) {
    const auto [at, fresh] = extents_.try_emplace(geometry.internal_object());
    if (!fresh) return at->second;
    for (const xml_node source : geometry.child("mesh").children("source")) {
      if (!is_position(geometry, source)) continue;
      for (const Decimal& d : numbers(source.child("float_array").text().get())) {
        at->second.first = std::max(at->second.first, std::abs(d.exact));
        at->second.second = std::max(at->second.second, d.off);
      }
    }
    return at->second;
  }

  static bool is_position(xml_node geometry, xml_node source) {
    const std::string name = std::string("#") + source.attribute("id").value();
    for (const xml_node vertices : geometry.child("mesh").children("vertices"))
      for (const xml_node input : vertices.children("input"))
        if (std::strcmp(input.attribute("semantic").value(), "POSITION") == 0 &&
            name == input.attribute("source").value())
          return true;
    return false;
  }

  xml_node root_;
  std::map<std::string, xml_node> ids_;  // elements by name and id
  std::map<void*, std::pair<double, double>> extents_;
  double worst_ = 0;
};

std::string line_of(std::string_view content, std::ptrdiff_t offset) {
  // The offset counts bytes of UTF-8; a file in another encoding may have fewer.
  const auto end = content.begin() + std::clamp<std::ptrdiff_t>(offset, 0, static_cast<std::ptrdiff_t>(content.size()));
  return "line " + std::to_string(std::count(content.begin(), end, '\n') + 1) + ": ";
}

// Rejects faces that assimp reads wrongly: negative indices become 0, polygons with holes are dropped, and <trifans>
// are indistinguishable from polygons. Returns whether all faces are such fans.
bool check_faces(xml_node root, std::string_view content) {
  struct Walker final : pugi::xml_tree_walker {
    xml_node fans, polygons, holes;
    bool for_each(xml_node& n) override {
      const std::string_view name = n.name();
      if (name == "p" && std::strchr(n.text().get(), '-')) throw LoadError("a face has a negative index");
      if (name == "ph") holes = n;
      if (name == "trifans") fans = n;
      if (name == "polylist" || name == "polygons") polygons = n;
      return true;
    }
  } walker;
  root.traverse(walker);
  if (walker.holes)
    throw LoadError(line_of(content, walker.holes.offset_debug()) +
                    "a polygon with holes (<ph>) is not read; cut it into triangles");
  if (walker.fans && walker.polygons)
    throw LoadError(line_of(content, walker.fans.offset_debug()) +
                    "<trifans> in a file that has polygons, too, are not read; cut them into triangles");
  return !walker.fans.empty();
}

}  // namespace

DaeFacts check_dae(std::string_view content) {
  pugi::xml_document document;
  const auto result = document.load_buffer(content.data(), content.size());
  if (result.status == pugi::status_out_of_memory) throw std::bad_alloc();
  if (!result) throw LoadError(line_of(content, result.offset) + "invalid XML: " + result.description());
  const xml_node root = document.child("COLLADA");
  if (!root) throw LoadError("not a DAE file: it has no <COLLADA>");
  const bool has_fans = check_faces(root, content);
  const double rounding = DaeCheck(root).rounding();
  if (!std::isfinite(rounding)) throw LoadError("the transform of a node is not finite");
  return {rounding, has_fans};
}

}  // namespace clearance
