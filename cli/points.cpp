// clearance scene points: replaces the points of a cloud from a file or another program.
#include <array>
#include <iostream>
#include <memory>
#include <sstream>

#include "cli/commands.h"
#include "cli/text_lines.h"

namespace clearance::cli {
namespace {

struct PointsOptions {
  Connection connection;
  std::string body, file;
  double radius = -1;  // the scene's if negative
};

// Reads three numbers a line; further columns are ignored, and '#' begins a comment. Throws std::invalid_argument.
std::vector<std::array<float, 3>> read_points(const std::string& file) {
  std::vector<std::array<float, 3>> points;
  for_each_line(file, "", [&](const std::string& line, const std::string& place) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string word;
    std::array<float, 3> point{};
    std::size_t count = 0;
    while (count < 3 && words >> word)
      point[count++] =
          static_cast<float>(number_of(word, place + ": expected 3 numbers, metres, with white space between them"));
    if (count == 3) points.push_back(point);
    if (count == 1 || count == 2)
      throw std::invalid_argument(place + ": expected 3 numbers, metres, got " + std::to_string(count));
  });
  return points;
}

void run(const PointsOptions& o) {
  const std::vector<std::array<float, 3>> points = read_points(o.file);
  Client client = o.connection.open();
  const std::optional<double> radius = o.radius >= 0 ? std::optional(o.radius) : std::nullopt;
  const UpdateResult done = client.set_points(body_of(client, o.body), points, radius);
  std::cout << done.applied << " points, pose revision " << done.revision << "\n";
}

}  // namespace

void add_points(CLI::App& scene) {
  auto& command = *scene.add_subcommand("points", "replace the points of a cloud");
  auto options = std::make_shared<PointsOptions>();
  command.add_option("BODY", options->body, "name or number of the body")->required();
  command.add_option("FILE", options->file, "x y z a line, metres, in the body's frame; - for standard input")
      ->required();
  command.add_option("--radius", options->radius, "radius of the points, in metres; default: the scene's")
      ->check(at_least_zero());
  add_connection_options(command, options->connection);
  command.callback([options] { run(*options); });
}

}  // namespace clearance::cli
