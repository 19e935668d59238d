// clearance-selftest: whether each way to answer that this machine has computes rightly.
#include <CLI/CLI.hpp>
#include <iostream>

#include "cli/table.h"
#include "engine/device/device.h"
#include "engine/device/device_self_test.h"
#include "engine/narrow/self_test.h"

namespace clearance {
namespace {

using cli::Cell;

/// Prints a line for each. Returns whether all passed.
bool run(cli::Output output) {
  std::vector<SelfTest> tests = self_tests();
  if (const cuda::DeviceInfo& device = cuda::device_info(); device.present)
    for (int number = 0; number < device.count; ++number) {
      tests.push_back(cuda::self_test_devices({number}));
      tests.back().name += " " + std::to_string(number);
    }
  cli::Table table({"what", "answers", "wrong", "ms", "first_wrong"});
  bool passed = true;
  for (const SelfTest& test : tests) {
    table.add({test.name, test.answers, test.wrong, Cell(1e3 * test.seconds, 3),
               test.passed() ? Cell() : Cell(test.first_wrong)});
    passed = passed && test.passed();
  }
  table.print(std::cout, output);
  return passed;
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  using namespace clearance;
  constexpr int kWrong = 1, kCommandLine = 2;
  cli::Output output = cli::Output::kTable;
  CLI::App app(
      "Asks every way to answer that this machine has (both kinds of arithmetic, each instruction set, each GPU) "
      "about pairs whose distances are known.",
      "clearance selftest");
  auto* json = app.add_flag_callback("--json", [&] { output = cli::Output::kJson; }, "print JSON");
  app.add_flag_callback("--csv", [&] { output = cli::Output::kCsv; }, "print comma-separated values")->excludes(json);
  app.footer(
      "\nExit codes\n  0 all compute rightly    1 one does not, and the engine will not use it    2 the command line "
      "is wrong");
  try {
    app.parse(argc, argv);
    return run(output) ? 0 : kWrong;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::cerr << "clearance selftest: " << error.what() << "\n";
    return kCommandLine;
  } catch (const std::exception& error) {
    std::cerr << "clearance selftest: " << error.what() << "\n";
    return kWrong;
  }
}
