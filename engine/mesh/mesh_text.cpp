#include "engine/mesh/mesh_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace clearance {

namespace {

bool is_space(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

// Files have plus signs, which from_chars rejects.
std::string_view without_plus(std::string_view word) {
  const bool signed_twice = word.size() > 1 && (word[1] == '-' || word[1] == '+');
  return word.starts_with('+') && !signed_twice ? word.substr(1) : word;
}

}  // namespace

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

std::string in_quotes(std::string_view word) {
  return '"' + std::string(word.substr(0, 40)) + '"';
}

MeshText::MeshText(std::string_view text, Comments comments) : text_(text), comments_(comments == Comments::kHash) {
  if (text_.starts_with("\xEF\xBB\xBF")) at_ = begin_ = 3;
}

// Returns whether a word follows before the end of the line or, with `over_lines`, of the file.
bool MeshText::skip_spaces(bool over_lines) {
  for (; at_ < text_.size(); ++at_) {
    const char c = text_[at_];
    if (comments_ && c == '#') {
      at_ = std::min(text_.find('\n', at_), text_.size());
      if (!over_lines || at_ == text_.size()) return false;
    } else if (comments_ && c == '\\') {
      const std::string_view after = text_.substr(at_ + 1, 2);
      const std::size_t end = after.starts_with('\n') ? 1 : after == "\r\n" ? 2 : 0;
      if (end == 0) return true;
      at_ += end;
    } else if (!is_space(c)) {
      return true;
    } else if (c == '\n' && !over_lines) {
      return false;
    }
  }
  return false;
}

std::string_view MeshText::take() {
  begin_ = at_;
  while (at_ < text_.size() && !is_space(text_[at_]) && !(comments_ && text_[at_] == '#')) ++at_;
  return text_.substr(begin_, at_ - begin_);
}

std::string_view MeshText::word() {
  if (skip_spaces(true)) return take();
  begin_ = at_;
  return {};
}

std::string_view MeshText::word_in_line() {
  return skip_spaces(false) ? take() : std::string_view{};
}

void MeshText::skip_line() {
  while (skip_spaces(false)) take();
  at_ = std::min(text_.size(), at_ + 1);
}

double MeshText::number(std::string_view word, const char* what) const {
  if (word.empty()) fail(std::string("expected ") + what + " where the line or the file ends");
  const std::string_view digits = without_plus(word);
  double x = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (error == std::errc::invalid_argument || end != digits.data() + digits.size())
    fail(std::string("expected ") + what + ", got " + in_quotes(word));
  if (error == std::errc::result_out_of_range)
    x = std::strtod(std::string(digits).c_str(), nullptr);  // 0, or too large
  if (!std::isfinite(x)) fail(std::string("expected a finite ") + (what + 2) + ", got " + in_quotes(word));
  return x;
}

std::int64_t MeshText::integer(std::string_view word, const char* what) const {
  if (word.empty()) fail(std::string("expected ") + what + " where the line or the file ends");
  const std::string_view digits = without_plus(word);
  std::int64_t x = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (error != std::errc() || end != digits.data() + digits.size())
    fail(std::string("expected ") + what + ", got " + in_quotes(word));
  return x;
}

void MeshText::fail_at(std::size_t place, const std::string& what) const {
  const auto lines = std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(place), '\n');
  throw LoadError("line " + std::to_string(lines + 1) + ": " + what);
}

}  // namespace clearance
