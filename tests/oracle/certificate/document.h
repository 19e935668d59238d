// A certificate's text as values, read strictly: any deviation from docs/trust/certificate_format.md is rejected.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tests/oracle/certificate/dyadic.h"

namespace clearance::certificate_oracle {

/// Reason to reject a document, or a row of it.
class Rejection : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

inline void require(bool condition, const char* why) {
  if (!condition) throw Rejection(why);
}

/// A value of JSON, in the memory of its Document. Access as another type throws `Rejection`.
class Value {
 public:
  Value() : real_(0) {}  // JSON null
  explicit Value(bool x) : kind_(Kind::kTruth), exact_value_(x) {}
  explicit Value(std::int64_t x) : kind_(Kind::kInteger), integer_(x) {}
  explicit Value(double x) : kind_(Kind::kReal), real_(x) {}
  explicit Value(std::string_view text) : kind_(Kind::kText), size_(text.size()), text_(text.data()) {}
  explicit Value(std::span<const Value> list) : kind_(Kind::kList), size_(list.size()), items_(list.data()) {}
  /// An object: names, and as many values.
  Value(const std::string_view* names, std::span<const Value> values)
      : kind_(Kind::kObject), size_(values.size()), items_(values.data()), names_(names) {}

  bool is_null() const { return kind_ == Kind::kNull; }
  bool is_list() const { return kind_ == Kind::kList; }
  bool boolean() const;
  std::int64_t integer() const;
  std::string_view text() const;
  std::span<const Value> list() const;
  /// Of an object, in its order.
  std::span<const std::string_view> names() const;
  std::span<const Value> values() const;
  /// A float64, or "inf" or "-inf".
  double real() const;
  /// A finite float64.
  double finite() const;
  /// A finite float64 that is not negative.
  double length() const;
  /// An integer in [0, size).
  std::size_t index(std::size_t size) const;
  /// The value of that name in an object; find() returns null if there is none.
  const Value& operator[](std::string_view name) const;
  const Value* find(std::string_view name) const;
  /// The value at that place of a list.
  const Value& at(std::size_t place) const;
  /// A list of three numbers; in vector(), of three pairs that are added.
  std::array<double, 3> three() const;
  Vector vector() const;
  Dyadic high_and_low() const;
  Vector vector_of_sums() const;

 private:
  enum class Kind { kNull, kTruth, kInteger, kReal, kText, kList, kObject };

  Kind kind_ = Kind::kNull;
  std::size_t size_ = 0;  // of a text, a list or an object
  union {
    bool exact_value_;
    std::int64_t integer_;
    double real_;
    const char* text_;
    const Value* items_;
  };
  const std::string_view* names_ = nullptr;
};

/// A parsed text.
class Document {
 public:
  /// Throws `Rejection` for a text that is no JSON, has a name twice in one object, or is nested deeper than any
  /// certificate.
  explicit Document(std::string_view text);
  const Value& root() const { return root_; }

 private:
  std::pmr::monotonic_buffer_resource memory_;
  Value root_;
};

}  // namespace clearance::certificate_oracle
