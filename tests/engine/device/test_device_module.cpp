// The kernel library: opened only when a device is requested, with its defects reported.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "engine/device/device_module.h"
#include "engine/engine.h"
#include "tests/source_file.h"

namespace clearance::test {
namespace {

// A process opens the library once, so each case runs in its own process.
class DeviceModule : public testing::Test {
 protected:
  void SetUp() override { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
};
using DeviceModuleDeathTest = DeviceModule;

[[noreturn]] void request_for_cuda(const std::string& library) {
  setenv("CLEARANCE_CUDA_MODULE", library.c_str(), 1);
  try {
    const engine::Engine engine(engine::Scene(), {"cuda"});
  } catch (const std::runtime_error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(3);
  }
  std::exit(0);
}

void expect_rejected(const std::string& library, const std::string& reason) {
  EXPECT_EXIT(request_for_cuda(library), testing::ExitedWithCode(3), "backend 'cuda' is not there \\(.*" + reason);
}

TEST_F(DeviceModuleDeathTest, IsMissing) {
  expect_rejected("/dev/null/libclearance-cuda.so",
                  "CLEARANCE_CUDA_MODULE=/dev/null/libclearance-cuda.so is not a library");
}

TEST_F(DeviceModuleDeathTest, IsNoLibrary) {
  expect_rejected(source_file("LICENSE"), "LICENSE: ");
}

TEST_F(DeviceModuleDeathTest, IsAnothersLibrary) {
  expect_rejected(CLEARANCE_FOREIGN_MODULE, "is not a library of Clearance's kernels");
}

TEST_F(DeviceModuleDeathTest, IsOfOtherCode) {
  expect_rejected(CLEARANCE_OLD_MODULE, "was built from other code than this engine");
}

TEST_F(DeviceModuleDeathTest, IsOfThisCodeAndSaysWhatThereIs) {
  expect_rejected(CLEARANCE_FAKE_MODULE, "no device today");
}

// Opening the fake library would end the process.
TEST_F(DeviceModuleDeathTest, IsNotOpenedForTheCpuAlone) {
  EXPECT_EXIT(
      {
        setenv("CLEARANCE_CUDA_MODULE", CLEARANCE_FAKE_MODULE, 1);
        setenv("CLEARANCE_TEST_END_WHEN_OPENED", "1", 1);
        const engine::Engine engine(engine::Scene(), {"cpu"});
        std::exit(0);
      },
      testing::ExitedWithCode(0), "");
  EXPECT_EXIT(
      {
        setenv("CLEARANCE_CUDA_MODULE", CLEARANCE_FAKE_MODULE, 1);
        setenv("CLEARANCE_TEST_END_WHEN_OPENED", "1", 1);
        const engine::Engine engine(engine::Scene(), {"auto"});
        engine::Engine::backends();
        std::exit(0);
      },
      testing::ExitedWithCode(4), "");
}

// Replies then go to ordinary memory.
TEST_F(DeviceModuleDeathTest, WithoutItNothingIsPinned) {
  EXPECT_EXIT(
      {
        setenv("CLEARANCE_CUDA_MODULE", "/dev/null/none", 1);
        const int here = 0;
        if (cuda::is_pinned(&here)) std::exit(1);
        try {
          const cuda::PinnedMemory memory(64);
        } catch (const cuda::DeviceError& error) {
          std::fprintf(stderr, "%s\n", error.what());
          std::exit(3);
        }
      },
      testing::ExitedWithCode(3), "CLEARANCE_CUDA_MODULE=/dev/null/none is not a library");
}

[[noreturn]] void share_some_sizes() {
  setenv("CLEARANCE_CUDA_MODULE", CLEARANCE_FAKE_MODULE, 1);
  constexpr std::size_t part = cuda::SharedMemory::kConvexPart;
  bool good = true;
  for (const std::size_t bytes : {std::size_t{1}, part, part + 1}) {
    cuda::SharedMemory memory(3, bytes);
    good = good && memory.size() >= bytes && memory.handle().ipc[63] == std::byte{42};
    good = good && memory.data()[bytes - 1] == std::byte{0};
    memory.wait();
  }
  std::exit(good ? 0 : 1);
}

// CUDA exports memory in whole blocks, so a block must hold nothing else of this process.
TEST_F(DeviceModuleDeathTest, SharedMemoryHasItsPartsForItselfAndGivesThemBackOnce) {
  EXPECT_EXIT(share_some_sizes(), testing::ExitedWithCode(0),
              "^share 2097152 on 3, wait on 3, release on 3, share 2097152 on 3, wait on 3, release on 3, "
              "share 4194304 on 3, wait on 3, release on 3, $");
}

[[noreturn]] void share_what_is_not_there() {
  setenv("CLEARANCE_CUDA_MODULE", CLEARANCE_FAKE_MODULE, 1);
  int rejected = 0;
  const auto evaluate = [&](int device, std::size_t bytes) {
    try {
      const cuda::SharedMemory memory(device, bytes);
    } catch (const cuda::DeviceError& error) {
      rejected += error.kind == cuda::DeviceError::kNoMemory;
      std::fprintf(stderr, "%s; ", error.what());
    }
  };
  evaluate(7, 64);
  evaluate(3, 0);
  evaluate(3, ~std::size_t{0});
  std::exit(rejected);
}

TEST_F(DeviceModuleDeathTest, SharedMemoryThatIsNotToBeHadIsRejected) {
  EXPECT_EXIT(share_what_is_not_there(), testing::ExitedWithCode(3),
              "^a planted lack of room; shared device memory: expected 1 to 9223372036854775807 bytes, not 0; "
              "shared device memory: expected 1 to 9223372036854775807 bytes, not 18446744073709551615; $");
}

TEST_F(DeviceModuleDeathTest, WithoutItNoMemoryIsShared) {
  EXPECT_EXIT(
      {
        setenv("CLEARANCE_CUDA_MODULE", "/dev/null/none", 1);
        try {
          const cuda::SharedMemory memory(0, 64);
        } catch (const cuda::DeviceError& error) {
          std::fprintf(stderr, "%s\n", error.what());
          std::exit(3);
        }
      },
      testing::ExitedWithCode(3), "CLEARANCE_CUDA_MODULE=/dev/null/none is not a library");
}

}  // namespace
}  // namespace clearance::test
