#include "tests/faults/census.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace clearance::faults {
namespace {

std::uint64_t kilobytes(const std::string& line) {
  std::istringstream words(line.substr(line.find(':') + 1));
  std::uint64_t value = 0;
  words >> value;
  return value;
}

}  // namespace

std::vector<std::string> entries_of(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code gone;
  for (std::filesystem::directory_iterator at(folder, gone), end; !gone && at != end; at.increment(gone))
    names.push_back(at->path().string());
  std::sort(names.begin(), names.end());
  return names;
}

Census census_of(int pid, const std::vector<std::string>& folders) {
  const std::string process = "/proc/" + std::to_string(pid);
  Census census;
  census.descriptors = static_cast<int>(entries_of(process + "/fd").size());
  census.threads = static_cast<int>(entries_of(process + "/task").size());
  std::ifstream maps(process + "/maps");
  for (std::string line; std::getline(maps, line); ++census.mappings)
    census.segments += line.find("clearance-shm") != std::string::npos;
  std::ifstream status(process + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("RssAnon:", 0) == 0) census.private_kb = kilobytes(line);
    if (line.rfind("RssShmem:", 0) == 0 || line.rfind("RssFile:", 0) == 0) census.shared_kb += kilobytes(line);
  }
  for (const std::string& folder : folders)
    for (std::string& name : entries_of(folder)) census.files.push_back(std::move(name));
  for (std::string& name : entries_of("/dev/shm"))
    if (name.find("clearance-shm") != std::string::npos) census.files.push_back(std::move(name));
  return census;
}

std::string Census::text() const {
  return std::to_string(descriptors) + " descriptors, " + std::to_string(segments) + " segments, " +
         std::to_string(mappings) + " mappings, " + std::to_string(threads) + " threads, " +
         std::to_string(files.size()) + " files, " + std::to_string(private_kb) + " KB";
}

std::string left_behind(const Census& before, const Census& now) {
  std::string text;
  const auto compare = [&text](const char* what, int was, int is, int spared = 0) {
    if (is > was + spared) text += std::to_string(is) + " " + what + " instead of " + std::to_string(was) + "; ";
  };
  compare("descriptors", before.descriptors, now.descriptors);
  compare("segments", before.segments, now.segments);
  compare("mappings", before.mappings, now.mappings, kMappingsSpared);
  compare("threads", before.threads, now.threads);
  for (const std::string& file : now.files)
    if (std::find(before.files.begin(), before.files.end(), file) == before.files.end())
      text += "a file " + file + "; ";
  return text;
}

}  // namespace clearance::faults
