// Throughput of the cuda backend and of the CPU on this machine: make gpu-bench.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <thread>

#include "bench/gpu/arm_workload.h"
#include "bench/gpu/gpu_workloads.h"
#include "bench/report/narrow.h"
#include "bench/timing.h"
#include "engine/device/device.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

using bench::median;
using bench::took_us;

struct Timing {
  double wall_us = 0, kernel_us = 0, broad_phase_us = 0;
};

std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [key, value] : engine.stats())
    if (key == name) return value;
  return 0;  // a backend without this counter
}

// Medians over queries into the same columns.
Timing time_queries(engine::Engine& engine, const QueryView& query, const ReplyView& reply, int repeats) {
  std::vector<double> walls, kernels, broad_phases;
  for (int i = -2; i < repeats; ++i) {
    const std::uint64_t before = counter(engine, "cuda.kernel_ns"),
                        broad_before = counter(engine, "cuda.broad_phase_ns");
    const auto begin = std::chrono::steady_clock::now();
    Job job = engine.start(query, reply);
    while (!job.advance()) {
    }
    const double us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
    if (i < 0) continue;
    walls.push_back(us);
    kernels.push_back(1e-3 * static_cast<double>(counter(engine, "cuda.kernel_ns") - before));
    broad_phases.push_back(1e-3 * static_cast<double>(counter(engine, "cuda.broad_phase_ns") - broad_before));
  }
  return {median(walls), median(kernels), median(broad_phases)};
}

// The report's kernel for many pairs, one block per pair: distances only, for the pairs of a row above.
void run_baseline(const std::string& name, const engine::Scene& scene, std::ostream& csv,
                  std::vector<std::string>& table) {
  const std::vector<BodyPair> pairs = engine::Engine(scene, {"cpu"}).pairs({});
  const baselines::World world(scene);
  const auto system = baselines::make_narrow("cuda_batched");
  std::vector<baselines::PairAnswer> answers(pairs.size());
  std::vector<double> walls, kernels;
  for (int i = -1; i < 5; ++i) {
    const double us = took_us([&] { system->distances(world, pairs, answers); });
    if (i < 0) continue;
    walls.push_back(us);
    kernels.push_back(system->kernel_us());
  }
  const double kernel_us = median(kernels), wall_us = median(walls);
  csv << '"' << name << "\"," << pairs.size() << ',' << kernel_us << ",," << wall_us << ",,,,,,,\n";
  char line[200];
  std::snprintf(line, sizeof line, "%-50s %9zu pairs | kernels %9.1f us %6.2f G/s | wall %22s %9.1f us pageable",
                name.c_str(), pairs.size(), kernel_us, 1e-3 * static_cast<double>(pairs.size()) / kernel_us, "",
                wall_us);
  std::puts(line);
  table.push_back(line);
}

// One GPU and all GPUs, with the same query into pinned memory.
void run_several(const Workload& w, std::ostream& csv) {
  const int count = cuda::device_info().count;
  engine::Engine::Options one{"cuda"}, all{"cuda"};
  one.devices = {0};
  for (int i = 0; i < count; ++i) all.devices.push_back(i);
  engine::Engine single(w.scene(), one), several(w.scene(), all);
  const Requested requested(w, single);
  const QuerySize size = single.size(requested.q);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  const cuda::PinnedMemory room(bytes), room_several(bytes);
  const ReplyView reply = reply_view_over(room.data(), size.rows, size.fields),
                  reply_several = reply_view_over(room_several.data(), size.rows, size.fields);
  const int repeats = size.rows > 4'000'000 ? 10 : 30;
  const Timing with_one = time_queries(single, requested.q, reply, repeats),
               with_all = time_queries(several, requested.q, reply_several, repeats);
  std::memset(room.data(), 1, bytes);
  std::memset(room_several.data(), 1, bytes);
  time_queries(single, requested.q, reply, 1);
  time_queries(several, requested.q, reply_several, 1);
  const bool same = std::memcmp(room.data(), room_several.data(), bytes) == 0;
  csv << '"' << w.name << "\"," << size.configurations * size.pairs << ',' << count << ',' << with_one.wall_us << ','
      << with_all.wall_us << ',' << with_one.wall_us / with_all.wall_us << ',' << (same ? "same" : "DIFFERENT") << '\n';
  csv.flush();
  std::printf("%-50s one %9.1f us | %d %9.1f us | %5.2fx | bits %s\n", w.name.c_str(), with_one.wall_us, count,
              with_all.wall_us, with_one.wall_us / with_all.wall_us, same ? "same" : "DIFFERENT");
  std::fflush(stdout);
}

