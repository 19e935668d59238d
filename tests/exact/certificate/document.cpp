#include "document.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace clearance::judge {

struct Value::Compound {
  std::string text;
  List list;
  Object object;
};

namespace {

constexpr std::size_t kDeepest = 32;

// Builds values from the parser's events.
class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  Value take() { return std::move(root_); }

  bool null() override { return put(Value()); }
  bool boolean(bool x) override { return put(Value(x)); }
  bool number_integer(number_integer_t x) override { return put(Value(std::int64_t{x})); }
  bool number_unsigned(number_unsigned_t x) override {
    constexpr auto kMost = static_cast<number_unsigned_t>(std::numeric_limits<std::int64_t>::max());
    return x <= kMost ? put(Value(static_cast<std::int64_t>(x))) : put(Value(static_cast<double>(x)));
  }
  bool number_float(number_float_t x, const string_t&) override { return put(Value(x)); }
  bool string(string_t& x) override { return put(Value(std::move(x))); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(Value::empty_object()); }
  bool start_array(std::size_t) override { return open(Value::empty_list()); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    open_.back().growing_object().emplace_back(std::move(name), Value());
    return true;
  }
  bool end_object() override {
    std::vector<std::string_view> names;
    for (const auto& [name, value] : open_.back().growing_object()) names.push_back(name);
    std::sort(names.begin(), names.end());
    require(std::adjacent_find(names.begin(), names.end()) == names.end(), "a name stands twice in one object");
    return close();
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception& error) override {
    throw Refusal(error.what());
  }

 private:
  bool put(Value value) {
    if (open_.empty())
      root_ = std::move(value);
    else if (open_.back().is_list())
      open_.back().growing_list().push_back(std::move(value));
    else
      open_.back().growing_object().back().second = std::move(value);
    return true;
  }
  bool open(Value value) {
    require(open_.size() < kDeepest, "nested too deep");
    open_.push_back(std::move(value));
    return true;
  }
  bool close() {
    Value done = std::move(open_.back());
    open_.pop_back();
    return put(std::move(done));
  }

  Value root_;
  std::vector<Value> open_;  // lists and objects that have not ended, each in the one before it
};

}  // namespace

Value::Value() = default;
Value::Value(bool x) : kind_(Kind::kTruth), truth_(x) {}
Value::Value(std::int64_t x) : kind_(Kind::kInteger), integer_(x) {}
Value::Value(double x) : kind_(Kind::kReal), real_(x) {}
Value::Value(std::string text) : kind_(Kind::kText), compound_(new Compound{std::move(text), {}, {}}) {}
Value::Value(Value&&) noexcept = default;
Value& Value::operator=(Value&&) noexcept = default;
Value::~Value() = default;

Value Value::empty_list() {
  Value value{std::string()};
  value.kind_ = Kind::kList;
  return value;
}

Value Value::empty_object() {
  Value value{std::string()};
  value.kind_ = Kind::kObject;
  return value;
}

Value::List& Value::growing_list() { return compound_->list; }
Value::Object& Value::growing_object() { return compound_->object; }

bool Value::truth() const {
  require(kind_ == Kind::kTruth, "expected true or false");
  return truth_;
}

std::int64_t Value::integer() const {
  require(kind_ == Kind::kInteger, "expected an integer");
  return integer_;
}

const std::string& Value::text() const {
  require(kind_ == Kind::kText, "expected a text");
  return compound_->text;
}

const Value::List& Value::list() const {
  require(kind_ == Kind::kList, "expected a list");
  return compound_->list;
}

const Value::Object& Value::object() const {
  require(kind_ == Kind::kObject, "expected an object");
  return compound_->object;
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
  for (const auto& [key, value] : object())
    if (key == name) return &value;
  return nullptr;
}

const Value& Value::operator[](std::string_view name) const {
  if (const Value* found = find(name)) return *found;
  throw Refusal("there is no '" + std::string(name) + "'");
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

Value parse(std::string_view text) {
  Builder builder;
  require(nlohmann::json::sax_parse(text, &builder), "no JSON");
  return builder.take();
}

}  // namespace clearance::judge
