// A file in XML as a tree of elements, each of which knows its line; what is wrong with it names file, line and
// element.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/vec.h"

namespace clearance {

/// A robot's description that cannot be used. The text names cause and place: "panda.urdf:12: joint "j1": limit: lower:
/// expected a finite number, got "nan"".
struct RobotError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An element of the file. Handles are small; each keeps the whole file alive. Attributes are taken as they stand: none
/// has a default here.
class XmlElement {
 public:
  /// The outermost element. Throws RobotError for a file that cannot be read, is no XML, is larger than 8 MiB or nested
  /// deeper than 64 elements, or begins with an element of another name. \param root its name
  static XmlElement load(const std::string& path, const char* root);
  /// The same of a file's text. \param file its name, for errors
  static XmlElement parse(std::string_view text, const std::string& file, const char* root);

  std::string name() const;
  /// "panda.urdf:12: joint "j1": limit": where this element stands.
  std::string place() const;
  /// Throws RobotError at this place.
  [[noreturn]] void fail(const std::string& message) const;

  enum class Macros { kName, kAttributes, kInside };
  /// Throws RobotError for what the program xacro replaces: elements of its namespace, ${...} and $(find ...).
  /// \param where in the element's name, in its attributes as well, or in the elements inside as well
  /// \param example name of a file without
  void refuse_macros(Macros where, const char* example) const;

  /// Elements directly inside, in the file's order. \param name of the ones wanted; null: all
  std::vector<XmlElement> children(const char* name = nullptr) const;
  /// The only one of that name; none: there is none. A second one is an error.
  std::optional<XmlElement> child(const char* name) const;
  XmlElement required_child(const char* name) const;

  bool has(const char* attribute) const;
  /// An attribute that must be there, and not be empty.
  std::string text(const char* attribute) const;
  /// The finite float64 nearest to a decimal, which must be there.
  double number(const char* attribute) const;
  double positive(const char* attribute) const;
  /// Three of them, with spaces between.
  Vec3d vector(const char* attribute) const;

 private:
  struct File;
  XmlElement(std::shared_ptr<const File> file, void* node) : file_(std::move(file)), node_(node) {}
  double number_of(const char* attribute, std::string_view word) const;
  [[noreturn]] void fail_attribute(const char* attribute, const std::string& message) const;

  std::shared_ptr<const File> file_;
  void* node_;  // pugi::xml_node's, so that no user of this header compiles pugixml's
};

/// A file's text, of a little more than 8 MiB at most, which XmlElement::parse() refuses. Throws RobotError.
std::string read_text(const std::string& path);

/// A text of a file as an error quotes it: its beginning, in quotes, nothing unprintable.
std::string excerpt(std::string_view text);

}  // namespace clearance
