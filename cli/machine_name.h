// Name of the processor that ran a measurement.
#pragma once

#include <fstream>
#include <string>
#include <thread>

namespace clearance {

/// Returns Linux's name of the processor and the number of logical ones, as in "AMD EPYC 9B14 x2".
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
