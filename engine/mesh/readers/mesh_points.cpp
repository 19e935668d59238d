// Files of points: XYZ, PCD and NumPy's NPY, which has height fields, too.
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

static_assert(std::endian::native == std::endian::little);

void hand_on(std::vector<Vec3d> positions, const PartSink& sink) {
  if (positions.empty()) throw LoadError("it holds no points");
  MeshPart part;
  part.positions = std::move(positions);
  sink(std::move(part));
}

// One number of a binary row.
double number_at(const char* at, char type, std::size_t size) {
  const auto as = [&]<class T>(T) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return static_cast<double>(value);
  };
  return type == 'F' && size == 4 ? as(float{}) : as(double{});
}

// ---- NPY

// Returns the value of a key of the header, a Python dict, up to the next comma outside of parentheses.
std::string_view value_of(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(key);
  if (at == std::string_view::npos) throw LoadError("its header has no " + std::string(key));
  std::string_view rest = header.substr(at + key.size());
  rest.remove_prefix(std::min(rest.find_first_not_of(" :"), rest.size()));
  const std::size_t end = rest.starts_with('(') ? rest.find(')') : rest.find_first_of(",}");
  if (end == std::string_view::npos) throw LoadError("its header does not end");
  return rest.substr(0, end);
}

// Rows and columns of "(N, M".
// \param wanted names them in errors
std::array<std::uint64_t, 2> shape_of(std::string_view text, const std::string& wanted) {
  std::array<std::uint64_t, 2> shape{};
  std::size_t dimensions = 0;
  const auto fail = [&] {
    throw LoadError("its shape is " + std::string(text.substr(0, 60)) + "); expected " + wanted);
  };
  for (std::size_t i = 1; i < text.size();) {
    if (text[i] == ' ' || text[i] == ',') {
      ++i;
      continue;
    }
    std::uint64_t n = 0;
    const std::size_t begin = i;
    for (; i < text.size() && text[i] >= '0' && text[i] <= '9'; ++i) {
      n = 10 * n + static_cast<std::uint64_t>(text[i] - '0');
      if (n > std::uint64_t{1} << 32) throw LoadError("its shape has more than 2^32 rows or columns");
    }
    if (i == begin) throw LoadError("its shape is not a list of numbers: " + in_quotes(text));
    if (dimensions == 2) fail();
    shape[dimensions++] = n;
  }
  if (dimensions != 2) fail();
  return shape;
}

struct Array {
  std::array<std::uint64_t, 2> shape;
  std::size_t size;  // of a number, bytes
  bool by_columns;   // Fortran's order
  const char* data;
  double at(std::uint64_t row, std::uint64_t column) const {
    return number_at(data + (by_columns ? column * shape[0] + row : row * shape[1] + column) * size, 'F', size);
  }
};

constexpr const char* kPointRows = "rows of x, y and z, which up to 13 more columns may follow";
constexpr std::uint64_t kMostColumns = 16;

Array array_of(std::string_view content, const std::string& wanted) {
  if (content.size() < 12 || content.substr(0, 6) != std::string_view("\x93NUMPY", 6))
    throw LoadError("it does not begin as an NPY file");
  const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(content[i])); };
  const bool is_long = content[6] >= 2;
  const std::size_t begin = is_long ? 12 : 10;
  const std::size_t length = byte(8) | byte(9) << 8 | (is_long ? byte(10) << 16 | byte(11) << 24 : 0);
  if (length > content.size() - begin) throw LoadError("it ends within its header");
  const std::string_view header = content.substr(begin, length);
  const std::string_view type = value_of(header, "'descr'");
  if (type.starts_with("["))
    throw LoadError("its numbers have names (a structured array); expected a plain array of '<f4' or '<f8'");
  if (type != "'<f4'" && type != "'<f8'")
    throw LoadError("expected '<f4' or '<f8' numbers, got " + std::string(type.substr(0, 20)));
  const std::string_view order = value_of(header, "'fortran_order'");
  if (order != "False" && order != "True") throw LoadError("fortran_order: expected False or True");
  Array array{shape_of(value_of(header, "'shape'"), wanted), type == "'<f4'" ? std::size_t{4} : 8, order == "True",
              content.data() + begin + length};
  const std::uint64_t there = (content.size() - begin - length) / array.size;
  if (array.shape[1] == 0 || array.shape[0] > there / array.shape[1])
    throw LoadError("it ends before its " + std::to_string(array.shape[0]) + " x " + std::to_string(array.shape[1]) +
                    " numbers do");
  const std::uint64_t more = content.size() - begin - length - array.shape[0] * array.shape[1] * array.size;
  if (more != 0) throw LoadError(std::to_string(more) + " bytes follow its numbers: does it hold several arrays?");
  if (array.shape[0] * array.shape[1] > kMostPoints)
    throw LoadError("it has more than " + std::to_string(kMostPoints) + " numbers");
  return array;
}

