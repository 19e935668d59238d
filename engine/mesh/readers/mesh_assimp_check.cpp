#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "engine/mesh/mesh_bytes.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/readers/mesh_assimp.h"
#include "engine/mesh/zip_file.h"

namespace clearance {

namespace {

using pugi::xml_node;

struct Unit {
  std::string_view name;
  double metres;
};
constexpr Unit kUnits[] = {{"micron", 1e-6}, {"millimeter", 1e-3}, {"millimeters", 1e-3}, {"centimeter", 1e-2},
                           {"meter", 1},     {"inch", 0.0254},     {"foot", 0.3048},      {"feet", 0.3048}};

// 3MF and AMF are in millimetres unless they declare another unit.
double metres_of(const xml_node& root) {
  const std::string name = lower(root.attribute("unit").as_string("millimeter"));
  for (const Unit& unit : kUnits)
    if (unit.name == name) return unit.metres;
  throw LoadError("unknown unit " + in_quotes(name) + "; expected micron, millimeter, centimeter, meter, inch or foot");
}

// Returns the finite numbers of a text, separated by spaces or commas. assimp reads 0 where it cannot parse one.
std::vector<double> finite_numbers(const char* text) {
  std::vector<double> out;
  for (;;) {
    text += std::strspn(text, " \t\r\n,");
    if (!*text) return out;
    char* end = nullptr;
    out.push_back(std::strtod(text, &end));
    if (end == text || !std::isfinite(out.back()) || !std::strchr(" \t\r\n,", *end))
      throw LoadError("expected a finite number, got " + in_quotes(std::string(text, std::strcspn(text, " \t\r\n,"))));
    text = end;
  }
}

void check_one_number(const char* text) {
  if (finite_numbers(text).size() != 1) throw LoadError("expected one number, got " + in_quotes(text));
}

// Calls `visit` for every element of a document, front to back.
template <class Visit>
void for_each_element(const xml_node& root, Visit visit) {
  struct Walker final : pugi::xml_tree_walker {
    explicit Walker(Visit& v) : visit(v) {}
    bool for_each(xml_node& node) override {
      if (node.type() == pugi::node_element) visit(node);
      return true;
    }
    Visit& visit;
  } walker(visit);
  xml_node(root).traverse(walker);
}

pugi::xml_document parsed(std::string_view content) {
  pugi::xml_document document;
  const auto result = document.load_buffer(content.data(), content.size());
  if (result.status == pugi::status_out_of_memory) throw std::bad_alloc();
  if (!result) throw LoadError(std::string("invalid XML: ") + result.description());
  return document;
}

double check_3mf(std::string_view content) {
  const std::vector<std::string> models = zip_entries(content, ".model");
  if (models.empty()) throw LoadError("not a 3MF file: no zip archive with a model");
  if (models.size() > 1) throw LoadError("its model is split into several files, which is not read");
  const pugi::xml_document document = parsed(models[0]);
  const xml_node model = document.child("model");
  if (!model) throw LoadError("not a 3MF file: it has no <model>");
  if (const std::string required = model.attribute("requiredextensions").value(); !required.empty())
    throw LoadError("it needs the extension " + in_quotes(required) + ", which is not read");
  for_each_element(model, [](const xml_node& node) {
    const std::string_view name = node.name();
    if (name == "vertex")
      for (const char* axis : {"x", "y", "z"}) check_one_number(node.attribute(axis).value());
    if (name == "triangle")
      for (const char* corner : {"v1", "v2", "v3"}) check_one_number(node.attribute(corner).value());
    if (const pugi::xml_attribute transform = node.attribute("transform"))
      if (finite_numbers(transform.value()).size() != 12) throw LoadError("a transform that is not 12 numbers");
  });
  return metres_of(model);
}

double check_amf(std::string_view content) {
  const pugi::xml_document document = parsed(content);
  const xml_node amf = document.child("amf");
  if (!amf) throw LoadError("not an AMF file: it has no <amf>");
  for_each_element(amf, [](const xml_node& node) {
    const std::string_view name = node.name(), parent = node.parent().name();
    if (name == "edge" || (name == "normal" && parent == "vertex"))
      throw LoadError("a curved triangle (<" + std::string(name) + ">) is not read");
    if (name == "coordinates")
      for (const char* axis : {"x", "y", "z"}) check_one_number(node.child(axis).text().get());
    if (parent == "triangle" && (name == "v1" || name == "v2" || name == "v3")) check_one_number(node.text().get());
  });
  return metres_of(amf);
}

// X3D is in metres unless its head declares another unit.
double check_x3d(std::string_view content) {
  constexpr const char* kUnread[] = {"Sphere",
                                     "Cylinder",
                                     "Cone",
                                     "Extrusion",
                                     "Text",
                                     "Arc2D",
                                     "ArcClose2D",
                                     "Circle2D",
                                     "Disk2D",
                                     "Inline",
                                     "Switch",
                                     "LOD",
                                     "Billboard",
                                     "ProtoInstance",
                                     "NurbsSwept",
                                     "NurbsSwungSurface",
                                     "NurbsPatchSurface",
                                     "NurbsTrimmedSurface",
                                     "HAnimHumanoid",
                                     "CADPart"};
  const pugi::xml_document document = parsed(content);
  const xml_node root = document.child("X3D");
  if (!root) throw LoadError("not an X3D file: it has no <X3D>");
  double metres = 1;
  for_each_element(root, [&](const xml_node& node) {
    const std::string_view name = node.name();
    for (const char* unread : kUnread)
      if (name == unread) throw LoadError("a <" + std::string(name) + "> is not read; export triangles instead");
    if (name == "Transform" && node.attribute("center"))
      for (const double x : finite_numbers(node.attribute("center").value()))
        if (x != 0) throw LoadError("a <Transform> with a center is not read");
    if (name == "Coordinate" || name == "CoordinateDouble") finite_numbers(node.attribute("point").value());
    if (lower(name) != "unit" || std::string_view(node.attribute("category").value()) != "length") return;
    const std::vector<double> factor = finite_numbers(node.attribute("conversionFactor").value());
    if (factor.size() != 1) throw LoadError("a <unit> without one conversionFactor");
    metres = factor[0];
  });
  return metres;
}

// DXF declares its unit in a variable of its header, and also holds entities other than meshes.
double check_dxf(std::string_view content) {
  constexpr std::string_view kUnread[] = {"3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "MESH"};
  constexpr Unit kInsunits[] = {{"0", 1}, {"1", 0.0254}, {"2", 0.3048}, {"4", 1e-3}, {"5", 1e-2}, {"6", 1}};
  MeshText text(content);
  double metres = 1;
  std::string_view before;
  for (std::string_view word = text.word(); !word.empty(); before = word, word = text.word()) {
    if (before == "0" && std::find(std::begin(kUnread), std::end(kUnread), word) != std::end(kUnread))
      text.fail("a " + std::string(word) + " is not read; export 3DFACEs or polyface meshes instead");
    if (word != "$INSUNITS") continue;
    if (text.word() != "70") text.fail("$INSUNITS has no value");
    const std::string_view value = text.word();
    const auto* unit =
        std::find_if(std::begin(kInsunits), std::end(kInsunits), [&](const Unit& u) { return u.name == value; });
    if (unit == std::end(kInsunits))
      text.fail("unknown unit $INSUNITS " + in_quotes(value) + "; expected 0, 1 (inch), 2 (foot), 4 (mm), 5 (cm) or 6");
    metres = unit->metres;
  }
  return metres;
}

// The largest number among the vertices, matrices and pivots of a 3DS file.
double largest_in_3ds(std::string_view content) {
  constexpr std::uint64_t kContainers[] = {0x4D4D, 0x3D3D, 0x4100, 0xB000, 0xB002};
  double largest = 0;
  const auto take_floats = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i + 4 <= end; i += 4)
      if (const double x = std::abs(real_at<float>(content, i)); x > largest) largest = x;
  };
  for (std::size_t at = 0; at + 6 <= content.size();) {
    const std::uint64_t kind = unsigned_at(content, at, 2), bytes = unsigned_at(content, at + 2, 4);
    const std::size_t begin = at + 6,
                      end = std::min<std::uint64_t>(at + std::max<std::uint64_t>(bytes, 6), content.size());
    at = end;
    if (std::find(std::begin(kContainers), std::end(kContainers), kind) != std::end(kContainers)) at = begin;
    if (kind == 0x4000) at = std::min(content.find('\0', begin), end - 1) + 1;  // the object's chunks follow a name
    if (kind == 0x4110 && begin + 2 <= end) take_floats(begin + 2, end);
    if (kind == 0x4160 || kind == 0xB013) take_floats(begin, end);
  }
  return largest;
}

// The largest such number of an ASE file, which is read line by line.
double largest_in_ase(std::string_view content) {
  MeshText text(content);
  double largest = 0;
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    if (word != "*MESH_VERTEX" && word != "*TM_ROW3" && word != "*TM_POS") continue;
    for (std::string_view x = text.word_in_line(); !x.empty(); x = text.word_in_line()) {
      const double size = std::abs(std::strtod(std::string(x).c_str(), nullptr));
      if (word == "*MESH_VERTEX")
        word = "*";  // its first number is an index
      else if (std::isfinite(size))
        largest = std::max(largest, size);
    }
  }
  return largest;
}

// Subdivision surfaces, of which a file holds only the control mesh.
void check_ac(std::string_view content) {
  MeshText text(content);
  for (std::string_view word = text.word(); !word.empty(); word = text.word())
    if (word == "subdiv" && text.word() != "0")
      text.fail("a subdivided surface is not read; export its triangles instead");
}

}  // namespace

AssimpFacts check_assimp(const AssimpFormat& format, std::string_view content) {
  const std::string_view extension = format.extension;
  AssimpFacts facts;
  if (extension == "3mf") facts.metres = check_3mf(content);
  if (extension == "amf") facts.metres = check_amf(content);
  if (extension == "x3d") facts.metres = check_x3d(content);
  if (extension == "dxf") facts.metres = check_dxf(content);
  if (extension == "3ds") facts.largest = largest_in_3ds(content);
  if (extension == "ase") facts.largest = largest_in_ase(content);
  if (extension == "ac" || extension == "ac3d" || extension == "acc") check_ac(content);
  return facts;
}

}  // namespace clearance
