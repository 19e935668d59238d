// clearance query: sends a query and prints the rows.
#include <algorithm>
#include <iostream>
#include <limits>
#include <memory>
#include <sstream>
#include <type_traits>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

const std::map<std::string, std::uint32_t> kFieldNames{
    {"distance", kFieldDistance}, {"lower", kFieldLower},    {"upper", kFieldUpper},   {"status", kFieldStatus},
    {"flags", kFieldFlags},       {"points", kFieldPoints},  {"normal", kFieldNormal}, {"pieces", kFieldPieces},
    {"gradient", kFieldGradient}, {"verdict", kFieldVerdict}};
const std::map<std::string, Reduce> kReduceNames{{"none", Reduce::kNone},
                                                 {"within", Reduce::kWithin},
                                                 {"nearest", Reduce::kNearest},
                                                 {"min", Reduce::kMin},
                                                 {"any", Reduce::kAny}};

template <class Value>
std::vector<std::string> names_of(const std::map<std::string, Value>& words) {
  std::vector<std::string> names;
  for (const auto& [name, value] : words) names.push_back(name);
  return names;
}

/// "--max-reply-bytes"
std::string flag_of(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

/// Makes an option take words in place of numbers from 0 on, as in `f64 f32`.
void take_words(CLI::Option& option, const std::string& words) {
  std::vector<std::pair<std::string, int>> numbers;
  std::istringstream in(words);
  for (std::string word; in >> word;) numbers.emplace_back(word, static_cast<int>(numbers.size()));
  option.transform(quiet(CLI::CheckedTransformer(numbers)))->type_name("WORD");
}

struct QueryCommandOptions {
  Connection connection;
  Output output = Output::kTable;
  std::vector<std::string> pairs;
  std::vector<std::string> fields;
  std::string reduce = "none", precision = "f64";
  Query query;
  double max_pose_age_s = 0;
  std::size_t limit = 50;
};

std::uint32_t parse_fields(const std::vector<std::string>& names) {
  std::uint32_t fields = names.empty() ? kDefaultFields | kFieldFlags : 0;
  for (const std::string& name : names) fields |= kFieldNames.at(name);
  return fields | kFieldPair;
}

const char* status_name(Status status) {
  constexpr const char* kNames[] = {"ok",       "overlap", "contact",      "beyond",    "unconverged",
                                    "bad_pose", "no_pose", "unknown_body", "stale_pose"};
  return static_cast<std::size_t>(status) < std::size(kNames) ? kNames[static_cast<std::size_t>(status)] : "?";
}

std::string flag_names(std::uint16_t flags) {
  constexpr const char* kNames[] = {"renormalised", "rounding_limited",    "nonsmooth",     "pieces",
                                    "incomplete",   "uncertainty_limited", "beyond_limits", "half_turn"};
  static_assert(kFlagHalfTurn == 1 << std::size(kNames), "a flag has no name");
  std::string text;
  for (std::size_t i = 0; i < std::size(kNames); ++i)
    if (flags >> (i + 1) & 1) text += (text.empty() ? "" : "|") + std::string(kNames[i]);
  return text;
}

/// Adds the columns of a field of `width` numbers a row, if the reply has it.
template <class T>
struct NumberColumns {
  std::span<const T> values;
  std::vector<std::string> names;
};

void print_reply(const Result& reply, const SceneInfo& scene, const QueryCommandOptions& o) {
  std::vector<NumberColumns<double>> doubles;
  const auto add_doubles = [&doubles](std::span<const double> values, std::vector<std::string> names) {
    if (!values.empty()) doubles.push_back({values, std::move(names)});
  };
  add_doubles(reply.distance(), {"distance_m"});
  add_doubles(reply.lower(), {"lower_m"});
  add_doubles(reply.upper(), {"upper_m"});
  add_doubles(reply.point_a(), {"ax", "ay", "az"});
  add_doubles(reply.point_b(), {"bx", "by", "bz"});
  add_doubles(reply.normal(), {"nx", "ny", "nz"});
  add_doubles(reply.gradient(),
              {"ga_rx", "ga_ry", "ga_rz", "ga_x", "ga_y", "ga_z", "gb_rx", "gb_ry", "gb_rz", "gb_x", "gb_y", "gb_z"});

  // One row per body, whichever side of the pair it is on.
  const bool row_is_body = o.reduce == "nearest";
  std::vector<std::string> columns{"a", "b"};
  if (row_is_body) columns.insert(columns.begin(), "body");
  if (!reply.status().empty()) columns.push_back("status");
  if (!reply.verdict().empty()) columns.push_back("verdict");
  for (const auto& d : doubles) columns.insert(columns.end(), d.names.begin(), d.names.end());
  if (!reply.pieces().empty()) columns.insert(columns.end(), {"piece_a", "piece_b"});
  if (!reply.flags().empty()) columns.push_back("flags");

  Table table(columns);
  const std::size_t rows = o.output == Output::kTable && o.limit ? std::min(o.limit, reply.rows()) : reply.rows();
  const auto cell_of_body = [&scene](std::uint32_t id) {
    return id < scene.bodies.size() ? Cell(scene.bodies[id].name) : Cell();
  };
  for (std::size_t r = 0; r < rows; ++r) {
    std::vector<Cell> row{cell_of_body(reply.pair()[r][0]), cell_of_body(reply.pair()[r][1])};
    if (row_is_body) row.insert(row.begin(), cell_of_body(static_cast<std::uint32_t>(r)));
    if (!reply.status().empty()) row.push_back(status_name(reply.status()[r]));
    if (!reply.verdict().empty()) row.push_back(status_name(reply.verdict()[r]));
    for (const auto& d : doubles)
      for (std::size_t c = 0; c < d.names.size(); ++c) row.push_back(Cell(d.values[r * d.names.size() + c]));
    if (!reply.pieces().empty())
      for (int c = 0; c < 2; ++c)
        row.push_back(reply.pieces()[2 * r + c] == kNone ? Cell() : Cell(reply.pieces()[2 * r + c]));
    if (!reply.flags().empty()) row.push_back(reply.flags()[r] ? Cell(flag_names(reply.flags()[r])) : Cell());
    table.add(std::move(row));
  }
  table.print(std::cout, o.output);
  if (o.output != Output::kTable) return;
  if (rows < reply.rows()) std::printf("... and %zu rows more (--limit 0 prints them all)\n", reply.rows() - rows);
  if (reply.total() > reply.rows())
    std::printf("%llu pairs are within that distance; raise --max-results to get more of them\n",
                static_cast<unsigned long long>(reply.total()));
  std::printf("%zu rows of %llu pairs, pose revision %llu, backend %s, server %.3f ms\n", reply.rows(),
              static_cast<unsigned long long>(reply.pairs()),
              static_cast<unsigned long long>(reply.snapshot_revision()), std::string(reply.backend()).c_str(),
              1e-6 * static_cast<double>(reply.server_ns()));
}

void run(const QueryCommandOptions& o) {
  Client client = o.connection.open();
  const SceneInfo scene = client.scene();
  const std::vector<IdPair> pairs = pairs_of(client, o.pairs);
  Query query = o.query;
  query.pairs = pairs;
  query.fields = parse_fields(o.fields);
  query.reduce = kReduceNames.at(o.reduce);
  query.precision = kPrecisionNames.at(o.precision);
  query.max_pose_age_ns = static_cast<std::int64_t>(1e9 * o.max_pose_age_s);
  print_reply(client.distances(query), scene, o);
}

}  // namespace

