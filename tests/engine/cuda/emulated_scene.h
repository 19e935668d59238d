// Scenes in the layout of kernels emulated without a GPU (emulated_cuda.h). Kernels are in a separate namespace, since
// a build with CUDA also has them in clearance::cuda. Include further kernels after this, with `cuda` defined as
// `emulated`.
#pragma once

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>

#include "engine/device/device.h"
#include "engine/device/hull_arrays.h"
#include "engine/device/placed_slots.h"
#include "engine/device/query/device_movers.h"
#include "engine/device/query/device_uncertainty.h"
#include "engine/device/query/moved_chains.h"
#include "engine/narrow/overlap.h"
#include "engine/narrow/part_search.h"
#include "engine/narrow/witness.h"
#include "tests/engine/cuda/same_answer.h"
// After all other headers.
#include "tests/engine/cuda/emulated_cuda.h"
namespace clearance::emulated {
using namespace clearance::cuda;
using clearance::cuda::Group;       // not the scene's
using clearance::cuda::PairLimits;  // not the plan's
}  // namespace clearance::emulated
#define cuda emulated
#include "engine/cuda/place/place_kernel.cuh"
#undef cuda

namespace clearance::test {

using namespace clearance::emulated;

inline constexpr std::uint32_t kMostShared = 96 * 1024;  // bytes for a block's two hulls

// Runs a kernel whose threads do not wait for each other.
template <class Kernel>
void for_each_thread(std::size_t threads, const Kernel& kernel) {
  blockDim = {1, 1, 1};
  threadIdx = {0, 0, 0};
  for (std::size_t t = threads; t-- > 0;) {  // in reverse, since a device has no order
    blockIdx = {static_cast<unsigned>(t), 0, 0};
    kernel();
  }
}

// A query at the scene's current poses, resolved as by the engine.
inline Plan plan_of(const engine::Scene& scene, const QueryView& q) {
  const PoseStore poses(scene, std::chrono::nanoseconds(0));
  Plan plan = make_plan(q, scene, poses.snapshot(), ~std::uint64_t{0}, true);
  plan.begun_ns = monotonic_ns();
  plan.uncertainties = uncertainties_of(scene, *plan.snapshot, plan.begun_ns);
  return plan;
}

// Placed bodies of a plan, some of them moved.
struct HostBodies {
  static constexpr std::size_t kComponents = kPoseComponents + kBoxComponents;
  Plan plan;
  MovedChains chains;
  DeviceUncertainty uncertainties;
  bool uncertain;
  std::vector<double> fixed, moved, fixed_part_box, moved_part_box;
  std::vector<std::uint8_t> fixed_state, moved_state;
  std::vector<OuterBox> fixed_box, moved_box;
  std::vector<std::uint32_t> moved_part_begin, placed;
  std::vector<BodySlack> moved_slack;
  std::vector<double> frame_numbers, travels;
  std::vector<std::uint8_t> frame_facts;
  BodiesView view{};
  MovesView moves{};

  /// \param all also places the bodies that no kernel reads
  HostBodies(const engine::Scene& scene, const HullsView& hulls, const QueryView& q, bool all = false)
      : plan(plan_of(scene, q)),
        chains(scene, plan),
        uncertainties(uncertainties_for(scene)),
        uncertain(uncertain_body(scene, plan) != kNone) {
    const MovedSetup m = chains.setup();
    const UncertaintySetup u = uncertain ? uncertainties.setup() : UncertaintySetup();
    const std::size_t n = scene.bodies().size(), M = plan.moved.size(), K = plan.size.configurations;
    take_fixed(hulls, n);
    view.uncertainties = {u.fixed_slack.data(), nullptr, u.links.data(), u.link_pairs.data()};
    for_each_thread(n, [&] { box_fixed_bodies(hulls, view, fixed.data() + kPoseComponents * n, fixed_box.data()); });
    reserve_moved(hulls, K, M);
    find_placed(scene, hulls, m, q, all);
    moves = {plan.configurations.data(),
             m.given_count,
             m.source.data(),
             m.own.data(),
             m.chain_begin.data(),
             m.chain.data(),
             m.base.data(),
             m.has_base.data(),
             m.slot_state.data(),
             place_frames(m.robots, K),
             u.steps.data(),
             u.base.data(),
             placed.data(),
             static_cast<std::uint32_t>(placed.size())};
    const auto configurations = static_cast<std::uint32_t>(K);
    for_each_thread(K * placed.size(), [&] {
      uncertain ? place_bodies<true>(hulls, view, moves, configurations)
                : place_bodies<false>(hulls, view, moves, configurations);
    });
  }
  HostBodies(const HostBodies&) = delete;

