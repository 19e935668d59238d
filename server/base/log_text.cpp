#include "server/base/log_text.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace clearance {
namespace {

struct Character {
  std::size_t bytes;
  bool prints;
};

/// The UTF-8 character at `at` (Unicode 15, table 3-7). An invalid byte counts as one unprintable character.
Character character_at(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) -> unsigned {
    return at + i < text.size() ? static_cast<std::uint8_t>(text[at + i]) : 0;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return {1, first >= ' ' && first != 0x7F};
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4) return {1, false};
  std::uint32_t code = first & (0xFFu >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return {1, false};
    code = code << 6 | (byte(i) & 0x3F);
  }
  constexpr std::array<std::uint32_t, 5> kLeast{0, 0, 0x80, 0x800, 0x10000};
  if (code < kLeast[bytes] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return {1, false};
  // C1 controls, line and paragraph separators, and characters that change the direction of text.
  const bool orders = code < 0xA0 || (code >= 0x200B && code <= 0x200F) || (code >= 0x2028 && code <= 0x202E) ||
                      (code >= 0x2060 && code <= 0x206F) || code == 0xFEFF;
  return {bytes, !orders};
}

}  // namespace

std::string log_text(std::string_view text, bool quoted) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string escaped;
  escaped.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const auto [bytes, prints] = character_at(text, at);
    const std::string_view here = text.substr(at, bytes);
    at += bytes;
    if (quoted && (here == "\"" || here == "\\"))
      escaped.append("\\").append(here);
    else if (prints)
      escaped.append(here);
    else if (here == "\n")
      escaped += "\\n";
    else if (here == "\t")
      escaped += "\\t";
    else
      for (const char c : here) {
        escaped += "\\x";
        escaped += kDigits[static_cast<std::uint8_t>(c) >> 4];
        escaped += kDigits[static_cast<std::uint8_t>(c) & 15];
      }
  }
  return escaped;
}

}  // namespace clearance
