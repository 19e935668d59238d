// clearance inspect: models of a scene's bodies, their cost and error, and possible savings.
#include "inspect/inspect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include "cli/commands.h"
#include "cli/inspect_models.h"

namespace clearance::cli {
namespace {

struct InspectCommand {
  std::string scene;
  Output output = Output::kTable;
  InspectOptions options;
  bool no_times = false, no_covers = false, allow_outside = false;
};

Table bodies_of(const engine::Scene& scene, const SceneReport& report, Output output) {
  std::vector<std::string> columns{"body",          "form",        "kind",     "parent",   "pieces",     "loaded",
                                   "inside",        "vertices",    "faces",    "radius_m", "extent_m",   "error_m",
                                   "hull_excess_m", "empty_share", "partners", "ignored",  "ns_per_pair"};
  const bool for_people = output == Output::kTable;
  if (for_people)
    columns.insert(columns.end(), {"KiB", "shared_by", "source"});
  else
    columns.insert(columns.end(), {"bytes", "display_bytes", "triangles", "inner_error_m", "uncertain_m",
                                   "uncertain_rad", "padding_m", "max_speed_m_s", "shared_by", "source"});
  Table table(columns);
  for (std::size_t i = 0; i < report.bodies.size(); ++i) {
    const Body& body = scene.bodies()[i];
    const BodyReport& r = report.bodies[i];
    std::vector<Cell> row{body.name,
                          r.form,
                          body.is_static ? "static" : "movable",
                          body.parent == kNone ? Cell() : Cell(scene.bodies()[body.parent].name),
                          r.parts,
                          r.loaded,
                          r.inside ? Cell(*r.inside) : Cell(),
                          r.vertices,
                          r.faces,
                          Cell(r.radius, 4),
                          Cell::finite(r.extent, 4),
                          Cell(r.model_error, 3),
                          Cell(r.hull_excess, 3),
                          r.empty_share ? Cell(*r.empty_share, 3) : Cell(),
                          r.partners,
                          r.ignored,
                          r.ns_per_pair ? Cell(*r.ns_per_pair, 3) : Cell()};
    if (for_people)
      row.push_back(Cell(static_cast<double>(r.bytes) / 1024, 3));
    else
      row.insert(row.end(),
                 {r.bytes, r.display_bytes, r.triangles, Cell(body.model_inner, 3), Cell(body.uncertainty.position, 6),
                  Cell(body.uncertainty.angle, 6), Cell(body.padding, 6), Cell(body.max_speed, 6)});
    row.insert(row.end(), {r.sharing, body.source});
    table.add(std::move(row));
  }
  return table;
}

Table findings_of(const engine::Scene& scene, const SceneReport& report) {
  Table table({"what", "body", "other", "error_m", "text"});
  for (const Finding& f : report.findings)
    table.add({name_of(f.kind), scene.bodies()[f.body].name,
               f.other == kNone ? Cell() : Cell(scene.bodies()[f.other].name), f.error ? Cell(*f.error, 3) : Cell(),
               f.text});
  return table;
}

Table warnings_of(const engine::Scene& scene, const SceneReport& report) {
  Table table({"body", "text"});
  for (std::size_t i = 0; i < report.bodies.size(); ++i)
    if (!report.bodies[i].warning.empty()) table.add({scene.bodies()[i].name, report.bodies[i].warning});
  return table;
}

Table choices_of(const engine::Scene& scene, const SceneReport& report) {
  Table table({"body", "mesh_as", "now", "vertices", "triangles", "KiB", "hull_excess_m", "ns_per_pair"});
  for (const Choice& c : report.choices)
    table.add({scene.bodies()[c.body].name, std::string(word_of(c.what)), c.is_now, c.vertices, c.triangles,
               Cell(static_cast<double>(c.bytes) / 1024, 3), Cell(c.hull_excess, 3),
               c.ns_per_pair ? Cell(*c.ns_per_pair, 3) : Cell()});
  return table;
}

Table covers_of(const engine::Scene& scene, const SceneReport& report, bool with_times) {
  std::vector<std::string> columns{"body", "balls", "KiB", "build_s"};
  for (int level = 0; level < Cover::kLevels; ++level)
    for (const char* what : {"mean_m", "greatest_m"})
      columns.push_back(what + std::string("_") + std::to_string(level));
  Table table(columns);
  for (const CoverReport& c : report.covers) {
    std::vector<Cell> row{scene.bodies()[c.body].name, c.balls, Cell(static_cast<double>(c.bytes) / 1024, 3),
                          with_times ? Cell(c.seconds, 2) : Cell()};
    for (const StandOut& level : c.levels)
      row.insert(row.end(),
                 {level.balls ? Cell(level.mean, 2) : Cell(), level.balls ? Cell(level.greatest, 2) : Cell()});
    table.add(std::move(row));
  }
  return table;
}

// Error terms of a body; empty if its bounds are those of its convex parts.
void print_uncertainty(const Body& body) {
  if (!has_uncertainty(body) && body.padding == 0) return;
  std::printf("%s: ", body.name.c_str());
  const auto [position, angle] = body.uncertainty;
  if (body.model_error > 0)
    std::printf("its shape is smaller than its convex parts by up to %.3g m; ", body.model_error);
  if (body.model_inner > 0) std::printf("larger by up to %.3g m; ", body.model_inner);
  if (position > 0) std::printf("its position is known within %g m; ", position);
  if (angle > 0)
    std::printf("its orientation within %g rad, which moves it by up to %.3g m; ", angle,
                2 * std::sin(0.5 * std::min(angle, 3.2)) * body.reach);
  if (body.padding > 0) std::printf("it is padded by %g m; ", body.padding);
  if (body.max_speed > 0) std::printf("it moves by up to %g m for each second of its pose's age; ", body.max_speed);
  std::printf("the bounds include all of this\n");
}

void print_report(const InspectCommand& o, const engine::Scene& scene, const SceneReport& report) {
  bodies_of(scene, report, Output::kTable).print(std::cout, Output::kTable);
  std::cout << "\n";
  for (std::size_t i = 0; i < report.bodies.size(); ++i)
    if (!report.bodies[i].warning.empty())
      std::cout << "Warning: " << scene.bodies()[i].name << ": " << report.bodies[i].warning << "\n";
  std::cout.flush();
  for (const Body& body : scene.bodies()) print_uncertainty(body);
  std::fflush(stdout);
  std::printf("\nModels of bodies\n");
  print_models(scene, report.models, o.options.margin);
  std::fflush(stdout);
  if (!report.covers.empty()) {
    std::cout << "\nCovers of bodies that may move, by levels 0 to 3\n";
    covers_of(scene, report, !o.no_times).print(std::cout, Output::kTable);
    std::cout << "\n";
  }
  if (report.findings.empty()) std::cout << "Found no redundancy.\n";
  for (const Finding& f : report.findings) std::cout << scene.bodies()[f.body].name << ": " << f.text << "\n";
  std::printf("\n%zu bodies, %llu enabled pairs; convex parts take %.4g KiB, display meshes %.4g KiB\n",
              report.bodies.size(), static_cast<unsigned long long>(report.pairs),
              static_cast<double>(report.bytes) / 1024, static_cast<double>(report.display_bytes) / 1024);
  if (report.ns_all_pairs)
    std::printf("All pairs once, at the poses at load, to the default tolerance: about %.3g us on one thread\n",
                1e-3 * *report.ns_all_pairs);
}

void print_report_json(const InspectCommand& o, const engine::Scene& scene, const SceneReport& report) {
  std::cout << "{\"scene\": " << json_string(o.scene) << ",\n\"bodies\": ";
  bodies_of(scene, report, Output::kJson).print(std::cout, Output::kJson);
  std::cout << ",\n\"could_be_left_out\": ";
  findings_of(scene, report).print(std::cout, Output::kJson);
  std::cout << ",\n\"warnings\": ";
  warnings_of(scene, report).print(std::cout, Output::kJson);
  std::cout << ",\n\"choices\": ";
  choices_of(scene, report).print(std::cout, Output::kJson);
  std::cout << ",\n\"models\": ";
  table_of_models(scene, report.models).print(std::cout, Output::kJson);
  std::cout << ",\n\"covers\": ";
  covers_of(scene, report, !o.no_times).print(std::cout, Output::kJson);
  std::cout << ",\n\"pairs\": " << report.pairs << ", \"bytes\": " << report.bytes
            << ", \"display_bytes\": " << report.display_bytes << ", \"ns_all_pairs\": ";
  if (report.ns_all_pairs)
    std::cout << *report.ns_all_pairs;
  else
    std::cout << "null";
  std::cout << "}\n";
}

void run_inspect(const InspectCommand& o) {
  const engine::Scene scene = engine::Scene::load(o.scene, o.allow_outside);
  const auto warn = [](const std::string& text) { std::cerr << "clearance: warning: " << text << "\n"; };
  for (const std::string& text : scene.warnings()) warn(text);
  for (const auto& robot : scene.robots())
    for (const std::string& text : robot->model.warnings) warn(text);
  InspectOptions options = o.options;
  options.measure = !o.no_times;
  options.covers = !o.no_covers && o.output != Output::kCsv;
  const SceneReport report = inspect(scene, options);
  switch (o.output) {
    case Output::kTable:
      print_report(o, scene, report);
      break;
    case Output::kCsv:
      bodies_of(scene, report, o.output).print(std::cout, o.output);
      break;
    case Output::kJson:
      print_report_json(o, scene, report);
      break;
  }
}

}  // namespace

void add_inspect(CLI::App& app) {
  auto& command = *app.add_subcommand(
      "inspect", "the geometry of a scene file's bodies, its cost, the model they require, and redundancies");
  const auto o = std::make_shared<InspectCommand>();
  command.add_option("scene", o->scene, "scene file (YAML), or a URDF: that robot alone")
      ->required()
      ->type_name("SCENE");
  add_output_options(command, o->output);
  command
      .add_option("--within", o->options.within,
                  "a sphere or box is named if it stands out by no more than this share of the\nbody's size")
      ->check(quiet(CLI::Range(1e-9, 0.5)))
      ->type_name("SHARE")
      ->capture_default_str();
  command
      .add_option("--margin", o->options.margin,
                  "metres: the distance that decisions are about; hulls that stand out of their\nmeshes by no more are "
                  "recommended")
      ->check(quiet(CLI::Range(0.0, 1e6)))
      ->type_name("METRES")
      ->capture_default_str();
  command.add_flag("--no-times", o->no_times, "measure no times, so that the same scene gives the same report");
  command.add_flag("--no-covers", o->no_covers, "make no covers, which may take a second each");
  command.add_flag("--allow-outside", o->allow_outside, "allow meshes outside the scene's folder");
  command.footer(R"(
Columns
  form                       geometry that distances refer to; for a surface or solid it is the mesh itself, and
                             its hull gives lower bounds only
  loaded, inside, vertices   as read; dropped because proved inside; the rest, from which bounds are made
  error_m                    how far the convex parts may stand out from the given shape
  hull_excess_m, empty_share how far at most they stand out of a non-convex mesh, and which share of
                             their volume is empty (unknown for a mesh with holes)
  partners, ignored          bodies with which it has enabled pairs, and those that the ignore list removes
  ns_per_pair                measured now: one thread, poses at load, default tolerance
  KiB, shared_by             memory of its convex parts, and how many bodies share them

Models (not in CSV)
  For each robot and the other bodies: by how much hulls make distances too small, what true meshes cost, and which
  model decisions by --margin require. --json has the choices for each mesh, too.

Covers (not in CSV)
  Trees of balls that decide quickly whether bodies that may move are free. Engines make them in the background and
  keep them in the cache; this command fills the cache ahead of time, so that engines have them from the start.
  mean_m_K, greatest_m_K     mean and greatest width of the bounds that the balls of level K give
  balls, KiB, build_s        of all levels; seconds on one core when the cover was made

Exit codes
  0 done    1 the scene cannot be loaded    2 the command line is wrong)");
  command.callback([o] { run_inspect(*o); });
}

}  // namespace clearance::cli
