// clearance selftest: tests every instruction set and device of this machine.
#include <iostream>
#include <memory>

#include "cli/commands.h"
#include "engine/device/device.h"
#include "engine/device/device_self_test.h"
#include "engine/narrow/self_test.h"

namespace clearance::cli {
namespace {

/// Prints a line for each test. Throws std::runtime_error if one failed.
void run_selftest(Output output) {
  std::vector<SelfTest> tests = self_tests();
  if (const cuda::DeviceInfo& device = cuda::device_info(); device.present)
    for (int number = 0; number < device.count; ++number) {
      tests.push_back(cuda::self_test_devices({number}));
      tests.back().name += " " + std::to_string(number);
    }
  Table table({"what", "answers", "wrong", "ms", "first_wrong"});
  std::string failed;
  for (const SelfTest& test : tests) {
    table.add({test.name, test.answers, test.wrong, Cell(1e3 * test.seconds, 3),
               test.passed() ? Cell() : Cell(test.first_wrong)});
    if (!test.passed()) failed += (failed.empty() ? "" : ", ") + test.name;
  }
  table.print(std::cout, output);
  if (!failed.empty()) throw std::runtime_error("the engine does not use what computes wrongly: " + failed);
}

}  // namespace

void add_selftest(CLI::App& app) {
  auto& command =
      *app.add_subcommand("selftest", "test that each backend and instruction set of this machine computes correctly");
  const auto output = std::make_shared<Output>(Output::kTable);
  add_output_options(command, *output);
  command.footer(R"(
Tests both kinds of arithmetic, each instruction set and each GPU with pairs whose distances are known.

Exit codes
  0 all compute correctly    1 one does not, and the engine does not use it    2 the command line is wrong)");
  command.callback([output] { run_selftest(*output); });
}

}  // namespace clearance::cli
