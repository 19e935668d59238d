// clearance decompose: convex parts of a mesh with proved bounds on their error.
#include "inspect/decompose.h"

#include <signal.h>

#include <atomic>
#include <cstdio>
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

std::atomic<bool> stop_decomposing{false};

struct DecomposeCommand {
  DecomposeOptions options;
  Output output = Output::kTable;
};

void print_decomposed(const DecomposedMesh& mesh, Output output) {
  Table table({"file", "pieces", "vertices", "triangles", "size_m", "inner_m", "outer_m", "median_outer_m", "propose_s",
               "prove_s"});
  table.add({mesh.file, mesh.parts, mesh.vertices, mesh.triangles, Cell(mesh.size, 4), Cell(mesh.inner, 3),
             Cell(mesh.outer, 3), Cell(mesh.median_outer, 3), Cell(mesh.propose_s, 3), Cell(mesh.prove_s, 3)});
  table.print(std::cout, output);
  constexpr double kMuch = 0.01;  // share of the size above which many pairs need triangles
  if (mesh.inner > kMuch * mesh.size)
    std::fprintf(stderr,
                 "clearance: warning: the convex parts miss the mesh by up to %.3g m; "
                 "they save little\n",
                 mesh.inner);
}

void run_decompose(const DecomposeCommand& o) {
  struct sigaction action{};
  action.sa_handler = [](int) { stop_decomposing = true; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  print_decomposed(decompose(o.options, stop_decomposing), o.output);
}

}  // namespace

void add_decompose(CLI::App& app) {
  auto& command =
      *app.add_subcommand("decompose", "convex parts for a closed mesh, with a proved bound on their error");
  const auto o = std::make_shared<DecomposeCommand>();
  command.add_option("mesh", o->options.mesh, "the mesh file")->required();
  command
      .add_option("--threshold", o->options.threshold, "maximum concavity of a part, as CoACD defines it: 0.01 to 1")
      ->check(CLI::Range(0.01, 1.0));
  command.add_option("--max-pieces", o->options.most_pieces, "maximum number of parts; -1 for no limit");
  command.add_option("--seconds", o->options.seconds, "time limit of CoACD")->check(CLI::PositiveNumber);
  command.add_option("--python", o->options.python, "Python interpreter that has coacd");
  command.add_flag("--keep", o->options.keep, "keep the existing parts, and prove their error");
  command.add_flag("--quiet", o->options.quiet, "hide CoACD's progress");
  add_output_options(command, o->output);
  command.footer(R"(
CoACD proposes the parts, which are written to FILE.pieces.obj for scenes with `mesh_as: decompose`.

Exit codes
  0 done    1 no parts: the mesh is open, or CoACD is missing, failed or was stopped    2 the command line is wrong)");
  command.callback([o] { run_decompose(*o); });
}

}  // namespace clearance::cli
