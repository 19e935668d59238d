// Tests of the programs clearanced and clearance, run as a user runs them.
#pragma once

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "tests/server/daemon_fixture.h"

namespace clearance {

inline Finished clearanced(std::vector<std::string> options, const std::vector<std::string>& environment = {}) {
  options.insert(options.begin(), program("clearanced"));
  return run(options, environment);
}
inline Finished clearance_cli(std::vector<std::string> options, const std::vector<std::string>& environment = {}) {
  options.insert(options.begin(), program("clearance"));
  return run(options, environment);
}

/// Returns the first line of stderr that is not a log line.
inline std::string sentence(const Finished& finished) {
  std::istringstream lines(finished.err);
  for (std::string line; std::getline(lines, line);)
    if (line.rfind("time=", 0) != 0) return line;
  return "";
}

inline testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << part << "\" is not in:\n" << text;
}

class Clearanced : public testing::Test {
 protected:
  TestFolder folder_;
  std::string scene_ = folder_.write("scene.yaml", kSmallSceneYaml);
  std::string ipc_ = "ipc://" + (folder_ / "c.ipc");
};

}  // namespace clearance
