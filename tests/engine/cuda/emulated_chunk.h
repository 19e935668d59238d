// Dense chunks in host memory, for kernels emulated without a GPU (emulated_scene.h). Include in one source file per
// program.
#pragma once

#include <set>

#include "engine/narrow/epa.h"
// After the headers that kernels include.
#include "tests/engine/cuda/emulated_scene.h"

// Shared memory of a block, as declared by the kernels. Not constant-initialized, since the compiler calls its dynamic
// initializer.
namespace clearance::emulated {
inline uint4 some_words() {
  return {};
}
inline thread_local uint4 shared_memory[test::kMostShared / sizeof(uint4)] = {some_words()};
}  // namespace clearance::emulated
#define cuda emulated
#include "engine/cuda/dense/depth_kernel.cuh"
#include "engine/cuda/dense/group_kernel.cuh"
#include "engine/cuda/dense/lean_kernel.cuh"
#include "engine/cuda/dense/open_rows.cuh"
#undef cuda

namespace clearance::test {

using emulated::Group;

// A whole query as one chunk in host memory.
struct HostChunk {
  HullArrays hulls;
  HostBodies bodies;
  std::vector<PairRef> pairs;
  std::vector<std::uint32_t> position, rest;
  std::vector<Group> group_of_tile;
  std::vector<Enclosed> enclosed;
  std::vector<LeftOpen> left_open;
  std::uint32_t counts[kCounts] = {}, host_counts[kCounts] = {};
  Finished finished{};
  std::uint64_t begun = 0;
  Answer rows;
  ChunkView view{};

  HostChunk(const engine::Engine& engine, const QueryView& q)
      : hulls(engine.scene(), kMostShared),
        bodies(engine.scene(), hulls.view(), q),
        pairs(bodies.refs()),
        rows(empty_answer(engine, q)) {
    const std::uint32_t all = q.configuration_count * static_cast<std::uint32_t>(pairs.size());
    rows.info.rows = rows.info.total = all;
    rest.resize(all);
    enclosed.resize(all);
    left_open.resize(all);
    for (std::uint32_t p = 0; p < pairs.size(); ++p) {  // a group per pair: tiles of its configurations
      position.push_back(p);
      const Group group{hulls.of_body[q.pairs[p].a], hulls.of_body[q.pairs[p].b], p, 1,
                        static_cast<std::uint32_t>(group_of_tile.size())};
      group_of_tile.insert(group_of_tile.end(), (q.configuration_count + kTile - 1) / kTile, group);
    }
    view.hulls = hulls.view();
    view.bodies = bodies.view;
    const bool flags = (q.fields & kFieldFlags) != 0, points = flags || (q.fields & kFieldPoints32) != 0;
    view.pair_limits = {q.max_distance,     q.abs_tol,         default_rel_tol(q.precision),  256, false, points, flags,
                        !q.signed_distance, q.signed_distance, q.precision == Precision::kF32};
    view.group_of_tile = group_of_tile.data();
    view.pairs = pairs.data();
    view.position = position.data();
    view.pair_count = static_cast<std::uint32_t>(pairs.size());
    view.configurations = q.configuration_count;
    view.reply = rows.view;
    view.rest = rest.data();
    view.enclosed = enclosed.data();
    view.left_open = left_open.data();
    view.counts = counts;
  }

  template <class Kernel>
  void launch(std::uint32_t blocks, const Kernel& kernel, std::uint32_t threads = kTile) {
    EmulatedGrid::one().launch(blocks, threads, kernel);
  }
  // The last kernel hands over the counts.
  // \param kernel called with the view
  template <class Kernel>
  void launch_last(std::uint32_t blocks, const Kernel& kernel, std::uint32_t threads = kTile) {
    view.host_counts = host_counts;
    view.blocks = blocks;
    view.begun = &begun;
    view.finished = &finished;
    view.number = 7;
    launch(blocks, [&] { kernel(view); }, threads);
    EXPECT_EQ(finished.number, 7u) << "the last block says so";
    EXPECT_EQ(begun, 0u) << "left for the next chunk";
    EXPECT_TRUE(std::all_of(counts, counts + kCounts, [](std::uint32_t c) { return c == 0; }))
        << "left for the next chunk";
  }

  // Expects the CPU's rows, except for rows left to the CPU, which must be few and listed once each.
  void expect_the_cpus(const engine::Engine& cpu, const QueryView& q, const std::string& what,
                       double most_left = 0.02) {
    Answer expected = evaluate(cpu, q);
    const std::set<std::uint32_t> left(rest.begin(), rest.begin() + host_counts[kRest]);
    EXPECT_EQ(left.size(), host_counts[kRest]) << what << ": each once";
    EXPECT_LT(static_cast<double>(left.size()), most_left * static_cast<double>(rest.size())) << what;
    EXPECT_EQ(host_counts[kConvergedRows] + left.size(), expected.info.pairs_evaluated) << what;
    for (const std::uint32_t row : left) {
      const auto copy = [&](auto* from, auto* to, std::size_t width) {
        std::copy_n(from + row * width, from ? width : 0, to + row * width);
      };
      for_each_column(copy, expected.view, rows.view);
    }
    expect_same(rows, expected, what, true);
  }
};

}  // namespace clearance::test
