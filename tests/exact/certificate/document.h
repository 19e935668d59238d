// A certificate's text as values, read strictly: whatever is not as docs/certificates.md says is refused.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dyadic.h"

namespace clearance::judge {

/// Why a document, or a row of it, is not good.
class Refusal : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

inline void require(bool condition, const char* why) {
  if (!condition) throw Refusal(why);
}

/// A value of JSON. Whoever asks for what it is not gets a Refusal.
class Value {
 public:
  using List = std::vector<Value>;
  using Object = std::vector<std::pair<std::string, Value>>;

  Value();  // null
  explicit Value(bool x);
  explicit Value(std::int64_t x);
  explicit Value(double x);
  explicit Value(std::string text);
  static Value empty_list();
  static Value empty_object();
  Value(Value&&) noexcept;
  Value& operator=(Value&&) noexcept;
  ~Value();

  bool is_null() const { return kind_ == Kind::kNull; }
  bool is_list() const { return kind_ == Kind::kList; }
  bool truth() const;
  std::int64_t integer() const;
  const std::string& text() const;
  const List& list() const;
  const Object& object() const;
  /// A float64, or "inf" or "-inf".
  double real() const;
  /// A finite one.
  double finite() const;
  /// One that is finite and not negative.
  double length() const;
  /// An integer in [0, size).
  std::size_t index(std::size_t size) const;
  /// Of an object, the value of that name; find(): null where there is none.
  const Value& operator[](std::string_view name) const;
  const Value* find(std::string_view name) const;
  /// Of a list, the one at that place.
  const Value& at(std::size_t place) const;
  /// A list of three numbers; of three pairs that are added.
  std::array<double, 3> three() const;
  Vector vector() const;
  Dyadic high_and_low() const;
  Vector vector_of_sums() const;

  /// What the parser appends to.
  List& growing_list();
  Object& growing_object();

 private:
  enum class Kind { kNull, kTruth, kInteger, kReal, kText, kList, kObject };
  struct Compound;  // what is no single number: these are few

  Kind kind_ = Kind::kNull;
  union {
    bool truth_;
    std::int64_t integer_;
    double real_ = 0;
  };
  std::unique_ptr<Compound> compound_;
};

/// Throws Refusal of what is no JSON, has a name twice in one object, or is nested deeper than any certificate.
Value parse(std::string_view text);

}  // namespace clearance::judge
