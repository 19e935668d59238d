// Tokens of a text mesh file. Errors name the line.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace clearance {

/// A mesh file that cannot be read. The text names the cause and the line, if there is one.
struct LoadError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Returns a text with ASCII letters in lower case.
std::string lower(std::string_view text);
/// Returns the beginning of a word in quotes, for an error.
std::string in_quotes(std::string_view word);

class MeshText {
 public:
  enum class Comments { kAbsent, kHash };

  /// \param text of a file, with or without a byte order mark
  /// \param comments kHash ignores # to the end of a line, and joins a line that ends in a backslash with the next one
  explicit MeshText(std::string_view text, Comments comments = Comments::kAbsent);

  /// Returns the next word of the file; empty at its end.
  std::string_view word();
  /// Returns the next word of this line; empty at its end.
  std::string_view word_in_line();
  /// Moves to the next line.
  void skip_line();
  /// Moves to a byte of the file.
  void go_to(std::size_t at) { at_ = begin_ = at; }
  bool at_end() const { return at_ == text_.size(); }
  /// Returns the rest of the text.
  std::string_view rest() const { return text_.substr(at_); }

  /// Returns the finite float64 nearest to a decimal. Throws LoadError.
  /// \param what names the expected number in the error, as in "a coordinate"
  double number(std::string_view word, const char* what) const;
  /// Returns an integer. Throws LoadError for anything but a decimal in the range of int64.
  std::int64_t integer(std::string_view word, const char* what) const;
  /// Throws LoadError: "line 3: ..." for the line of the last word.
  [[noreturn]] void fail(const std::string& what) const { fail_at(begin_, what); }
  /// The same for the word at `place`, as place() returned it.
  [[noreturn]] void fail_at(std::size_t place, const std::string& what) const;
  std::size_t place() const { return begin_; }

 private:
  std::string_view take();
  bool skip_spaces(bool over_lines);

  std::string_view text_;
  bool comments_;
  std::size_t at_ = 0, begin_ = 0;  // offsets of the next character and of the last word
};

}  // namespace clearance