// ---- PCD

struct Field {
  std::string name;
  std::size_t size = 4, count = 1;
  char type = 'F';
};

struct PcdHeader {
  std::vector<Field> fields;
  std::uint64_t points = 0;
  std::string data;
};

PcdHeader read_pcd_header(MeshText& text) {
  PcdHeader header;
  const auto each = [&](const char* what, const auto& take) {
    std::size_t i = 0;
    for (std::string_view word = text.word_in_line(); !word.empty(); word = text.word_in_line(), ++i) {
      if (i == header.fields.size()) text.fail(std::string(what) + ": more than there are fields");
      take(header.fields[i], word);
    }
    if (i != header.fields.size()) text.fail(std::string(what) + ": fewer than there are fields");
  };
  const auto count = [&](std::string_view word) {
    const std::int64_t n = text.integer(word, "a number");
    if (n < 1 || n > 4096) text.fail("expected 1 to 4096, got " + std::to_string(n));
    return static_cast<std::size_t>(n);
  };
  while (header.data.empty()) {
    const std::string key(text.word());
    if (key.empty()) throw LoadError("it ends within its header");
    if (key == "FIELDS") {
      header.fields.clear();
      for (auto word = text.word_in_line(); !word.empty(); word = text.word_in_line())
        header.fields.push_back({std::string(word)});
    } else if (key == "SIZE") {
      each("SIZE", [&](Field& field, std::string_view word) { field.size = count(word); });
    } else if (key == "TYPE") {
      each("TYPE", [&](Field& field, std::string_view word) { field.type = word[0]; });
    } else if (key == "COUNT") {
      each("COUNT", [&](Field& field, std::string_view word) { field.count = count(word); });
    } else if (key == "POINTS") {
      const std::int64_t n = text.integer(text.word_in_line(), "a number of points");
      if (n < 0) text.fail("expected a number of points, got " + std::to_string(n));
      header.points = static_cast<std::uint64_t>(n);
    } else if (key == "DATA") {
      header.data = text.word_in_line();
      if (header.data.empty()) text.fail("DATA: expected ascii or binary");
    }
    text.skip_line();
  }
  return header;
}

// Returns whether a word marks a pixel without a return: nan, -nan or inf.
bool is_no_return(std::string_view word) {
  const std::string number = lower(word.substr(word.starts_with('-') || word.starts_with('+')));
  return number.starts_with("nan") || number == "inf" || number == "infinity";
}

// Offsets of x, y and z in a row, and its length, in bytes or, for text, in words.
struct PcdRow {
  std::array<std::size_t, 3> place{}, size{};
  std::size_t length = 0;
};
PcdRow row_of(const PcdHeader& header, bool is_binary) {
  PcdRow row;
  std::array<bool, 3> found{};
  for (const Field& field : header.fields) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (field.name != std::string(1, "xyz"[k])) continue;
      if (field.type != 'F' || (field.size != 4 && field.size != 8) || field.count != 1)
        throw LoadError("the field " + field.name + ": expected one float of 4 or 8 bytes");
      row.place[k] = row.length;
      row.size[k] = field.size;
      found[k] = true;
    }
    row.length += is_binary ? field.size * field.count : field.count;
  }
  for (std::size_t k = 0; k < 3; ++k)
    if (!found[k]) throw LoadError(std::string("there is no field ") + "xyz"[k]);
  return row;
}

}  // namespace

