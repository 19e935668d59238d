// Options of a query, in addition to its pairs and poses: one row of this table for each.
//
// A row defines the member of Query in C++ (client.h) and in Python's extension modules, the option's place on the
// wire, the accepted values and the error for others (query_frame.cpp), its translation from LCM where
// query_t has it by that name, a flag of `clearance query`, a keyword argument of Python's calls, and its
// row in docs/service/wire_queries.md, which a test compares. Only its use is written by hand: the daemon reads
// QueryParts::options, and the engine receives it if QueryView has a member of that name.
//
// The first rows travel in QueryHeader, which is final. A new option takes the next free tag, and travels in a record
// of that tag if it differs from its default. Rows keep the order of their introduction.
#pragma once

#include <clearance/types.h>

#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

// X(type, name, default, tag (0 in QueryHeader), legal values, unit, description)
// clang-format off
#define CLEARANCE_QUERY_OPTIONS(X)                                                                                     \
  X(double, max_distance, std::numeric_limits<double>::infinity(), 0, Legal::at_least(0, "a number of metres >= 0"),   \
    "m", "pairs proved farther are `beyond` and not refined")                                                          \
  X(double, abs_tol, 0, 0, Legal::finite(0, "a finite number of metres >= 0"),                                         \
    "m", "wanted: upper - lower <= max(abs_tol, rel_tol * distance)")                                                  \
  X(double, rel_tol, -1, 0, Legal::finite(std::numeric_limits<double>::lowest(), "finite"),                            \
    "1", "negative: 1e-6 (f64), 1e-4 (f32)")                                                                           \
  X(Precision, precision, Precision::kF64, 0, Legal::word("f64 f32"),                                                  \
    "", "arithmetic of the iterations; the bounds hold in both")                                                       \
  X(bool, signed_distance, false, 0, Legal::word("false true"),                                                        \
    "", "also how deep bodies overlap")                                                                                \
  X(Reduce, reduce, Reduce::kNone, 0, Legal::word("none within nearest min any"),                                      \
    "", "which rows come back")                                                                                        \
  X(std::uint32_t, fields, kDefaultFields, 0, Legal::bits(kKnownFields),                                               \
    "", "columns that come back")                                                                                      \
  X(std::uint64_t, max_results, 1u << 20, 0, Legal::anything(),                                                        \
    "rows", "most rows of reduce `within`")                                                                            \
  X(std::int64_t, max_pose_age_ns, 0, 0, Legal::at_least(0, ">= 0"),                                                   \
    "ns", "pairs with an older pose have the status `stale_pose`, and no distance; 0 for any age")                        \
  X(std::int64_t, min_pose_stamp_ns, 0, 0, Legal::at_least(0, ">= 0"),                                                 \
    "ns", "begin once the poses of wait_for have this stamp or a newer one (publisher's clock); 0 to begin at once")   \
  X(std::uint32_t, wait_for, kEveryBody, 0, Legal::anything(),                                                         \
    "", "body, or selector of a group; unstamped bodies are ignored, but at least one must have a stamp")              \
  X(std::int64_t, deadline_ns, 0, 0, Legal::range(0, 3'600'000'000'000),                                               \
    "ns", "maximum time from receipt to answer (daemon's clock), a wait for poses included; 0 for no limit")           \
  X(double, margin, 0, 5, Legal::finite(0, "a finite number of metres >= 0"),                                          \
    "m", "reduce `any`, and motions: distance that every pair must provably exceed")                                   \
  X(std::uint32_t, max_evaluations, 0, 10, Legal::range(0, 65536),                                                     \
    "", "maximum evaluations per motion; if nonzero, configurations are the control points of motions")                \
  X(std::uint32_t, control_points, 2, 12, Legal::range(2, 8),                                                          \
    "", "control points per motion: 2 for a straight one, more for Bezier curves of joints and positions")               \
  X(std::uint32_t, k, 0, 17, Legal::range(0, 65536),                                                                   \
    "", "reduce `nearest`: rows of the k nearest pairs of a configuration; 0 for the nearest of each body")
// clang-format on

namespace clearance {

/// Legal values of an option.
struct Legal {
  enum class Kind : std::uint8_t { kAnything, kRange, kWord, kBits };
  Kind kind = Kind::kAnything;
  double least = 0, most = 0;  ///< of kRange; `most` of kWord is its last word
  std::uint64_t mask = 0;      ///< of kBits
  const char* text = nullptr;  ///< description of kRange, by default "LEAST to MOST"; the words of kWord, from 0 on

  static constexpr Legal anything() { return {}; }
  static constexpr Legal range(double least, double most, const char* text = nullptr) {
    return {Kind::kRange, least, most, 0, text};
  }
  static constexpr Legal at_least(double least, const char* text) {
    return range(least, std::numeric_limits<double>::infinity(), text);
  }
  static constexpr Legal finite(double least, const char* text) {
    return range(least, std::numeric_limits<double>::max(), text);
  }
  static constexpr Legal word(const char* words) {
    double last = 0;
    for (const char* c = words; *c; ++c) last += *c == ' ';
    return {Kind::kWord, 0, last, 0, words};
  }
  static constexpr Legal bits(std::uint64_t mask) { return {Kind::kBits, 0, 0, mask, nullptr}; }
};

#define CLEARANCE_OPTION_MEMBER(type, name, value, ...) type name = value;
/// The options of one query.
struct QueryOptions {
  CLEARANCE_QUERY_OPTIONS(CLEARANCE_OPTION_MEMBER)
};

inline constexpr QueryOptions kDefaultOptions;
/// Longest wait for poses, in ns, also of a query without a deadline.
inline constexpr std::int64_t kLongestPoseWait = 10'000'000'000;

/// A row of the table, without type and default.
struct QueryOption {
  const char* name;
  std::uint16_t tag;
  Legal legal;
  const char *unit, *text;
};

/// Calls f(row, member) for each row; member(x) is the option in any x with such a member.
template <class F>
constexpr void for_each_query_option(F f) {
#define CLEARANCE_OPTION_VISIT(type, name, value, tag, legal, unit, text) \
  f(QueryOption{#name, tag, legal, unit, text}, [](auto& x) -> decltype((x.name)) { return x.name; });
  CLEARANCE_QUERY_OPTIONS(CLEARANCE_OPTION_VISIT)
#undef CLEARANCE_OPTION_VISIT
}

/// Copies the options common to both, by name.
template <class From, class To>
void copy_options(const From& from, To& to) {
  for_each_query_option([&](const QueryOption&, auto member) {
    if constexpr (requires { member(from), member(to); })
      member(to) = static_cast<std::remove_reference_t<decltype(member(to))>>(member(from));
  });
}

/// Type of an option of type T in a record.
template <class T>
using OptionOnWire = std::conditional_t<std::is_enum_v<T> || std::is_same_v<T, bool>, std::uint8_t, T>;

}  // namespace clearance
