// Runs the fuzz targets over the stored inputs: real requests and files (corpus/), and findings of fuzzing
// (regressions/). No input may break anything, and those called good_... must still be accepted, because seeds of an
// old wire version would be useless to the fuzzer.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "server/base/log.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/source_file.h"

namespace clearance::fuzz {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = source_file("tests/fuzz");

std::vector<fs::path> inputs_of(const fs::path& folder) {
  std::vector<fs::path> files;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::byte> contents_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

class FuzzReplay : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { log::start("off"); }
};

TEST_P(FuzzReplay, KeptInputsBreakNothing) {
  const Target target = targets().at(GetParam());
  int good = 0;
  for (const fs::path& path : inputs_of(kFolder / "corpus" / GetParam())) {
    SCOPED_TRACE(path.string());
    const bool is_good = path.filename().string().starts_with("good_");
    EXPECT_EQ(target(contents_of(path)), is_good);
    good += is_good;
  }
  EXPECT_GT(good, 0) << "tests/fuzz/corpus/" << GetParam() << " holds nothing that is accepted";
  for (const fs::path& path : inputs_of(kFolder / "regressions" / GetParam())) {
    SCOPED_TRACE(path.string());
    target(contents_of(path));
  }
  // Truncated and empty inputs.
  target({});
  for (const fs::path& path : inputs_of(kFolder / "corpus" / GetParam())) {
    const auto bytes = contents_of(path);
    for (const std::size_t size : {bytes.size() / 3, bytes.size() / 2, bytes.size() - 1})
      target(std::span(bytes).first(size));
  }
}

TEST(FuzzReplay, EveryFolderIsSomeTargets) {
  for (const char* kind : {"corpus", "regressions"}) {
    const std::vector<fs::path> folders = inputs_of(kFolder / kind);
    EXPECT_FALSE(folders.empty()) << kind;
    for (const fs::path& folder : folders) EXPECT_TRUE(targets().contains(folder.filename().string())) << folder;
  }
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const auto& [name, target] : targets()) all.push_back(name);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Targets, FuzzReplay, testing::ValuesIn(names()),
                         [](const testing::TestParamInfo<std::string>& target) { return target.param; });

}  // namespace
}  // namespace clearance::fuzz
