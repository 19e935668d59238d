// Rows of named columns, printed as an aligned table, CSV or JSON.
#pragma once

#include <concepts>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

namespace clearance::cli {

enum class Output { kTable, kCsv, kJson };

/// A value. Numbers are right-aligned and unquoted, text is left-aligned and quoted; an empty cell prints "-", an empty
/// field or null.
struct Cell {
  Cell() = default;
  Cell(std::string t) : text(std::move(t)), kind(Kind::kText) {}
  Cell(const char* t) : text(t), kind(Kind::kText) {}
  Cell(bool b) : text(b ? "true" : "false"), kind(Kind::kBool) {}
  template <std::integral Number>
  Cell(Number number) : text(std::to_string(number)), kind(Kind::kNumber) {}
  /// Prints `digits` significant digits in tables, and all 17 in CSV and JSON.
  Cell(double number, int digits = 9);
  /// The same, but an empty cell for an infinite number, which JSON lacks.
  static Cell finite(double number, int digits) { return number - number == 0 ? Cell(number, digits) : Cell(); }

  enum class Kind { kNone, kNumber, kBool, kText };
  std::string text;
  std::string exact;  ///< every digit of a double, else empty
  Kind kind = Kind::kNone;
};

class Table {
 public:
  explicit Table(std::vector<std::string> columns) : columns_(std::move(columns)) {}
  /// Adds a row of as many cells as columns.
  void add(std::vector<Cell> row);
  std::size_t rows() const { return rows_.size(); }
  /// Prints JSON as a list of objects, one per row.
  void print(std::ostream& out, Output output) const;

 private:
  void print_aligned(std::ostream& out) const;
  void print_csv(std::ostream& out) const;
  void print_json(std::ostream& out) const;

  std::vector<std::string> columns_;
  std::vector<std::vector<Cell>> rows_;
};

/// Returns `text` as a JSON string.
std::string json_string(const std::string& text);

}  // namespace clearance::cli
