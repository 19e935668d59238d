// Parallel copies whose first part is used before the last part is copied.
#include <gtest/gtest.h>

#include <numeric>
#include <thread>

#include "engine/device/query/ordered_copy.h"

namespace clearance::test {
namespace {

TEST(OrderedCopy, HasWhatWasWaitedForWhateverTheOthersDo) {
  constexpr std::size_t kBlock = 1u << 16;
  for (const cuda::CopyReader reader : {cuda::CopyReader::kHost, cuda::CopyReader::kDevice})
    for (const std::size_t bytes :
         {std::size_t{0}, std::size_t{1}, kBlock - 1, kBlock, 12 * kBlock, 40 * kBlock + 4099})
      for (const int helpers : {0, 1, 3}) {
        std::vector<unsigned char> room_from(bytes + 3), to(bytes + 16);
        unsigned char* const from = room_from.data() + 3;  // unaligned
        std::iota(from, from + bytes, static_cast<unsigned char>(7));
        auto* const target = to.data() + (16 - reinterpret_cast<std::uintptr_t>(to.data()) % 16) % 16;
        cuda::OrderedCopy copy(from, target, bytes, reader);
        std::vector<std::thread> threads;
        for (int i = 0; i < helpers; ++i)
          threads.emplace_back([&] {
            while (copy.copy_block()) {
            }
          });
        for (std::size_t there = 0; there <= bytes; there += 3 * kBlock + 17) {
          copy.wait_for(there);
          EXPECT_EQ(std::memcmp(from, target, there), 0) << bytes << " bytes, " << there << " of them waited for";
        }
        copy.wait_for(bytes);
        EXPECT_EQ(std::memcmp(from, target, bytes), 0) << bytes << " bytes";
        for (std::thread& t : threads) t.join();
        EXPECT_FALSE(copy.copy_block()) << "none is left";
      }
}

}  // namespace
}  // namespace clearance::test