void run(const Workload& w, std::ostream& csv, std::vector<std::string>& table) {
  engine::Engine device(w.scene(), {"cuda"}), cpu(w.scene(), {"cpu"}), either(w.scene(), {"auto"});
  const Requested requested(w, cpu);
  const QueryView& q = requested.q;
  const QuerySize size = device.size(q);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  const cuda::PinnedMemory pinned(bytes), pinned_cpu(bytes);
  std::vector<std::byte> pageable(bytes + 64);
  const auto view = [&](std::byte* base) { return reply_view_over(base, size.rows, size.fields); };
  std::byte* aligned = pageable.data() + (64 - reinterpret_cast<std::uintptr_t>(pageable.data()) % 64) % 64;

  const bool has_elements = cpu.scene().has_surfaces();
  const int repeats = size.rows > 4'000'000 ? 10 : size.rows < 20'000 && !has_elements ? 300 : 30;
  const Timing direct = time_queries(device, q, view(pinned.data()), repeats);
  const std::uint64_t rest = counter(device, "cuda.pairs_finished_on_cpu") / static_cast<std::uint64_t>(repeats + 2);
  const Timing staged = time_queries(device, q, view(aligned), repeats);
  const Timing host = time_queries(cpu, q, view(pinned_cpu.data()), std::max(5, repeats / 5));
  const Timing routed = time_queries(either, q, view(aligned), repeats);
  std::memset(pinned.data(), 1, bytes);
  std::memset(pinned_cpu.data(), 1, bytes);
  time_queries(device, q, view(pinned.data()), 1);
  time_queries(cpu, q, view(pinned_cpu.data()), 1);
  // Answers with clouds and meshes depend on the traversal of their trees. Their intervals contain the same distance.
  bool same = std::memcmp(pinned.data(), pinned_cpu.data(), bytes) == 0;
  const ReplyView rows = view(pinned.data()), cpu_rows = view(pinned_cpu.data());
  if (has_elements) {
    same = true;
    const auto meet = [&](std::uint64_t i) {
      const float *const b = rows.bounds + 2 * i, *const c = cpu_rows.bounds + 2 * i;
      if (rows.bounds) return b[0] <= c[1] && c[0] <= b[1];
      if (rows.lower) return rows.lower[i] <= cpu_rows.upper[i] && cpu_rows.lower[i] <= rows.upper[i];
      const auto beyond = static_cast<std::uint8_t>(Status::kBeyond);  // for decisions: all apart, or not
      return (rows.status[i] == beyond) == (cpu_rows.status[i] == beyond);
    };
    for (std::uint64_t i = 0; i < size.rows; ++i) same = same && meet(i);
  }
  const bool has_bounds = rows.bounds || rows.lower;
  const char* const agreement = !same           ? "DIFFERENT"
                                : !has_elements ? "same"
                                : has_bounds    ? "intervals meet"
                                                : "verdicts same";

  const unsigned cores = std::thread::hardware_concurrency();
  csv << '"' << w.name << "\"," << size.configurations * size.pairs << ',' << direct.kernel_us << ',' << direct.wall_us
      << ',' << staged.wall_us << ',' << host.wall_us << ',' << routed.wall_us << ','
      << (routed.kernel_us > 0 ? "cuda" : "cpu") << ',' << cores << ',' << rest << ',' << agreement << ','
      << direct.broad_phase_us << '\n';
  csv.flush();
  char line[400];
  std::snprintf(line, sizeof line,
                "%-50s %9llu pairs | kernels %9.1f us %6.2f G/s | wall %9.1f us pinned, %9.1f us pageable | cpu %u "
                "cores %10.1f us | %5.1fx | auto %9.1f us (%s) | rest %6llu | bits %s",
                w.name.c_str(), static_cast<unsigned long long>(size.configurations * size.pairs), direct.kernel_us,
                1e-3 * static_cast<double>(size.configurations * size.pairs) / direct.kernel_us, direct.wall_us,
                staged.wall_us, cores, host.wall_us, host.wall_us / direct.wall_us, routed.wall_us,
                routed.kernel_us > 0 ? "cuda" : "cpu", static_cast<unsigned long long>(rest), agreement);
  std::string said = line;
  if (direct.broad_phase_us > 0) said += " | poses to near pairs " + std::to_string(direct.broad_phase_us) + " us";
  std::puts(said.c_str());
  std::fflush(stdout);
  table.push_back(said);
}

