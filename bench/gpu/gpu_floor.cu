// A floor for checks of robot states on a GPU: the work of a sphere check without proofs, in float32. Two kernels in the
// structure that B. Sundaralingam et al., "cuRobo: parallelized collision-free minimum-jerk robot motion generation",
// 2023, describe: kinematics with four threads a state, then a thread for each sphere, which visits all cuboids. The
// spheres, the cuboids and this code are ours: its times are no measurement of cuRobo. make gpu-bench.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <random>
#include <vector>

#include "bench/timing.h"
#include "engine/cuda/memory/memory.cuh"
#include "tests/gpu/device_memory.h"

namespace clearance::test {
namespace {

constexpr int kJoints = 7, kSpheres = 61, kThreads = 128;

// A joint of a Panda: the frame before its turn about z, in the frame of the link below.
struct Joint {
  float fixed[3][4];
};
struct Sphere {
  float x, y, z, radius;
  int link;  // after this many joints
};
// The world in the axes of a cuboid, and its half sizes.
struct Cuboid {
  float to_cuboid[3][4], half[3];
};
__constant__ Joint joints[kJoints];
__constant__ Sphere spheres[kSpheres];

// Centres of a state's spheres. Thread r of four has row r of the links' frames; the last one has the radii.
__global__ void place_spheres(const float* positions, std::uint32_t states, float4* centres, std::uint8_t* hit) {
  const std::uint32_t i = blockIdx.x * kThreads + threadIdx.x, state = i / 4, r = i % 4;
  if (state >= states) return;
  if (r == 3) hit[state] = 0;
  float row[4] = {r == 0 ? 1.0f : 0.0f, r == 1 ? 1.0f : 0.0f, r == 2 ? 1.0f : 0.0f, 0};
  auto* out = reinterpret_cast<float*>(centres + std::uint64_t{state} * kSpheres) + r;
  int sphere = 0;
  for (int link = 0;; ++link) {
    for (; sphere < kSpheres && spheres[sphere].link == link; ++sphere) {
      const Sphere& s = spheres[sphere];
      out[4 * sphere] = r == 3 ? s.radius : row[0] * s.x + row[1] * s.y + row[2] * s.z + row[3];
    }
    if (link == kJoints) return;
    float sine, cosine;
    sincosf(positions[std::uint64_t{state} * kJoints + link], &sine, &cosine);
    const auto& f = joints[link].fixed;
    float before[4];
    for (int c = 0; c < 4; ++c)
      before[c] = row[0] * f[0][c] + row[1] * f[1][c] + row[2] * f[2][c] + (c == 3 ? row[3] : 0);
    row[0] = before[0] * cosine + before[1] * sine;
    row[1] = before[1] * cosine - before[0] * sine;
    row[2] = before[2];
    row[3] = before[3];
  }
}

// Whether a sphere touches a cuboid. For host and device.
__host__ __device__ inline bool touches(const Cuboid& box, const float4& s) {
  float squared = 0;
  for (int k = 0; k < 3; ++k) {
    const float* t = box.to_cuboid[k];
    const float beyond = fabsf(t[0] * s.x + t[1] * s.y + t[2] * s.z + t[3]) - box.half[k];
    squared += beyond > 0 ? beyond * beyond : 0;
  }
  return squared <= s.w * s.w;
}
__global__ void check_spheres(const float4* centres, std::uint32_t states, const Cuboid* cuboids, std::uint32_t count,
                              std::uint8_t* hit) {
  const std::uint64_t i = std::uint64_t{blockIdx.x} * kThreads + threadIdx.x;
  if (i >= std::uint64_t{states} * kSpheres) return;
  const float4 sphere = centres[i];
  for (std::uint32_t c = 0; c < count; ++c)
    if (touches(cuboids[c], sphere)) {
      hit[i / kSpheres] = 1;
      return;
    }
}

using Random = std::mt19937;
float uniform(Random& random, double low, double high) {
  return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
}

// Frames of the published Panda: turns about x by a quarter, and offsets in metres.
std::vector<Joint> panda() {
  constexpr float kTurn[kJoints] = {0, -1, 1, 1, -1, 1, 1};  // quarters about x
  constexpr float kAt[kJoints][3] = {{0, 0, 0.333f},        {0, 0, 0}, {0, -0.316f, 0}, {0.0825f, 0, 0},
                                     {-0.0825f, 0.384f, 0}, {0, 0, 0}, {0.088f, 0, 0}};
  std::vector<Joint> all(kJoints);
  for (int j = 0; j < kJoints; ++j) {
    const float s = kTurn[j], c = s == 0 ? 1.0f : 0.0f;
    all[j] = {{{1, 0, 0, kAt[j][0]}, {0, c, -s, kAt[j][1]}, {0, s, c, kAt[j][2]}}};
  }
  return all;
}
std::vector<Sphere> spheres_of_links(Random& random) {
  std::vector<Sphere> all;
  for (int i = 0; i < kSpheres; ++i)
    all.push_back({uniform(random, -0.04, 0.04), uniform(random, -0.04, 0.04), uniform(random, -0.1, 0.1),
                   uniform(random, 0.03, 0.07), i * (kJoints + 1) / kSpheres});
  return all;
}
std::vector<Cuboid> cuboids_around(std::uint32_t count, Random& random) {
  std::vector<Cuboid> all(count);
  for (Cuboid& box : all) {
    const double turn = uniform(random, -3, 3), far = uniform(random, 0.55, 1.0), at = uniform(random, -3, 3);
    const auto c = static_cast<float>(std::cos(turn)), s = static_cast<float>(std::sin(turn));
    const auto x = static_cast<float>(far * std::cos(at)), y = static_cast<float>(far * std::sin(at));
    const float z = uniform(random, 0, 1.1);
    box = {{{c, s, 0, -(c * x + s * y)}, {-s, c, 0, s * x - c * y}, {0, 0, 1, -z}},
           {uniform(random, 0.03, 0.12), uniform(random, 0.03, 0.12), uniform(random, 0.03, 0.12)}};
  }
  return all;
}

template <class T>
void put(DeviceMemory& memory, const std::vector<T>& from) {
  memory.put(from.data(), from.size() * sizeof(T));
}

// Checks the states with all kernels in a CUDA graph.
// \returns whether the hits are those of the host for the same centres
bool run(std::uint32_t states, std::uint32_t count, std::ostream& csv) {
  Random random(7);
  std::vector<float> q(std::uint64_t{states} * kJoints);
  for (float& x : q) x = uniform(random, -2.5, 2.5);
  const std::vector<Sphere> robot = spheres_of_links(random);
  const std::vector<Cuboid> boxes = cuboids_around(count, random);
  cuda::check(cudaMemcpyToSymbol(spheres, robot.data(), sizeof(spheres)), "copying spheres");
  DeviceMemory positions(q.size() * sizeof(float)), cuboids(boxes.size() * sizeof(Cuboid)),
      centres(std::uint64_t{states} * kSpheres * sizeof(float4)), hit(states);
  put(positions, q);
  put(cuboids, boxes);
  auto* const at = reinterpret_cast<float4*>(centres.data());
  auto* const hits = reinterpret_cast<std::uint8_t*>(hit.data());
  DeviceStream stream;
  stream.capture([&] {
    const auto in = static_cast<cudaStream_t>(stream.get());
    place_spheres<<<cuda::blocks_of(std::uint64_t{states} * 4, kThreads), kThreads, 0, in>>>(
        reinterpret_cast<const float*>(positions.data()), states, at, hits);
    check_spheres<<<cuda::blocks_of(std::uint64_t{states} * kSpheres, kThreads), kThreads, 0, in>>>(
        at, states, reinterpret_cast<const Cuboid*>(cuboids.data()), count, hits);
  });
  std::vector<double> took;
  for (int i = -3; i < 100; ++i) {
    const double us = bench::took_us([&] {
      stream.launch();
      stream.wait();
    });
    if (i >= 0) took.push_back(us);
  }
  const double us = bench::median(std::move(took));
  const std::vector<std::byte> got = hit.get(), placed = centres.get();
  const auto* const s = reinterpret_cast<const float4*>(placed.data());
  std::uint32_t all = 0, other = 0;
  for (std::uint32_t k = 0; k < states; ++k) {
    all += got[k] != std::byte{0};
    if (k >= 4096) continue;
    bool is_hit = false;
    for (int i = 0; i < kSpheres; ++i)
      for (const Cuboid& box : boxes) is_hit = is_hit || touches(box, s[std::uint64_t{k} * kSpheres + i]);
    other += is_hit != (got[k] != std::byte{0});
  }
  csv << "61 spheres and " << count << " cuboids; nothing proved," << states << ',' << us << ',' << states / us << ','
      << static_cast<double>(all) / states << '\n';
  std::printf("61 spheres, %u cuboids, %8u states: %9.1f us in a graph, %6.1f M states/s, %4.1f %% hit, %u other\n",
              count, states, us, states / us, 100.0 * all / states, other);
  return all > 0 && all < states && other <= 4;  // the device fuses operations
}

}  // namespace
}  // namespace clearance::test

int main(int argc, char** argv) {
  using namespace clearance::test;
  std::ofstream csv(argc > 1 ? argv[1] : "gpu_floor.csv", std::ios::app);
  const std::vector<Joint> frames = panda();
  clearance::cuda::check(cudaMemcpyToSymbol(joints, frames.data(), sizeof(joints)), "copying joints");
  bool is_right = true;
  for (const std::uint32_t count : {12u, 21u})
    for (const std::uint32_t states : {4096u, 1u << 20}) is_right = run(states, count, csv) && is_right;
  return is_right ? 0 : 1;
}
