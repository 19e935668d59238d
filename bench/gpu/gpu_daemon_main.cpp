// Rows of a daemon's GPU for a client in another process: in GPU memory that the client maps, compared with the same
// rows in host memory. `clearance-gpu-daemon URL [CSV [LABEL]]` adds rows to the CSV; make gpu-bench writes its head.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "bench/timing.h"
#include "client/client.h"
#include "tests/gpu/device_memory.h"

namespace clearance::test {
namespace {

constexpr int kTurns = 200, kWarmUp = 20;

/// Times of several alternatives, run in turn so that slowdowns of the machine affect all of them.
class Turns {
 public:
  template <class Work>
  void take(std::size_t way, const Work& work) {
    if (took_.size() <= way) took_.resize(way + 1);
    took_[way].push_back(bench::took_us(work));
  }
  double at(std::size_t way, double quantile) {
    std::vector<double> all(took_[way].begin() + kWarmUp, took_[way].end());
    std::sort(all.begin(), all.end());
    return all[static_cast<std::size_t>(quantile * static_cast<double>(all.size() - 1))];
  }

 private:
  std::vector<std::vector<double>> took_;
};

/// \param moves whether the poses of all bodies are given, as one configuration; if not, the daemon's poses are used
void run(Client& client, const std::string& name, std::uint32_t fields, bool moves, const std::string& label,
         std::ostream* csv) {
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> poses;
  for (const BodyStateInfo& state : client.body_states())
    if (moves) {
      bodies.push_back(static_cast<std::uint32_t>(bodies.size()));
      poses.push_back(state.pose);
    }
  Query query;
  query.bodies = bodies;
  query.fields = fields;
  DeviceQuery plan = client.prepare(query).on_device(moves ? 1 : 0);
  const DeviceQueryInfo info = plan.info();
  MappedMemory memory(info.memory_handle, info.device_uuid);
  if (moves) memory.put(info.poses_offset, poses.data(), poses.size() * sizeof(Pose7));
  const std::uint64_t first = info.columns.front().offset,
                      bytes = info.columns.back().offset + info.rows * info.columns.back().row_bytes - first;
  Query to_host = query;
  to_host.configurations = poses;
  Turns turns;
  double on_device_us = 0;
  for (int i = 0; i < kTurns + kWarmUp; ++i) {
    turns.take(0, [&] { client.ping(); });
    turns.take(1, [&] { on_device_us += i < kWarmUp ? 0 : plan.run().took.count() / 1e3 / kTurns; });
    turns.take(2, [&] {
      plan.run();
      memory.sum(first, bytes);
    });
    turns.take(3, [&] { memory.sum(first, bytes); });
    turns.take(4, [&] { client.distances(to_host); });
  }
  std::printf(
      "%-18s %-9s %-6s %llu pairs | echo %6.1f us | rows there %7.1f (p90 %7.1f; daemon %7.1f) | and read by a kernel "
      "%7.1f "
      "(that alone %6.1f) | in host memory %7.1f us (p90 %7.1f)\n",
      name.c_str(), moves ? "of a move" : "as it is", label.c_str(), static_cast<unsigned long long>(info.pairs),
      turns.at(0, 0.5), turns.at(1, 0.5), turns.at(1, 0.9), on_device_us, turns.at(2, 0.5), turns.at(3, 0.5),
      turns.at(4, 0.5), turns.at(4, 0.9));
  std::fflush(stdout);
  if (!csv) return;
  *csv << name << ',' << (moves ? "one configuration of all bodies" : "the daemon's") << ',' << label << ','
       << info.pairs << ',' << turns.at(0, 0.5) << ',' << turns.at(1, 0.5) << ',' << turns.at(1, 0.9) << ','
       << on_device_us << ',' << turns.at(2, 0.5) << ',' << turns.at(3, 0.5) << ',' << turns.at(4, 0.5) << ','
       << turns.at(4, 0.9) << '\n';
  csv->flush();
}

}  // namespace
}  // namespace clearance::test

int main(int argc, char** argv) {
  using namespace clearance;
  using namespace clearance::test;
  if (argc < 2) {
    std::fprintf(stderr, "clearance-gpu-daemon URL [CSV [LABEL]]\n");
    return 2;
  }
  const std::string path = argc > 2 ? argv[2] : "", label = argc > 3 ? argv[3] : "";
  std::ofstream csv;
  if (!path.empty()) csv.open(path, std::ios::app);
  std::ostream* const out = path.empty() ? nullptr : &csv;
  try {
    Client client = connect(argv[1], std::chrono::seconds(30));
    for (const bool moves : {false, true}) {
      run(client, "bounds and points in float32", kFieldBounds | kFieldPoints32, moves, label, out);
      run(client, "lower and upper", kFieldLower | kFieldUpper, moves, label, out);
      run(client, "bounds in float32", kFieldBounds, moves, label, out);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "clearance-gpu-daemon: %s\n", error.what());
    return 1;
  }
}