// Replacing the points of the cloud: until they are on the device, and until a query of them is answered.
void run_swap(const std::string& name, std::ostream& csv, std::vector<std::string>& table) {
  const Workload w{"", arm_scene_in_room, 64, kFieldStatus, Reduce::kAny};
  engine::Engine device(w.scene(), {"cuda"}), cpu(w.scene(), {"cpu"});
  const Requested requested(w, cpu);
  const std::uint32_t room = cpu.scene().find_body("room");
  const std::vector<CloudPoint> points[2] = {room_points(kRoomPoints, 31), room_points(kRoomPoints, 37)};
  const QuerySize size = device.size(requested.q);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  const cuda::PinnedMemory pinned(bytes);
  const ReplyView reply = reply_view_over(pinned.data(), size.rows, size.fields);
  const auto query = [&](engine::Engine& engine) {
    Job job = engine.start(requested.q, reply);
    while (!job.advance()) {
    }
  };
  std::vector<double> set, first, later, set_cpu;
  for (int i = -2; i < 30; ++i) {
    const double us[] = {took_us([&] { device.set_points(room, points[i & 1]); }), took_us([&] { query(device); }),
                         took_us([&] { query(device); }), took_us([&] { cpu.set_points(room, points[i & 1]); })};
    if (i < 0) continue;
    set.push_back(us[0]), first.push_back(us[1]), later.push_back(us[2]), set_cpu.push_back(us[3]);
  }
  const double swap = median(set), upload = median(first) - median(later);
  csv << '"' << name << "\"," << kRoomPoints << ",," << swap + upload << ",," << median(set_cpu) << ",,,,,,\n";
  char line[300];
  std::snprintf(line, sizeof line,
                "%-50s set_points %9.1f us, and %9.1f us more for the first query after it (%9.1f us the next) | cpu "
                "alone %9.1f us",
                name.c_str(), swap, upload, median(later), median(set_cpu));
  std::puts(line);
  table.push_back(line);
}

}  // namespace
}  // namespace clearance::test

int main(int argc, char** argv) {
  using namespace clearance;
  using namespace clearance::test;
  const std::string path = argc > 1 ? argv[1] : "gpu.csv", filter = argc > 2 ? argv[2] : "";
  if (!cuda::device_info().present) {
    std::fprintf(stderr, "no CUDA device: %s\n", cuda::device_info().reason.c_str());
    return 1;
  }
  if (path == "--device") {
    std::puts(cuda::device_info().name.c_str());
    return 0;
  }
  if (path == "--several") {
    const int count = cuda::device_info().count;
    if (count < 2) {
      std::fprintf(stderr, "there is one CUDA device alone\n");
      return 1;
    }
    std::ofstream csv(filter);
    csv << "# devices: " << count << " x " << cuda::device_info().name << "\n# command: make gpu-bench TASK=several\n"
        << "workload,pairs,devices,wall_one_us,wall_all_us,ratio,bits\n";
    for (const Workload& w : workloads())
      if (w.configurations > 0 || (w.reduce == Reduce::kNone && w.name.starts_with("5000"))) run_several(w, csv);
    return 0;
  }
  std::ofstream csv(path);
  csv << "# device: " << cuda::device_info().name << "\n# command: make gpu-bench\n"
      << "workload,pairs,kernel_us,wall_pinned_us,wall_pageable_us,cpu_wall_us,auto_wall_us,auto_backend,cpu_cores,"
         "rows_finished_on_cpu,bits_"
         "against_cpu,broad_phase_us\n";
  std::vector<std::string> table;
  for (const Workload& w : workloads())
    if (w.name.find(filter) != std::string::npos) run(w, csv, table);
  if (const std::string name = "1000 spheres, box 100, the report's block for each pair";
      name.find(filter) != std::string::npos)
    run_baseline(name, spheres(1000, 100), csv, table);
  if (const std::string name = "another cloud of 100,000 points"; name.find(filter) != std::string::npos)
    run_swap(name, csv, table);
  std::printf("\n%s\n", cuda::device_info().name.c_str());
  for (const std::string& line : table) std::puts(line.c_str());
}
