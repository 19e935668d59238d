// Error texts for names that a scene does not have.
#pragma once

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace clearance {

/// Edit distance: letters to insert, delete or replace to convert one word into the other.
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, replaced});
    }
  }
  return row.back();
}

/// Returns a text such as "no body \"lnk1\" in the scene; did you mean \"link1\"?"
template <class Named>
[[noreturn]] void unknown_name(const char* what, std::string_view name, const std::vector<Named>& known) {
  std::vector<std::pair<std::size_t, std::string_view>> near;
  for (const Named& other : known) {
    const std::size_t distance = edit_distance(name, other.name);
    if (distance <= std::max<std::size_t>(2, name.size() / 3)) near.emplace_back(distance, other.name);
  }
  std::stable_sort(near.begin(), near.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text = std::string("no ") + what + " \"" + std::string(name) + "\" in the scene";
  for (std::size_t i = 0; i < std::min<std::size_t>(near.size(), 3); ++i)
    text += (i ? ", \"" : "; did you mean \"") + std::string(near[i].second) + "\"";
  throw std::invalid_argument(near.empty() ? text : text + "?");
}

}  // namespace clearance
