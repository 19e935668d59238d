// A file in memory-backed storage for the input of a target.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace clearance::fuzz {

/// A temporary folder, removed at the end of the program. In /dev/shm if it exists, for a million files a minute.
class ScratchFolder {
 public:
  ScratchFolder() {
    namespace fs = std::filesystem;
    const fs::path base = fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path();
    std::string name = (base / "clearance-fuzz-XXXXXX").string();
    if (!::mkdtemp(name.data())) throw std::runtime_error("no folder for the fuzzer's files");
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  /// Replaces a file's contents and returns its path.
  std::string write(const std::string& name, Bytes bytes) const {
    const std::string path = *this / name;
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    file.flush();
    if (!file) throw std::runtime_error("cannot write " + path);
    return path;
  }

 private:
  std::string path_;
};

}  // namespace clearance::fuzz
