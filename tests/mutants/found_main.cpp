// main() for mutants: passes if a test fails, which means that the mutant is found. The first failure ends the run.
// CLEARANCE_FOUND_BY names a test that runs first (found_by.txt); if it does not find the mutant, the program starts again
// with all others.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

/// Ends a test with its first failure.
class EndTest : public testing::EmptyTestEventListener {
  void OnTestPartResult(const testing::TestPartResult& result) override {
    if (result.failed()) throw testing::AssertionException(result);
  }
};

}  // namespace

int main(int argc, char** argv) {
  const std::vector<char*> arguments(argv, argv + argc + 1);
  testing::InitGoogleTest(&argc, argv);
  const char* likely = std::getenv("CLEARANCE_FOUND_BY");
  if (likely) GTEST_FLAG_SET(filter, likely);
  GTEST_FLAG_SET(fail_fast, true);
  testing::UnitTest::GetInstance()->listeners().Append(new EndTest);
  const bool is_found = RUN_ALL_TESTS() != 0 && testing::UnitTest::GetInstance()->failed_test_count() > 0;
  if (likely && !is_found) {
    std::printf("not found by %s\n", likely);
    std::fflush(stdout);
    unsetenv("CLEARANCE_FOUND_BY");
    execv("/proc/self/exe", arguments.data());
  }
  std::printf(is_found ? "found\n" : "NOT FOUND: no test fails\n");
  return is_found ? 0 : 1;
}
