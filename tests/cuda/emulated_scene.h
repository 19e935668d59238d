// Scenes as kernels see them that run without a GPU (emulated_cuda.h). Kernels are in a namespace of their own: a build
// with CUDA has them in clearance::cuda, too. Include further ones behind this, with `cuda` defined as `emulated`.
#pragma once

#include <algorithm>
#include <limits>

#include "engine/device/device.h"
#include "engine/device/hull_arrays.h"
#include "engine/narrow/overlap.h"
#include "engine/narrow/piece_search.h"
#include "engine/narrow/witness.h"
#include "same_answer.h"
// Behind all that is included elsewhere.
#include "emulated_cuda.h"
namespace clearance::emulated {
using namespace clearance::cuda;
using clearance::cuda::Group;  // not the scene's
}  // namespace clearance::emulated
#define cuda emulated
#include "engine/cuda/place_kernel.cuh"
#undef cuda

namespace clearance::test {

using namespace clearance::emulated;

inline constexpr std::uint32_t kMostShared = 96 * 1024;  // bytes of a block's two hulls

// Calls a kernel whose threads do not wait for each other.
template <class Kernel>
void for_each_thread(std::size_t threads, const Kernel& kernel) {
  blockDim = {1, 1, 1};
  threadIdx = {0, 0, 0};
  for (std::size_t t = 0; t < threads; ++t) {
    blockIdx = {static_cast<unsigned>(t), 0, 0};
    kernel();
  }
}

// Bodies of a scene where they stand, some of them moved.
struct HostBodies {
  static constexpr std::size_t kComponents = kPoseComponents + kBoxComponents;
  std::vector<double> fixed, moved;
  std::vector<std::uint8_t> fixed_state, moved_state, has_base;
  std::vector<OuterBox> fixed_box, moved_box;
  std::vector<std::uint32_t> source, chain_begin;
  std::vector<Pose> own;
  std::vector<BodyPlacement> base;
  BodiesView view{};

  HostBodies(const Scene& scene, const HullsView& hulls, const QueryView& q) {
    const std::size_t n = scene.bodies().size(), M = q.bodies.size(), K = q.configuration_count;
    fixed.assign(n * kComponents, 1e300);  // of bodies without a pose nobody reads
    for (std::size_t b = 0; b < n; ++b) {
      const auto& pose = scene.bodies()[b].pose;
      const BodyPlacement at = place(pose ? &*pose : nullptr, nullptr);
      fixed_state.push_back(static_cast<std::uint8_t>(at.status) | (at.renormalised ? kStateRenormalised : 0));
      if (at.status != Status::kOk) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t r = 0; r < 3; ++r) fixed[(3 * r + c) * n + b] = at.pose.R_wb.row[r][static_cast<int>(c)];
        fixed[(9 + c) * n + b] = at.pose.t_w[static_cast<int>(c)];
      }
    }
    fixed_box.resize(n);
    moved.resize(K * M * kComponents);
    moved_state.resize(K * M);
    moved_box.resize(K * M);
    view.fixed = fixed.data();
    view.fixed_state = fixed_state.data();
    view.fixed_box = fixed_box.data();
    view.bodies = static_cast<std::uint32_t>(n);
    view.moved_box = moved_box.data();
    view.moved = moved.data();
    view.moved_state = moved_state.data();
    view.moved_body = q.bodies.data();
    view.moved_count = static_cast<std::uint32_t>(M);
    view.components = kComponents;
    for_each_thread(n, [&] { box_fixed_bodies(hulls, view, fixed.data() + kPoseComponents * n, fixed_box.data()); });
    has_base.assign(M, 0);
    own.resize(M);
    base.resize(M);
    for (std::uint32_t i = 0; i <= M; ++i) chain_begin.push_back(i);
    source = chain_begin;
    const MovesView moves{q.configurations.data(), view.moved_count, source.data(), own.data(),
                          chain_begin.data(),      source.data(),    base.data(),   has_base.data()};
    for_each_thread(K * M, [&] { place_bodies(hulls, view, moves, static_cast<std::uint32_t>(K)); });
  }
};

/// Bodies of four shapes, some of which stay, configurations of the others, and pairs of all but those that both stay.
struct EmulatedCase {
  /// \param first_shape adds the first of the shapes. \param room bodies are up to so far from the origin along each
  /// axis
  template <class AddFirst>
  EmulatedCase(std::uint32_t count, std::uint32_t configurations, double room, std::uint64_t seed,
               const AddFirst& first_shape) {
    Random random(seed);
    const auto stays = [](std::uint32_t b) { return b % 5 == 3; };
    for (std::uint32_t b = 0; b < count; ++b) {
      const Scene::BodyOptions options{.is_static = stays(b), .pose = random.pose(room)};
      const std::string name = "b" + std::to_string(b);
      switch (b % 4) {
        case 0:
          first_shape(scene, name, options);
          break;
        case 1:
          scene.add_hull(name, cloud_on_sphere(60, 0.5, 4), options);
          break;
        case 2:
          scene.add_box(name, {0.4, 0.7, 0.2}, options);
          break;
        default:
          scene.add_uv_sphere(name, 0.5, 5, options);
      }
      if (!stays(b)) bodies.push_back(b);
    }
    for (std::uint32_t a = 0; a < count; ++a)
      for (std::uint32_t b = a + 1; b < count; ++b)
        if (!stays(a) || !stays(b)) pairs.push_back(a % 2 ? BodyPair{a, b} : BodyPair{b, a});
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(room));
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    point();
  }
  /// After changes.
  void point() {
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }

  Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

/// A query's pairs as the kernels know them.
inline std::vector<PairRef> refs_of(const QueryView& q) {
  std::vector<PairRef> refs;
  const auto ref = [&](std::uint32_t body) {
    const auto slot = static_cast<std::uint32_t>(std::find(q.bodies.begin(), q.bodies.end(), body) - q.bodies.begin());
    return slot < q.bodies.size() ? slot | kMovedBit : body;
  };
  for (const BodyPair pair : q.pairs) refs.push_back({ref(pair.a), ref(pair.b)});
  return refs;
}

}  // namespace clearance::test
