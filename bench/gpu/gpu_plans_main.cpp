// Device queries compared with the same queries to the host: make gpu-bench.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <utility>
#include <vector>

#include "bench/gpu/arm_workload.h"
#include "bench/gpu/gpu_workloads.h"
#include "bench/timing.h"
#include "engine/device/device.h"
#include "engine/device/query/device_plan.h"
#include "tests/engine/evaluate_query.h"
#include "tests/gpu/device_memory.h"

namespace clearance::test {
namespace {

template <class Work>
double median_us(int repeats, const Work& work) {
  std::vector<double> took;
  for (int i = -3; i < repeats; ++i) {
    const double us = bench::took_us(work);
    if (i >= 0) took.push_back(us);
  }
  return bench::median(std::move(took));
}

ReplyView view_over(std::byte* memory, const QuerySize& size, std::uint64_t* bytes = nullptr) {
  return reply_view_over(memory, size.rows, size.fields, bytes, size.joints);
}
std::uint64_t bytes_of(const QuerySize& size) {
  std::uint64_t bytes = 0;
  view_over(nullptr, size, &bytes);
  return bytes;
}

// \returns whether the rows equal those of the query to the host, except for rows that the CPU finished
void run(const Workload& w, std::ostream& csv) {
  const engine::Engine device(w.scene(), {"cuda"});
  const Requested requested(w, device);
  const QuerySize size = device.size(requested.q);
  const std::uint64_t bytes = bytes_of(size);
  const cuda::PinnedMemory pinned(bytes);
  const ReplyView host = view_over(pinned.data(), size);
  const int repeats = size.rows > 4'000'000 ? 20 : 100;

  std::unique_ptr<DevicePlan> plan;
  const double made_us = bench::took_us([&] { plan = device.plan_on_device(requested.q); });
  const std::span<const Pose> all_poses = requested.q.configurations;
  const std::span<const double> all_positions = requested.q.positions;
  DeviceMemory poses(all_poses.size_bytes()), positions(all_positions.size_bytes()), rows(bytes);
  poses.put(all_poses.data(), all_poses.size_bytes());
  positions.put(all_positions.data(), all_positions.size_bytes());
  const ReplyView out = view_over(rows.data(), size);
  DeviceStream stream;
  const GivenOnDevice at{reinterpret_cast<const Pose*>(poses.data()),
                         reinterpret_cast<const double*>(positions.data())};
  const double resident = median_us(repeats, [&] {
    plan->run(at, out, stream.get());
    stream.wait();
  });
  constexpr int kInARow = 10;  // whose launches are hidden by the work before them
  const double in_a_row = median_us(std::max(5, repeats / kInARow),
                                    [&] {
                                      for (int i = 0; i < kInARow; ++i) plan->run(at, out, stream.get());
                                      stream.wait();
                                    }) /
                          kInARow;
  stream.capture([&] { plan->run(at, out, stream.get()); });
  const double in_graph = median_us(repeats, [&] {
    stream.launch();
    stream.wait();
  });
  const double to_host = median_us(repeats, [&] {
    Job job = device.start(requested.q, host);
    while (!job.advance()) {
    }
  });
  const std::vector<std::byte> got = rows.get();
  std::uint64_t other = 0;
  for_each_column(
      [&](const auto* mine, const auto* theirs, int width) {
        constexpr std::size_t kBounds = 2 * sizeof(float);
        const std::byte* const from = got.data() + (reinterpret_cast<const std::byte*>(mine) - rows.data());
        const std::size_t step = sizeof(*mine) * static_cast<std::size_t>(width);
        for (std::uint64_t i = 0; mine && step >= kBounds && i < size.rows; ++i)
          other += std::memcmp(from + i * step, reinterpret_cast<const std::byte*>(theirs) + i * step, kBounds) != 0;
      },
      out, host);
  csv << '"' << w.name << "\"," << size.configurations * size.pairs << ',' << resident << ',' << in_graph << ','
      << in_a_row << ',' << to_host << ',' << to_host / resident << ',' << made_us << ',' << other << '\n';
  csv.flush();
  std::printf(
      "%-55s %9llu rows | resident %8.1f us, graph %8.1f, in a row %8.1f | to the host %8.1f us, %5.1fx | made in "
      "%8.0f us | "
      "%llu rows with other bounds\n",
      w.name.c_str(), static_cast<unsigned long long>(size.configurations * size.pairs), resident, in_graph, in_a_row,
      to_host, to_host / resident, made_us, static_cast<unsigned long long>(other));
  std::fflush(stdout);
}

// The same, skipping queries that device queries do not support, such as meshes.
void run_if_planned(const Workload& w, std::ostream& csv) {
  try {
    run(w, csv);
  } catch (const engine::QueryError& e) {
    std::printf("%s | %s\n", w.name.c_str(), e.what());
  }
}

}  // namespace
}  // namespace clearance::test

int main(int argc, char** argv) {
  using namespace clearance;
  using namespace clearance::test;
  if (!cuda::device_info().present) {
    std::fprintf(stderr, "no CUDA device: %s\n", cuda::device_info().reason.c_str());
    return 1;
  }
  const std::string path = argc > 1 ? argv[1] : "gpu_plans.csv", filter = argc > 2 ? argv[2] : "";
  std::ofstream csv(path);
  csv << "# device: " << cuda::device_info().name << "\n# command: make gpu-bench\n"
      << "workload,pairs,resident_us,graph_us,in_a_row_us,to_host_us,to_host_over_resident,made_us,rows_with_other_"
         "bounds\n";
  for (Workload w : workloads()) {
    const bool is_plan = w.reduce == Reduce::kNone || w.reduce == Reduce::kMin || w.reduce == Reduce::kAny;
    if (!is_plan || w.depth || w.name.find(filter) == std::string::npos) continue;
    run_if_planned(w, csv);
    if (w.scene == arm_scene_of_hulls && w.reduce != Reduce::kAny && w.configurations == 4096) {
      w.name += ", gradients by joints";
      w.fields = kFieldDistance | kFieldGradientJoints;
      run_if_planned(w, csv);
    }
    if (w.fields != kFloat32) continue;
    const std::string name = w.name.substr(0, w.name.rfind(", float32")) + w.name.substr(w.name.rfind(", float32") + 9);
    w.name = name + ", lower and upper";
    w.fields = kFieldLower | kFieldUpper;
    run_if_planned(w, csv);
    w.name = name + ", bounds in float32";
    w.fields = kFieldBounds;
    run_if_planned(w, csv);
  }
}
