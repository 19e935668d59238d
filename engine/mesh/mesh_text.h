// The text of a mesh file, word by word and line by line; what is wrong with it names the line.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace clearance {

/// A mesh file that cannot be read: the text names the cause and, where there is one, the line.
struct LoadError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// ASCII letters in lower case.
std::string lower(std::string_view text);
/// A word of a file as an error quotes it: its beginning, in quotes.
std::string in_quotes(std::string_view word);

class MeshText {
 public:
  enum class Comments { kNone, kHash };

  /// \param text of a file, a byte order mark included. \param comments kHash: from # to the end of a line; a backslash
  /// at its end then joins it with the next one.
  explicit MeshText(std::string_view text, Comments comments = Comments::kNone);

  /// The next word, on whatever line; empty at the end of the file.
  std::string_view word();
  /// The next word of this line; empty at its end.
  std::string_view word_in_line();
  /// Goes behind the end of this line.
  void skip_line();
  /// Goes on at a byte of the file.
  void go_to(std::size_t at) { at_ = begin_ = at; }
  bool at_end() const { return at_ == text_.size(); }
  /// What is left, from the next character on.
  std::string_view rest() const { return text_.substr(at_); }

  /// The finite float64 nearest to a decimal. Throws LoadError. \param what was expected: "a coordinate".
  double number(std::string_view word, const char* what) const;
  /// Throws LoadError for anything but a decimal of a number that an int64 holds.
  std::int64_t integer(std::string_view word, const char* what) const;
  /// Throws LoadError: "line 3: ..." for the line of the last word.
  [[noreturn]] void fail(const std::string& what) const { fail_at(begin_, what); }
  /// The same for a word that place() was asked about.
  [[noreturn]] void fail_at(std::size_t place, const std::string& what) const;
  std::size_t place() const { return begin_; }

 private:
  std::string_view take();
  bool skip_spaces(bool over_lines);

  std::string_view text_;
  bool comments_;
  std::size_t at_ = 0, begin_ = 0;  // of what is next, and of the last word
};

}  // namespace clearance
