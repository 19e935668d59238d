// An XML file as a tree of elements with their lines, for errors that name file, line and element.
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

/// Error in a robot's description. The text names cause and place: "panda.urdf:12: joint "j1": limit: lower: expected a
/// finite number, got "nan"".
struct RobotError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Handle of an element of the file, which keeps the whole file alive. Attributes have no defaults here.
class XmlElement {
 public:
  /// Reads a file and returns its root element. Throws RobotError for a file that cannot be read, is no XML, is larger
  /// than 8 MiB or nested deeper than 64 elements, or has a root element of another name.
  /// \param root expected name of the root element
  static XmlElement load(const std::string& path, const char* root);
  /// Parses the text of a file.
  /// \param file its name, for errors
  static XmlElement parse(std::string_view text, const std::string& file, const char* root);

  std::string name() const;
  /// Returns the place of this element, such as "panda.urdf:12: joint "j1": limit".
  std::string place() const;
  /// Throws RobotError with this place.
  [[noreturn]] void fail(const std::string& message) const;

  enum class Macros { kName, kAttributes, kInside };
  /// Throws RobotError for input of the program xacro: elements of its namespace, ${...} and $(find ...).
  /// \param where whether to check the element's name, its attributes as well, or the elements inside as well
  /// \param example name of a file without them, for the error
  void reject_macros(Macros where, const char* example) const;

  /// Returns the child elements, in the file's order.
  /// \param name only those of this name; null for all
  std::vector<XmlElement> children(const char* name = nullptr) const;
  /// Returns the only child of that name, if any. Throws RobotError for a second one.
  std::optional<XmlElement> child(const char* name) const;
  XmlElement required_child(const char* name) const;

  bool has(const char* attribute) const;
  /// Returns a required attribute, which must not be empty.
  std::string text(const char* attribute) const;
  /// Returns the finite float64 nearest to a required decimal.
  double number(const char* attribute) const;
  double positive(const char* attribute) const;
  /// Returns three of them, separated by spaces.
  Vec3d vector(const char* attribute) const;

 private:
  struct File;
  XmlElement(std::shared_ptr<const File> file, void* node) : file_(std::move(file)), node_(node) {}
  double number_of(const char* attribute, std::string_view word) const;
  [[noreturn]] void fail_attribute(const char* attribute, const std::string& message) const;

  std::shared_ptr<const File> file_;
  void* node_;  // of pugi::xml_node, so that users of this header do not compile pugixml's
};

/// Reads a file's text, up to slightly more than 8 MiB, which XmlElement::parse() rejects. Throws RobotError.
std::string read_text(const std::string& path);

/// Returns the beginning of a file's text in quotes, without unprintable characters, for errors.
std::string excerpt(std::string_view text);

}  // namespace clearance
