// clearance-decompose: convex pieces for a mesh, with a proof of how far they miss it.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <iostream>

#include "cli/table.h"
#include "inspect/decompose.h"

namespace clearance {
namespace {

using cli::Cell;
using cli::Output;
using cli::Table;

std::atomic<bool> stop{false};

void end_early(int) {
  stop = true;
}

void report(const DecomposedMesh& mesh, Output output) {
  Table table({"file", "pieces", "vertices", "triangles", "size_m", "inner_m", "outer_m", "median_outer_m", "propose_s",
               "prove_s"});
  table.add({mesh.file, mesh.pieces, mesh.vertices, mesh.triangles, Cell(mesh.size, 4), Cell(mesh.inner, 3),
             Cell(mesh.outer, 3), Cell(mesh.median_outer, 3), Cell(mesh.propose_s, 3), Cell(mesh.prove_s, 3)});
  table.print(std::cout, output);
  constexpr double kMuch = 0.01;  // of the size: then triangles have to answer for many pairs
  if (mesh.inner > kMuch * mesh.size)
    std::fprintf(stderr,
                 "clearance decompose: warning: the pieces leave parts of the mesh outside, up to %.3g m from them; "
                 "they save little\n",
                 mesh.inner);
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  using namespace clearance;
  constexpr int kNoPieces = 1, kCommandLine = 2;
  CLI::App app(
      "Cuts a closed mesh into convex pieces, which CoACD proposes, and proves how far these may miss it. Writes "
      "FILE.pieces.obj, which scenes with `convexify: decompose` use.",
      "clearance decompose");
  DecomposeOptions options;
  Output output = Output::kTable;
  app.add_option("mesh", options.mesh, "the mesh file")->required();
  app.add_option("--threshold", options.threshold, "how concave a piece may be, as CoACD has it: 0.01 to 1")
      ->check(CLI::Range(0.01, 1.0));
  app.add_option("--max-pieces", options.most_pieces, "most pieces; -1: as many as it takes");
  app.add_option("--seconds", options.seconds, "that CoACD may take")->check(CLI::PositiveNumber);
  app.add_option("--python", options.python, "a Python that has coacd");
  app.add_flag("--keep", options.keep, "prove the pieces that are there, whoever made them");
  app.add_flag("--quiet", options.quiet, "without what CoACD says of its progress");
  auto* json = app.add_flag_callback("--json", [&] { output = Output::kJson; }, "print JSON");
  app.add_flag_callback("--csv", [&] { output = Output::kCsv; }, "print comma-separated values")->excludes(json);
  app.footer(R"(
Exit codes
  0 done    1 no pieces: the mesh is open, or CoACD is missing, failed or was stopped    2 the command line is wrong)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return kCommandLine;
  }
  struct sigaction action{};
  action.sa_handler = end_early;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  try {
    report(decompose(options, stop), output);
    if (!std::cout.flush()) throw std::runtime_error("the table cannot be written");
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "clearance decompose: " << error.what() << "\n";
    return kNoPieces;
  }
}
