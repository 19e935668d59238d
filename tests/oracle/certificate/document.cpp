#include "tests/oracle/certificate/document.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

namespace clearance::certificate_oracle {

namespace {

constexpr std::size_t kDeepest = 32;

// Builds values from the parser's events. The contents of a list or object wait on a stack until it ends.
class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit Builder(std::pmr::memory_resource& memory) : memory_(memory) {}
  const Value& root() const { return waiting_.back(); }

  bool null() override { return put(Value()); }
  bool boolean(bool x) override { return put(Value(x)); }
  bool number_integer(number_integer_t x) override { return put(Value(std::int64_t{x})); }
  bool number_unsigned(number_unsigned_t x) override {
    constexpr auto kMost = static_cast<number_unsigned_t>(std::numeric_limits<std::int64_t>::max());
    return x <= kMost ? put(Value(static_cast<std::int64_t>(x))) : put(Value(static_cast<double>(x)));
  }
  bool number_float(number_float_t x, const string_t&) override { return put(Value(x)); }
  bool string(string_t& x) override { return put(Value(kept(x))); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(); }
  bool start_array(std::size_t) override { return open(); }
  bool key(string_t& name) override {
    names_.push_back(kept(name));
    return true;
  }
  bool end_array() override {
    const Open begin = close();
    const std::span<const Value> values = kept<Value>(waiting_, begin.values);
    return put(Value(values));
  }
  bool end_object() override {
    const Open begin = close();
    const std::span<const std::string_view> names = kept<std::string_view>(names_, begin.names);
    sorted_.assign(names.begin(), names.end());
    std::sort(sorted_.begin(), sorted_.end());
    require(std::adjacent_find(sorted_.begin(), sorted_.end()) == sorted_.end(), "a name stands twice in one object");
    const std::span<const Value> values = kept<Value>(waiting_, begin.values);
    return put(Value(names.data(), values));
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception& error) override {
    throw Rejection(error.what());
  }

 private:
  struct Open {
    std::size_t values, names;  // sizes of the stacks when it began
  };

  bool put(Value value) {
    waiting_.push_back(value);
    return true;
  }
  bool open() {
    require(open_.size() < kDeepest, "nested too deep");
    open_.push_back({waiting_.size(), names_.size()});
    return true;
  }
  Open close() {
    const Open begin = open_.back();
    open_.pop_back();
    return begin;
  }
  std::string_view kept(const std::string& text) {
    char* place = static_cast<char*>(memory_.allocate(text.size() + 1, 1));
    std::copy(text.begin(), text.end(), place);
    return {place, text.size()};
  }
  // Takes all from `begin` on off a stack.
  template <class T>
  std::span<const T> kept(std::vector<T>& stack, std::size_t begin) {
    const std::size_t size = stack.size() - begin;
    if (size == 0) return {};
    T* place = static_cast<T*>(memory_.allocate(size * sizeof(T), alignof(T)));
    std::uninitialized_copy(stack.begin() + static_cast<std::ptrdiff_t>(begin), stack.end(), place);
    stack.resize(begin);
    return {place, size};
  }

  std::pmr::memory_resource& memory_;
  std::vector<Value> waiting_;
  std::vector<std::string_view> names_, sorted_;
  std::vector<Open> open_;  // lists and objects that have not ended, each in the one before it
};

}  // namespace

bool Value::boolean() const {
  require(kind_ == Kind::kTruth, "expected true or false");
  return exact_value_;
}

std::int64_t Value::integer() const {
  require(kind_ == Kind::kInteger, "expected an integer");
  return integer_;
}

std::string_view Value::text() const {
  require(kind_ == Kind::kText, "expected a text");
  return {text_, size_};
}

std::span<const Value> Value::list() const {
  require(kind_ == Kind::kList, "expected a list");
  return {items_, size_};
}

std::span<const std::string_view> Value::names() const {
  require(kind_ == Kind::kObject, "expected an object");
  return {names_, size_};
}

std::span<const Value> Value::values() const {
  require(kind_ == Kind::kObject, "expected an object");
  return {items_, size_};
}

double Value::real() const {
  if (kind_ == Kind::kReal) return real_;
  if (kind_ == Kind::kInteger) return static_cast<double>(integer_);
  require(kind_ == Kind::kText && (text() == "inf" || text() == "-inf"), "expected a number");
  constexpr double kInf = std::numeric_limits<double>::infinity();
  return text() == "inf" ? kInf : -kInf;
}

double Value::finite() const {
  const double x = real();
  require(std::isfinite(x), "expected a finite number");
  return x;
}

double Value::length() const {
  const double x = finite();
  require(x >= 0, "a length is negative");
  return x;
}

std::size_t Value::index(std::size_t size) const {
  const std::int64_t x = integer();
  require(x >= 0 && static_cast<std::size_t>(x) < size, "a place is none of a list's");
  return static_cast<std::size_t>(x);
}

const Value* Value::find(std::string_view name) const {
  const std::span<const std::string_view> all = names();
  const auto found = std::find(all.begin(), all.end(), name);
  return found == all.end() ? nullptr : &items_[found - all.begin()];
}

const Value& Value::operator[](std::string_view name) const {
  if (const Value* found = find(name)) return *found;
  throw Rejection("there is no '" + std::string(name) + "'");
}

const Value& Value::at(std::size_t place) const {
  require(place < list().size(), "a list is too short");
  return list()[place];
}

std::array<double, 3> Value::three() const {
  require(list().size() == 3, "expected three numbers");
  return {at(0).finite(), at(1).finite(), at(2).finite()};
}

Vector Value::vector() const {
  const std::array<double, 3> v = three();
  return {v[0], v[1], v[2]};
}

Dyadic Value::high_and_low() const {
  require(list().size() == 2, "expected two numbers that are added");
  return Dyadic(at(0).finite()) + at(1).finite();
}

Vector Value::vector_of_sums() const {
  require(list().size() == 3, "expected three pairs of numbers");
  return {at(0).high_and_low(), at(1).high_and_low(), at(2).high_and_low()};
}

Document::Document(std::string_view text) : memory_(text.size() + 1024) {
  Builder builder(memory_);
  require(nlohmann::json::sax_parse(text, &builder), "no JSON");
  root_ = builder.root();
}

}  // namespace clearance::certificate_oracle