void read_xyz(std::string_view content, const PartSink& sink) {
  MeshText text(content, MeshText::Comments::kHash);
  std::vector<Vec3d> positions;
  for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
    Vec3d p;
    for (int k = 0; k < 3; ++k, word = k < 3 ? text.word_in_line() : word) p[k] = text.number(word, "a coordinate");
    positions.push_back(p);
    text.skip_line();  // colours, normals
  }
  hand_on(std::move(positions), sink);
}

void read_npy(std::string_view content, const PartSink& sink) {
  const Array array = array_of(content, kPointRows);
  const auto [rows, columns] = array.shape;
  if (columns < 3 || columns > kMostColumns)
    throw LoadError("it has " + std::to_string(columns) + " columns; expected " + kPointRows +
                    (columns > kMostColumns ? "; a grid of heights is a height_field" : ""));
  std::vector<Vec3d> positions;
  for (std::uint64_t r = 0; r < rows; ++r) {
    positions.push_back({array.at(r, 0), array.at(r, 1), array.at(r, 2)});
    for (int k = 0; k < 3; ++k)
      if (!std::isfinite(positions.back()[k])) throw LoadError("row " + std::to_string(r) + " is not finite");
  }
  hand_on(std::move(positions), sink);
}

void read_npy_heights(std::string_view content, const PartSink& sink) {
  const Array array = array_of(content, "rows and columns of heights");
  std::vector<Vec3d> positions;
  for (std::uint64_t r = 0; r < array.shape[0]; ++r)
    for (std::uint64_t c = 0; c < array.shape[1]; ++c)  // NaN is a hole
      if (const double height = array.at(r, c); std::isfinite(height))
        positions.push_back({static_cast<double>(c), static_cast<double>(r), height});
  hand_on(std::move(positions), sink);
}

void read_pcd(std::string_view content, const PartSink& sink) {
  MeshText text(content, MeshText::Comments::kHash);
  const PcdHeader header = read_pcd_header(text);
  if (header.data != "ascii" && header.data != "binary")
    throw LoadError("DATA " + in_quotes(header.data) + ": expected ascii or binary; binary_compressed is not read");
  const bool is_binary = header.data == "binary";
  const PcdRow row = row_of(header, is_binary);
  std::vector<Vec3d> positions;
  const auto take = [&](const Vec3d& p) {  // a pixel without a return is NaN
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) positions.push_back(p);
  };
  if (is_binary) {
    const std::string_view rest = text.rest();
    if (header.points > rest.size() / row.length)
      throw LoadError("it ends before its " + std::to_string(header.points) + " points do");
    for (std::uint64_t i = 0; i < header.points; ++i) {
      const char* const at = rest.data() + i * row.length;
      Vec3d p;
      for (std::size_t k = 0; k < 3; ++k) p[static_cast<int>(k)] = number_at(at + row.place[k], 'F', row.size[k]);
      take(p);
    }
    return hand_on(std::move(positions), sink);
  }
  for (std::uint64_t i = 0; i < header.points; ++i) {
    Vec3d p;
    for (std::size_t w = 0; w < row.length; ++w) {
      const std::string_view word = w == 0 ? text.word() : text.word_in_line();
      if (word.empty()) text.fail("it ends before its " + std::to_string(header.points) + " points do");
      for (std::size_t k = 0; k < 3; ++k)
        if (row.place[k] == w)
          p[static_cast<int>(k)] =
              is_no_return(word) ? std::numeric_limits<double>::quiet_NaN() : text.number(word, "a coordinate");
    }
    take(p);
    text.skip_line();
  }
  hand_on(std::move(positions), sink);
}

}  // namespace clearance
