// main() for mutants: passes if a test fails, which means that the mutant is found. The first failure ends the run.
#include <gtest/gtest.h>

#include <cstdio>

namespace {

/// Ends a test with its first failure.
class EndTest : public testing::EmptyTestEventListener {
  void OnTestPartResult(const testing::TestPartResult& result) override {
    if (result.failed()) throw testing::AssertionException(result);
  }
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  GTEST_FLAG_SET(fail_fast, true);
  testing::UnitTest::GetInstance()->listeners().Append(new EndTest);
  const bool is_found = RUN_ALL_TESTS() != 0 && testing::UnitTest::GetInstance()->failed_test_count() > 0;
  std::printf(is_found ? "found\n" : "NOT FOUND: no test fails\n");
  return is_found ? 0 : 1;
}
