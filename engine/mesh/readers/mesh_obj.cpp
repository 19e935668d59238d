// Wavefront OBJ: v, f, l, p, o, g and usemtl; all else is ignored.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;
constexpr std::int64_t kMostVertices = std::numeric_limits<std::uint32_t>::max() - 1;

class ObjReader {
 public:
  explicit ObjReader(std::string_view content) : text_(content, MeshText::Comments::kHash) {}

  void read(const PartSink& sink) {
    for (; !text_.at_end(); text_.skip_line()) {
      const std::string_view key = text_.word_in_line();
      if (key == "v")
        read_vertex();
      else if (key == "f" || key == "fo" || key == "l" || key == "p")
        read_element(key.starts_with('f'));
      else if (key == "o")
        begin_object(std::string(text_.word_in_line()));
      else if (key == "g")
        begin_group();
      else if (key == "usemtl")
        begin_material(std::string(text_.word_in_line()));
    }
    if (largest_ > positions_.size()) fail_corner(place_of_largest_, static_cast<std::int64_t>(largest_));
    // Meshes of an object are contiguous, even if the file returns to it later.
    std::stable_sort(parts_.begin(), parts_.end(), [](const Part& a, const Part& b) { return a.object < b.object; });
    UsedPositions positions(positions_);
    const auto fail = [this](std::size_t place, const std::string& what) { text_.fail_at(place, what); };
    for (Part& p : parts_) {
      if (p.used.empty()) continue;
      double rounding = rounding_;
      MeshPart part = positions.part(p.used, p.faces.take_triangles(positions_, &rounding, fail));
      part.rounding = rounding;
      sink(std::move(part));
    }
  }

 private:
  struct Part {
    std::size_t object;
    std::string material;  // empty if unnamed
    std::vector<std::uint32_t> used;
    FaceList faces;
  };

  void read_vertex() {
    Vec3d p{0, 0, 0};
    for (int k = 0; k < 3; ++k) p[k] = text_.number(text_.word_in_line(), "a coordinate");
    // A fourth number is a weight, unless colours follow.
    const std::string_view fourth = text_.word_in_line();
    if (!fourth.empty() && text_.word_in_line().empty()) {
      const double w = text_.number(fourth, "a weight");
      if (w == 0) text_.fail("a vertex has the weight 0");
      if (w != 1) {
        p = {p.x / w, p.y / w, p.z / w};
        rounding_ = std::max(rounding_, 4 * kUnitRoundoff * norm(p) + std::numeric_limits<double>::min());
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
          text_.fail("a vertex is not finite by its weight");
      }
    }
    positions_.push_back(p);
  }

  [[noreturn]] void fail_corner(std::size_t place, std::int64_t named) const {
    text_.fail_at(
        place, "a face names vertex " + std::to_string(named) + ", and there are " + std::to_string(positions_.size()));
  }

  std::uint32_t read_corner(std::string_view word) {
    const std::int64_t named = text_.integer(word.substr(0, word.find('/')), "the number of a vertex");
    const auto count = static_cast<std::int64_t>(positions_.size());
    const std::int64_t index = named < 0 ? count + named : named - 1;
    if (named == 0 || index < 0 || index >= kMostVertices) fail_corner(text_.place(), named);
    if (index >= count && index >= static_cast<std::int64_t>(largest_)) {  // the vertex may follow later
      largest_ = static_cast<std::size_t>(index) + 1;
      place_of_largest_ = text_.place();
    }
    return static_cast<std::uint32_t>(index);
  }

  void read_element(bool is_face) {
    corners_.clear();
    for (std::string_view word = text_.word_in_line(); !word.empty(); word = text_.word_in_line())
      corners_.push_back(read_corner(word));
    if (corners_.empty()) return;
    if (parts_.empty()) begin_object("");
    Part& part = parts_[current_];
    part.used.insert(part.used.end(), corners_.begin(), corners_.end());
    if (is_face) part.faces.add(corners_, text_.place());
  }

  void begin_part(std::size_t object) {
    current_ = last_part_[object] = parts_.size();
    parts_.push_back({object, material_, {}, {}});
  }

  void add_object() {
    last_part_.push_back(0);
    begin_part(last_part_.size() - 1);
  }

  void begin_object(const std::string& name) {
    const auto [at, fresh] = objects_.try_emplace(name, last_part_.size());
    if (fresh)
      add_object();
    else
      current_ = last_part_[at->second];  // resumes the object's last part
  }

  void begin_group() {
    std::string name;
    for (std::string_view word = text_.word_in_line(); !word.empty(); word = text_.word_in_line())
      name += (name.empty() ? "" : " ") + std::string(word);
    if (name == group_) return;
    group_ = name;
    objects_.try_emplace(name, last_part_.size());
    add_object();
  }

  void begin_material(const std::string& name) {
    if (name.empty() || name == material_) return;
    material_ = name;
    if (parts_.empty()) return;
    Part& part = parts_[current_];
    if (part.used.empty() || part.material.empty())
      part.material = name;
    else if (part.material != name)
      begin_part(part.object);
  }

  MeshText text_;
  std::vector<Vec3d> positions_;
  std::vector<Part> parts_;
  std::vector<std::uint32_t> corners_;
  std::map<std::string, std::size_t> objects_;  // by name, groups among them
  std::vector<std::size_t> last_part_;          // of each object
  std::size_t current_ = 0;
  std::string group_, material_;
  std::size_t largest_ = 0, place_of_largest_ = 0;  // largest vertex number that a face named before the vertex, from 1
  double rounding_ = 0;
};

}  // namespace

void read_obj(std::string_view content, const PartSink& sink) {
  ObjReader(content).read(sink);
}

}  // namespace clearance
