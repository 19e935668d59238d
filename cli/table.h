// Rows of named columns, printed for people (aligned), for spreadsheets (CSV) or for programs (JSON).
#pragma once

#include <concepts>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

namespace clearance::cli {

enum class Output { kTable, kCsv, kJson };

/// One value: numbers stand right and unquoted, text left and quoted. Nothing: "-", an empty field, null.
struct Cell {
  Cell() = default;
  Cell(std::string t) : text(std::move(t)), kind(Kind::kText) {}
  Cell(const char* t) : text(t), kind(Kind::kText) {}
  Cell(bool b) : text(b ? "true" : "false"), kind(Kind::kBool) {}
  template <std::integral Number>
  Cell(Number number) : text(std::to_string(number)), kind(Kind::kNumber) {}
  /// `digits` significant ones for people; programs get all 17.
  Cell(double number, int digits = 9);
  /// The same, but nothing where it is infinite: JSON has no such number.
  static Cell finite(double number, int digits) { return number - number == 0 ? Cell(number, digits) : Cell(); }

  enum class Kind { kNone, kNumber, kBool, kText };
  std::string text;
  std::string exact;  ///< of a double: every digit; else empty
  Kind kind = Kind::kNone;
};

class Table {
 public:
  explicit Table(std::vector<std::string> columns) : columns_(std::move(columns)) {}
  /// As many cells as columns.
  void add(std::vector<Cell> row);
  std::size_t rows() const { return rows_.size(); }
  /// JSON: a list of objects, one for each row.
  void print(std::ostream& out, Output output) const;

 private:
  void print_aligned(std::ostream& out) const;
  void print_csv(std::ostream& out) const;
  void print_json(std::ostream& out) const;

  std::vector<std::string> columns_;
  std::vector<std::vector<Cell>> rows_;
};

/// `text` as a JSON string.
std::string json_string(const std::string& text);

}  // namespace clearance::cli