  /// The query's pairs in the layout of kernels.
  std::vector<PairRef> refs() const {
    std::vector<PairRef> refs;
    const auto ref = [&](std::uint32_t body) {
      const auto slot =
          static_cast<std::uint32_t>(std::find(plan.moved.begin(), plan.moved.end(), body) - plan.moved.begin());
      return slot < plan.moved.size() ? slot | kMovedBit : body;
    };
    for (const BodyPair pair : plan.pairs.list()) refs.push_back({ref(pair.a), ref(pair.b)});
    return refs;
  }

 private:
  DeviceUncertainty uncertainties_for(const engine::Scene& scene) {
    if (plan.uncertainties.empty()) plan.uncertainties.resize(scene.bodies().size());
    return {scene, plan};
  }
  void find_placed(const engine::Scene& scene, const HullsView& hulls, const MovedSetup& m, const QueryView& q,
                   bool all) {
    QuerySetup s;
    s.moved = m;
    std::unique_ptr<DeviceMovers> movers;
    if (q.fields & kFieldGradientJoints) {
      movers = std::make_unique<DeviceMovers>(JointGradient(scene, plan), plan);
      s.movers = movers->setup();
    }
    placed = placed_slots(s, [&](std::uint32_t body) {
      const Body& of = scene.bodies()[body];
      return all || hulls.part_begin[body] < hulls.part_begin[body + 1] || has_surface(of) || is_cloud(of);
    });
  }
  void take_fixed(const HullsView& hulls, std::size_t n) {
    fixed.assign(n * kComponents, 1e300);  // entries of bodies without a pose are not read
    for (std::size_t b = 0; b < n; ++b) {
      const BodyPlacement& at = plan.snapshot->placed[b];
      fixed_state.push_back(static_cast<std::uint8_t>(at.status) | (at.renormalised ? kStateRenormalised : 0) |
                            (at.beyond_limits ? kStateBeyondLimits : 0));
      if (at.status != Status::kOk) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t r = 0; r < 3; ++r) fixed[(3 * r + c) * n + b] = at.pose.R_wb.row[r][static_cast<int>(c)];
        fixed[(9 + c) * n + b] = at.pose.t_w[static_cast<int>(c)];
      }
    }
    fixed_box.resize(n);
    fixed_part_box.resize(std::size_t{hulls.part_begin[n]} * kBoxComponents);
    view.fixed = fixed.data();
    view.fixed_state = fixed_state.data();
    view.fixed_box = fixed_box.data();
    view.fixed_part_box = fixed_part_box.data();
    view.bodies = static_cast<std::uint32_t>(n);
    view.components = kComponents;
  }
  FramesView place_frames(const RobotsSetup& s, std::size_t K) {
    frame_numbers.assign(s.frames * 7 * K, 1e300);
    frame_facts.assign(s.frames * K, 0xff);
    travels.resize(s.robots.size() * K);
    const FramesView frames{
        s.steps.data(), s.columns.data(),      s.robots.data(),      static_cast<std::uint32_t>(s.robots.size()),
        s.joints,       plan.positions.data(), frame_numbers.data(), frame_facts.data(),
        travels.data()};
    for_each_thread(s.robots.size() * K, [&] { place_links(frames, static_cast<std::uint32_t>(K)); });
    return frames;
  }
  void reserve_moved(const HullsView& hulls, std::size_t K, std::size_t M) {
    std::uint32_t parts = 0;
    for (const std::uint32_t body : plan.moved) {
      moved_part_begin.push_back(parts);
      parts += hulls.part_begin[body + 1] - hulls.part_begin[body];
    }
    moved.assign(K * M * kComponents, 1e300);  // entries of bodies that are not placed are not read
    moved_state.resize(K * M);
    moved_box.resize(K * M);
    moved_part_box.resize(K * parts * kBoxComponents);
    moved_slack.resize(K * M);
    view.moved_box = moved_box.data();
    view.moved = moved.data();
    view.moved_state = moved_state.data();
    view.moved_body = plan.moved.data();
    view.moved_count = static_cast<std::uint32_t>(M);
    view.moved_part_box = moved_part_box.data();
    view.moved_part_begin = moved_part_begin.data();
    view.uncertainties.moved = moved_slack.data();
  }
};

/// Bodies of four shapes, some fixed; configurations of the others; and all pairs except those of two fixed bodies.
struct EmulatedCase {
  /// Bodies are at most `room` from the origin along each axis.
  /// \param first_shape adds the first of the shapes
  template <class AddFirst>
  EmulatedCase(std::uint32_t count, std::uint32_t configurations, double room, std::uint64_t seed,
               const AddFirst& first_shape) {
    Random random(seed);
    const auto stays = [](std::uint32_t b) { return b % 5 == 3; };
    for (std::uint32_t b = 0; b < count; ++b) {
      const engine::Scene::BodyOptions options{.is_static = stays(b), .pose = random.pose(room)};
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
  /// Call after changes.
  void point() {
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }

  engine::Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

}  // namespace clearance::test
