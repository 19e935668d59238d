// clearance-peers-export: writes the contenders' problems, and the exact distances, to files.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <sstream>

#include "bench/peers/workloads.h"

int main(int argc, char** argv) {
  using namespace clearance;
  std::string workload, cls, file, scenes = "scenes", poses, names;
  std::uint64_t seed = 1;
  int count = 200;
  bool list = false;
  CLI::App app{"Writes a problem for every contender of make bench SUITE=peers, with its truth."};
  app.add_flag("--list", list, "print the workloads and the classes, with a line on each");
  app.add_option("--workload", workload, "a workload to write");
  app.add_option("--class", cls, "a class of cases to write");
  app.add_option("--seed", seed, "of the cases");
  app.add_option("--count", count, "of the cases")->check(CLI::PositiveNumber);
  app.add_option("--scenes", scenes, "the folder of scenes");
  app.add_option("--links", names, "names of the cell's links, with commas");
  app.add_option("--link-poses", poses, "file of their poses: (K, links, 7) float64");
  app.add_option("--out", file, "the file to write");
  CLI11_PARSE(app, argc, argv);
  try {
    if (list) {
      for (const Workload& w : workloads()) std::printf("workload\t%s\t%s\n", w.name.c_str(), w.what.c_str());
      for (const exact::CaseClass& c : exact::case_classes())
        std::printf("class\t%s\t%s\n", c.name.c_str(), c.what.c_str());
      return 0;
    }
    peers::Problem p;
    if (!workload.empty()) {
      LinkPoses links;
      std::stringstream in(names);
      for (std::string name; std::getline(in, name, ',');) links.names.push_back(name);
      std::ifstream raw(poses, std::ios::binary);
      for (std::array<double, 7> x; raw.read(reinterpret_cast<char*>(&x), sizeof x);) links.poses.push_back(x);
      if (workload.starts_with("cell") && (links.names.empty() || links.poses.empty()))
        throw std::runtime_error("the cell needs --links and --link-poses");
      p = make_workload(workload, scenes, links);
    } else {
      const auto& all = exact::case_classes();
      const auto found = std::find_if(all.begin(), all.end(), [&](const exact::CaseClass& c) { return c.name == cls; });
      if (found == all.end()) throw std::runtime_error("there is no class \"" + cls + "\"");
      p = make_class_problem(*found, seed, count);
    }
    peers::write_problem(p, file);
    std::printf("%zu\n", p.exact_value.size());
  } catch (const std::exception& e) {
    std::cerr << "clearance-peers-export: " << e.what() << '\n';
    return 2;
  }
}
