// Error texts for names that a scene does not have.
#pragma once

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace clearance {

/// Edit distance: letters to insert, delete, replace or swap with the next to convert one word into the other.
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    before.swap(last);
    last.swap(row);
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      row[j + 1] = std::min({row[j] + 1, last[j + 1] + 1, last[j] + (a[i] != b[j])});
      if (i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j]) row[j + 1] = std::min(row[j + 1], before[j - 1] + 1);
    }
  }
  return row.back();
}

/// The names of `named`, behind those of `others`.
template <class Named>
std::vector<std::string_view> all_names(const std::vector<Named>& named, std::vector<std::string_view> others = {}) {
  for (const Named& one : named) others.push_back(one.name);
  return others;
}

/// Returns "; did you mean \"link1\", \"link2\"?" for similar names, otherwise an empty string.
inline std::string did_you_mean(std::string_view name, const std::vector<std::string_view>& known) {
  constexpr std::size_t kMostLetters = 64, kMostNames = 3;
  if (name.size() > kMostLetters) return "";
  const std::size_t most = std::min(std::max<std::size_t>(2, name.size() / 3) + 1, name.size());
  std::vector<std::pair<std::size_t, std::string_view>> near;
  for (const std::string_view other : known) {
    if (other.size() >= name.size() + most) continue;
    if (const std::size_t edits = edit_distance(name, other); edits < most) near.emplace_back(edits, other);
  }
  std::stable_sort(near.begin(), near.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text;
  for (std::size_t i = 0; i < std::min(near.size(), kMostNames); ++i)
    text += (i ? ", \"" : "; did you mean \"") + std::string(near[i].second) + "\"";
  return near.empty() ? text : text + "?";
}

/// Throws an error such as "no body \"lnk1\" in the scene; did you mean \"link1\"?"
template <class Named>
[[noreturn]] void unknown_name(const char* what, std::string_view name, const std::vector<Named>& known) {
  throw std::invalid_argument(std::string("no ") + what + " \"" + std::string(name) + "\" in the scene" +
                              did_you_mean(name, all_names(known)));
}

}  // namespace clearance
