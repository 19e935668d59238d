#include "cli/table.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <ostream>

namespace clearance::cli {
namespace {

std::string csv_field(const Cell& cell) {
  if (cell.kind == Cell::Kind::kNone) return "";
  const std::string& text = cell.exact.empty() ? cell.text : cell.exact;
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string json_value(const Cell& cell) {
  switch (cell.kind) {
    case Cell::Kind::kNone:
      return "null";
    case Cell::Kind::kBool:
      return cell.text;
    case Cell::Kind::kText:
      return json_string(cell.text);
    case Cell::Kind::kNumber:
      break;
  }
  const std::string& text = cell.exact.empty() ? cell.text : cell.exact;
  // JSON has neither NaN nor infinity.
  if (text.find_first_of("ni") != std::string::npos)
    return text.find("inf") == std::string::npos ? "null" : json_string(text);
  return text;
}

/// Returns the width of UTF-8 text in a terminal, one column per character.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

Cell::Cell(double number, int digits) : kind(Kind::kNumber) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.*g", digits, number);
  text = buffer;
  std::snprintf(buffer, sizeof buffer, "%.17g", number);
  exact = buffer;
}

void Table::add(std::vector<Cell> row) {
  assert(row.size() == columns_.size());
  rows_.push_back(std::move(row));
}

void Table::print(std::ostream& out, Output output) const {
  switch (output) {
    case Output::kTable:
      return print_aligned(out);
    case Output::kCsv:
      return print_csv(out);
    case Output::kJson:
      return print_json(out);
  }
}

void Table::print_aligned(std::ostream& out) const {
  std::vector<std::size_t> width(columns_.size());
  std::vector<bool> right(columns_.size(), false);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    width[c] = width_of(columns_[c]);
    for (const auto& row : rows_) {
      width[c] = std::max({width[c], width_of(row[c].text), std::size_t{1}});
      right[c] = right[c] || row[c].kind == Cell::Kind::kNumber;
    }
  }
  const auto line = [&](const auto& text_of) {
    std::string text;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const std::string cell = text_of(c);
      const std::string pad(width[c] - std::min(width[c], width_of(cell)), ' ');
      text += (c ? "  " : "") + (right[c] ? pad + cell : cell + pad);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    out << text << '\n';
  };
  line([&](std::size_t c) { return columns_[c]; });
  for (const auto& row : rows_)
    line([&](std::size_t c) { return row[c].kind == Cell::Kind::kNone ? std::string("-") : row[c].text; });
}

void Table::print_csv(std::ostream& out) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) out << (c ? "," : "") << csv_field(columns_[c]);
  out << '\n';
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) out << (c ? "," : "") << csv_field(row[c]);
    out << '\n';
  }
}

void Table::print_json(std::ostream& out) const {
  out << "[";
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    out << (r ? ",\n " : "") << "{";
    for (std::size_t c = 0; c < columns_.size(); ++c)
      out << (c ? ", " : "") << json_string(columns_[c]) << ": " << json_value(rows_[r][c]);
    out << "}";
  }
  out << "]\n";
}

std::string json_string(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04x", c);
      quoted += escape;
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace clearance::cli
