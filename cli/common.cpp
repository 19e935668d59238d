#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <sstream>

#include "cli/commands.h"
#include "wire/default_socket.h"

namespace clearance::cli {

const std::map<std::string, Precision> kPrecisionNames{{"f64", Precision::kF64}, {"f32", Precision::kF32}};

Client Connection::open() const {
  const auto timeout = std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(timeout_s));
  Client client = connect(url.empty() ? "shm://" + default_socket_path() : url, timeout);
  client.set_timeout(timeout);
  return client;
}

CLI::Validator at_least_zero() {
  return CLI::Validator(
      [](std::string& text) {
        double number = 0;
        const bool good = CLI::detail::lexical_cast(text, number) && number >= 0;
        return good ? std::string() : "expected a number >= 0, got " + text;
      },
      "");
}

void add_connection_options(CLI::App& command, Connection& connection) {
  command
      .add_option("--connect", connection.url,
                  "the daemon: shm:///path, ipc:///path, tcp://host:port or\nudpm://group:port?ttl=0; default: shm://" +
                      default_socket_path())
      ->envname("CLEARANCE_URL")
      ->type_name("URL");
  command.add_option("--timeout", connection.timeout_s, "seconds to wait for an answer")
      ->check(quiet(CLI::Range(0.0, 1e6)))
      ->type_name("S")
      ->capture_default_str();
}

void add_output_options(CLI::App& command, Output& output) {
  auto* json = command.add_flag_callback("--json", [&output] { output = Output::kJson; }, "print JSON");
  command.add_flag_callback(
             "--csv", [&output] { output = Output::kCsv; }, "print comma-separated values")
      ->excludes(json);
}

namespace {

// Applies the daemon's rules (docs/concepts.md) before sending.
constexpr double kMinNorm = 1e-6, kMaxNorm = 1e6, kMaxPosition = 1e6;

/// Returns the number of a body if the text is one.
bool is_number_of_body(Client& client, const std::string& text, std::uint32_t& id) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  return error == std::errc() && end == text.data() + text.size() && id < client.scene().bodies.size();
}

bool is_body(const SceneInfo& scene, const std::string& name) {
  for (const auto& body : scene.bodies)
    if (body.name == name) return true;
  return false;
}

}  // namespace

std::uint32_t body_of(Client& client, const std::string& text) {
  std::uint32_t id = 0;
  if (!is_body(client.scene(), text) && is_number_of_body(client, text, id)) return id;
  return client.body(text);
}

std::uint32_t selector_of(Client& client, const std::string& text) {
  if (text == "*") return kEveryBody;
  const auto& groups = client.scene().groups;
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (groups[i].name == text) return kGroupBit | static_cast<std::uint32_t>(i);
  return body_of(client, text);
}

Pose7 pose_of(const std::string& option, const std::vector<double>& numbers) {
  if (!numbers.empty() && numbers.size() != 3 && numbers.size() != 7)
    throw std::invalid_argument(option + ": expected x y z, or x y z qw qx qy qz; got " +
                                std::to_string(numbers.size()) + " numbers");
  Pose7 pose{0, 0, 0, 1, 0, 0, 0};
  std::copy(numbers.begin(), numbers.end(), pose.begin());
  for (const double number : pose)
    if (!std::isfinite(number)) throw std::invalid_argument(option + ": expected finite numbers");
  const double norm = std::hypot(std::hypot(pose[3], pose[4]), std::hypot(pose[5], pose[6]));
  if (!(norm >= kMinNorm && norm <= kMaxNorm)) {
    std::ostringstream text;
    text << option << ": expected a quaternion with a norm from " << kMinNorm << " to " << kMaxNorm << ", got " << norm;
    throw std::invalid_argument(text.str());
  }
  return pose;
}

double number_of(const std::string& text, const std::string& expected) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (text.empty() || end != text.c_str() + text.size() || !std::isfinite(number))
    throw std::invalid_argument(expected + ", got \"" + text + "\"");
  return number;
}

double position_of(const std::string& text, const std::string& expected) {
  const std::string all = expected + " from -1e6 to 1e6, radians or metres";
  const double position = number_of(text, all);
  if (std::abs(position) > kMaxPosition) throw std::invalid_argument(all + ", got \"" + text + "\"");
  return position;
}

std::string degrees_hint(const std::vector<std::pair<double, JointInfo>>& beyond) {
  constexpr double kRadian = std::numbers::pi / 180;
  bool is_large = false;
  for (const auto& [position, joint] : beyond) {
    if (position * kRadian < joint.lower || position * kRadian > joint.upper) return "";
    is_large |= std::abs(position) > 2 * std::numbers::pi;
  }
  return is_large ? "; in degrees they would be within: positions are in radians" : "";
}

void warn_of_bad(const UpdateResult& done) {
  if (done.bad > 0)
    std::cerr << "clearance: warning: the daemon stored " << done.bad
              << " of the values as bad; queries give no distance for the bodies that they move\n";
}

std::string name_of(const SceneInfo& scene, std::uint32_t body) {
  return body < scene.bodies.size() ? scene.bodies[body].name : "-";
}

std::vector<IdPair> pairs_of(Client& client, const std::vector<std::string>& texts) {
  std::vector<IdPair> pairs;
  for (const std::string& text : texts) {
    const std::size_t comma = text.find(',');
    if (comma == std::string::npos || text.find(',', comma + 1) != std::string::npos)
      throw std::invalid_argument("--pairs: expected A,B as in arm,table; got \"" + text + "\"");
    pairs.push_back({selector_of(client, text.substr(0, comma)), selector_of(client, text.substr(comma + 1))});
  }
  return pairs;
}

void add_pairs_option(CLI::App& command, std::vector<std::string>& pairs) {
  command.add_option("--pairs", pairs, "pairs A,B of bodies or groups (* is every body); default: all enabled")
      ->type_name("A,B ...");
}

}  // namespace clearance::cli