void add_query(CLI::App& app) {
  auto& command = *app.add_subcommand("query", "distances between bodies, with certified bounds");
  auto options = std::make_shared<QueryCommandOptions>();
  Query& q = options->query;
  add_pairs_option(command, options->pairs);
  command.add_option("--max-distance", q.max_distance, "pairs proved farther than this many metres are \"beyond\"")
      ->check(at_least_zero())
      ->type_name("M");
  command
      .add_option("--reduce", options->reduce,
                  "none: every pair; within: those within --max-distance;\nnearest: each body's nearest; min: the "
                  "nearest of all;\nany: whether all are farther than --margin, or one that is not")
      ->check(quiet(CLI::IsMember(names_of(kReduceNames))))
      ->type_name("WORD");
  command.add_flag("--signed-distance", q.signed_distance, "also how deep bodies overlap");
  command
      .add_option("--fields", options->fields,
                  "distance lower upper status flags points normal pieces gradient; verdict (any)")
      ->check(quiet(CLI::IsMember(names_of(kFieldNames))))
      ->delimiter(',')
      ->type_name("NAME,...");
  command.add_option("--abs-tol", q.abs_tol, "wanted width of the bounds, metres")
      ->check(at_least_zero())
      ->type_name("M");
  command.add_option("--rel-tol", q.rel_tol, "wanted width of the bounds relative to the distance (1e-6; f32: 1e-4)")
      ->check(at_least_zero())
      ->type_name("R");
  command
      .add_option("--precision", options->precision, "arithmetic of the iterations: f64, f32; the bounds hold in both")
      ->check(quiet(CLI::IsMember(names_of(kPrecisionNames))))
      ->type_name("WORD");
  command.add_option("--max-results", q.max_results, "maximum rows of --reduce within")
      ->type_name("N")
      ->capture_default_str();
  command
      .add_option("--max-pose-age", options->max_pose_age_s,
                  "pairs with an older pose have the status stale_pose, and no distance; 0 for any age")
      ->check(quiet(CLI::Range(0.0, 1e9)))
      ->type_name("S");
  for_each_query_option([&](const QueryOption& option, auto member) {  // those that came after the ones above
    for (const std::string_view of_motions : {"max_evaluations", "control_points"})
      if (option.name == of_motions) return;  // `clearance path`
    if (!option.tag && option.name != std::string_view("deadline_ns")) return;
    CLI::Option& added = *command.add_option(flag_of(option.name), member(q), option.text)->type_name(option.unit);
    if constexpr (std::is_enum_v<std::remove_reference_t<decltype(member(q))>>) take_words(added, option.legal.text);
  });
  command.add_option("--limit", options->limit, "rows to print as a table; 0 for all")
      ->type_name("N")
      ->capture_default_str();
  add_connection_options(command, options->connection);
  add_output_options(command, options->output);
  command.callback([options] { run(*options); });
}

}  // namespace clearance::cli
