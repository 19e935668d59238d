// The processor that a measurement was taken on.
#pragma once

#include <fstream>
#include <string>
#include <thread>

namespace clearance {

/// Its name as Linux has it and how many logical processors there are: "AMD EPYC 9B14 x2".
inline std::string machine_name() {
  std::string name = "unknown CPU";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos) {
      name = line.substr(line.find(": ") + 2);
      break;
    }
  return name + " x" + std::to_string(std::thread::hardware_concurrency());
}

}  // namespace clearance
