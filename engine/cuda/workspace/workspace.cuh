// A query on the device: the poses of its bodies, and a few chunks in flight, each in its own stream.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "engine/cuda/memory/memory.cuh"
#include "engine/cuda/place/place.cuh"
#include "engine/cuda/workspace/resident.cuh"
#include "engine/device/device.h"
#include "engine/device/placed_slots.h"

namespace clearance::cuda {

/// Counters shared by all workspaces of a device.
struct WorkCounters {
  explicit WorkCounters(MemoryBudget& budget) : memory(budget) {}

  MemoryCounters memory;
  std::atomic<std::uint64_t> kernel_ns{0}, broad_phase_ns{0}, launches{0};
};

/// Members common to the slots of all chunks.
struct QuerySlot {
  QuerySlot(MemoryCounters& c, int priority)
      : device_given{DeviceBuffer(c), DeviceBuffer(c)},
        host_given{PinnedBuffer(c), PinnedBuffer(c)},
        device_frames(c),
        device_bodies(c) {
    check(cudaStreamCreateWithPriority(&stream, cudaStreamNonBlocking, priority), "making a stream");
  }
  ~QuerySlot() { cudaStreamDestroy(stream); }
  QuerySlot(const QuerySlot&) = delete;

  cudaStream_t stream{};
  bool is_under_way = false;     // the stream may still run work that reads or writes host memory
  DeviceBuffer device_given[2];  // by kind of input
  PinnedBuffer host_given[2];
  DeviceBuffer device_frames, device_bodies;
};

inline constexpr std::size_t kPartBoxBytes = 6 * sizeof(double);
inline constexpr std::size_t kGivenPart = 1u << 21;  // bytes copied at a time

/// Common part of dense and reduced workspaces.
/// \tparam Interface of device.h
/// \tparam Slot a QuerySlot
template <class Interface, class Slot>
class QuerySide : public Interface {
 public:
  static constexpr int kSlots = kChunksUnderWay;

  QuerySide(const ResidentHulls& hulls, WorkCounters& counters)
      : hulls_(hulls),
        counters_(counters),
        setup_(counters.memory),
        host_bodies_(counters.memory),
        all_given_{PinnedBuffer(counters.memory), PinnedBuffer(counters.memory)},
        device_bodies_(counters.memory) {
    // Chunks started earlier get higher priority, so that their answers are copied while the next are computed.
    int least = 0, greatest = 0;
    check(cudaDeviceGetStreamPriorityRange(&least, &greatest), "getting stream priorities");
    for (int i = 0; i < kSlots; ++i)
      slots_[i] = std::make_unique<Slot>(counters.memory, std::max(greatest, least - (kSlots - 1 - i)));
  }

  // No work of an abandoned job may run on.
  ~QuerySide() override {
    for (const auto& slot : slots_)
      if (slot) cudaStreamSynchronize(slot->stream);
  }
  void wait_for_all() {
    for (const auto& slot : slots_)
      if (std::exchange(slot->is_under_way, false)) cudaStreamSynchronize(slot->stream);
  }

  FixedBodies body_buffers(std::size_t bodies) override {
    const OnDevice here = on_device();
    fixed_count_ = static_cast<std::uint32_t>(bodies);
    std::byte* memory = host_bodies_.reserve(fixed_bytes());
    return {reinterpret_cast<double*>(memory + components_offset()), reinterpret_cast<std::uint8_t*>(memory)};
  }

  void begin(const QuerySetup& s) override {  // no work is in flight: the previous user waited on release
    const OnDevice here = on_device();
    slots_[0]->is_under_way = true;
    all_chunks_ = s.chunks;
    pair_limits_ = s.pair_limits;
    fields_ = s.fields;
    joints_ = s.moved.robots.joints;
    given_count_ = s.moved.given_count;
    const cudaStream_t stream = slots_[0]->stream;
    pack_setup(s);
    setup_.send(stream);
    send_bodies(s, stream);
    if (s.chunks > 1) check(cudaEventRecord(ready_.event, stream), "recording an event");
    for (int i = 1; i < kSlots && static_cast<std::uint64_t>(i) < s.chunks; ++i)
      check(cudaStreamWaitEvent(slots_[i]->stream, ready_.event), "waiting for an event");
    pairs_ = static_cast<const CudaPairs*>(s.pairs);
  }

  std::byte* chunk_input_buffer(Given given, int slot, std::size_t bytes) override {
    const OnDevice here = on_device();
    return slots_[slot]->host_given[static_cast<int>(given)].reserve(bytes);
  }
  std::byte* query_input_buffer(Given given, std::size_t bytes) override {
    const OnDevice here = on_device();
    return all_given_[static_cast<int>(given)].reserve(bytes);
  }

 protected:
  // Every kernel launch, event and allocation needs the scene's device to be current.
  OnDevice on_device() const { return OnDevice(hulls_.device()); }

  // The view of a chunk. Also enqueues the placement of its moved bodies.
  ChunkView view_of(Slot& slot, const ChunkSetup& chunk) {
    slot.is_under_way = true;
    ChunkView view{};
    view.hulls = hulls_.view();
    view.bodies = bodies_;
    view.pair_limits = pair_limits_;
    view.movers = movers_;
    if (pairs_) {
      view.pairs = pairs_->pairs + chunk.first_pair;
      view.position = pairs_->position + chunk.first_pair;
    }
    view.pair_count = chunk.pair_count;
    view.configurations = chunk.configurations;
    view.first_configuration = chunk.first_configuration;
    if (bodies_.moved_count > 0) place(slot, chunk, view.bodies);
    return view;
  }

  // Packs the arrays of a query, whose views point to them once they are sent.
  void pack_setup(const QuerySetup& s) {
    const MovedSetup& m = s.moved;
    const UncertaintySetup& u = s.uncertainty;
    find_moved_parts(m.bodies);
    setup_.clear();
    bodies_ = {};
    bodies_.moved_count = static_cast<std::uint32_t>(m.bodies.size());
    setup_.add(m.bodies, bodies_.moved_body);
    setup_.add(moved_part_begin_, bodies_.moved_part_begin);
    if (!u.fixed_slack.empty()) {
      setup_.add(u.fixed_slack, bodies_.uncertainties.fixed);
      setup_.add(u.links, bodies_.uncertainties.links);
      setup_.add(u.link_pairs, bodies_.uncertainties.link_pairs);
    }
    moves_ = {};
    moves_.given_count = given_count_;
    setup_.add(m.source, moves_.source);
    setup_.add(m.own, moves_.own);
    setup_.add(m.chain_begin, moves_.chain_begin);
    setup_.add(m.chain, moves_.chain);
    setup_.add(m.base, moves_.base);
    setup_.add(m.has_base, moves_.has_base);
    setup_.add(m.slot_state, moves_.slot_state);
    placed_ = placed_slots(s, [&](std::uint32_t body) { return hulls_.convex_parts_of(body) > 0; });
    setup_.add(placed_, moves_.placed);
    moves_.placed_count = static_cast<std::uint32_t>(placed_.size());
    setup_.add(u.steps, moves_.uncertainties);
    setup_.add(u.base, moves_.base_uncertainty);
    FramesView& frames = moves_.frames;
    frames.robot_count = static_cast<std::uint32_t>(m.robots.robots.size());
    frames.joints = joints_;
    setup_.add(m.robots.steps, frames.steps);
    setup_.add(m.robots.columns, frames.columns);
    setup_.add(m.robots.robots, frames.robots);
    frames_ = m.robots.frames;
    setup_.add(s.movers.movers, movers_.movers);
    setup_.add(s.movers.of_body, movers_.of_body);
    margins_ = nullptr;
    if (!s.margins.empty()) setup_.add(s.margins, margins_);
  }

  // One allocation: state, components, boxes, outer boxes, boxes of convex parts. Only state and components are copied
  // from the host.
  std::size_t components_offset() const { return (std::size_t{fixed_count_} + 15) / 16 * 16; }
  std::size_t fixed_bytes() const {
    return components_offset() + std::size_t{fixed_count_} * kPoseComponents * sizeof(double);
  }
  void send_bodies(const QuerySetup& s, cudaStream_t stream) {
    const std::size_t n = fixed_count_, boxes = s.boxes ? n * kBoxComponents * sizeof(double) : 0;
    const std::size_t outer_at = (fixed_bytes() + boxes + 15) / 16 * 16;
    const std::size_t parts_at = outer_at + (s.boxes ? n * sizeof(OuterBox) : 0);
    std::byte* memory = device_bodies_.reserve(parts_at + (hulls_.has_several() ? hulls_.parts() * kPartBoxBytes : 0));
    auto* outer = s.boxes ? reinterpret_cast<OuterBox*>(memory + outer_at) : nullptr;
    bodies_.fixed = reinterpret_cast<const double*>(memory + components_offset());
    bodies_.fixed_state = reinterpret_cast<const std::uint8_t*>(memory);
    bodies_.fixed_box = outer;
    if (hulls_.has_several()) bodies_.fixed_part_box = reinterpret_cast<double*>(memory + parts_at);
    bodies_.bodies = fixed_count_;
    bodies_.components = kPoseComponents + (s.boxes ? kBoxComponents : 0);
    if (n == 0) return;
    check(cudaMemcpyAsync(memory, host_bodies_.data(), fixed_bytes(), cudaMemcpyHostToDevice, stream), "copying poses");
    if (!s.boxes && !hulls_.has_several()) return;
    check(cudaEventRecord(boxes_begun_.event, stream), "recording an event");
    start_fixed_boxes(hulls_.view(), bodies_, reinterpret_cast<double*>(memory + fixed_bytes()), outer, stream);
  }

  // Offsets of the moved bodies' convex parts, if any body of the scene has several.
  void find_moved_parts(std::span<const std::uint32_t> moved) {
    moved_part_begin_.clear();
    moved_parts_ = 0;
    if (!hulls_.has_several()) return;
    for (const std::uint32_t body : moved) {
      moved_part_begin_.push_back(moved_parts_);
      moved_parts_ += hulls_.convex_parts_of(body);
    }
  }

  // Copies a chunk's input as it becomes available.
  // \param each numbers per configuration
  template <class T>
  const T* send_given(Slot& slot, const ChunkSetup& chunk, Given given, const T* from, std::size_t each) {
    const std::size_t bytes = each * chunk.configurations * sizeof(T);
    if (chunk.given_on_device || bytes == 0) return from;
    const auto* begin = reinterpret_cast<const std::byte*>(from);
    std::byte* const to = slot.device_given[static_cast<int>(given)].reserve(bytes);
    for (std::size_t i = 0; i < bytes; i += kGivenPart) {
      const std::size_t part = std::min(kGivenPart, bytes - i);
      if (chunk.wait_for) chunk.wait_for(given, begin + i + part);
      check(cudaMemcpyAsync(to + i, begin + i, part, cudaMemcpyHostToDevice, slot.stream), "copying configurations");
    }
    return reinterpret_cast<const T*>(to);
  }

  // Memory for a chunk's moved bodies: outer boxes, boxes of convex parts, components, slacks, states.
  struct MovedBytes {
    std::size_t states, boxes, parts, numbers, slacks;
    std::size_t bytes() const { return boxes + parts + numbers + slacks + states; }
  };
  MovedBytes moved_bytes(std::uint32_t configurations) const {
    const std::size_t states = std::size_t{bodies_.moved_count} * configurations;
    return {states, bodies_.fixed_box ? states * sizeof(OuterBox) : 0,
            std::size_t{moved_parts_} * configurations * kPartBoxBytes, states * bodies_.components * sizeof(double),
            bodies_.uncertainties.fixed ? states * sizeof(BodySlack) : 0};
  }

  // Memory for the frames of robots with moving joints: numbers, travels, facts.
  std::size_t frame_bytes(std::uint32_t configurations) const {
    return (std::size_t{frames_} * (7 * sizeof(double) + 1) + moves_.frames.robot_count * sizeof(double)) *
           configurations;
  }
  FramesView place_frames(Slot& slot, const ChunkSetup& chunk) {
    FramesView frames = moves_.frames;
    if (frames.robot_count == 0) return frames;
    const std::size_t K = chunk.configurations;
    frames.positions = send_given(slot, chunk, Given::kPositions, chunk.positions, frames.joints);
    frames.numbers = reinterpret_cast<double*>(slot.device_frames.reserve(frame_bytes(chunk.configurations)));
    frames.travels = frames.numbers + std::size_t{frames_} * 7 * K;
    frames.facts = reinterpret_cast<std::uint8_t*>(frames.travels + frames.robot_count * K);
    start_links(frames, chunk.configurations, slot.stream);
    return frames;
  }

  void place(Slot& slot, const ChunkSetup& chunk, BodiesView& bodies) {
    const Pose* given = send_given(slot, chunk, Given::kPoses, chunk.poses, given_count_);
    const MovedBytes moved = moved_bytes(chunk.configurations);
    const auto [states, boxes, parts, numbers, slacks] = moved;
    std::byte* memory = slot.device_bodies.reserve(moved.bytes());
    bodies.moved_box = bodies.fixed_box ? reinterpret_cast<OuterBox*>(memory) : nullptr;
    bodies.moved_part_box = parts > 0 ? reinterpret_cast<double*>(memory + boxes) : nullptr;
    bodies.moved = reinterpret_cast<double*>(memory + boxes + parts);
    bodies.uncertainties.moved = reinterpret_cast<BodySlack*>(memory + boxes + parts + numbers);
    bodies.moved_state = reinterpret_cast<std::uint8_t*>(memory + boxes + parts + numbers + slacks);
    MovesView moves = moves_;
    moves.given = given;
    moves.frames = place_frames(slot, chunk);
    start_bodies(hulls_.view(), bodies, moves, chunk.configurations, slot.stream);
  }

  const ResidentHulls& hulls_;
  WorkCounters& counters_;
  PairLimits pair_limits_;
  std::uint32_t fields_ = 0, joints_ = 0, given_count_ = 0;
  std::uint64_t all_chunks_ = 1;
  Upload setup_;
  PinnedBuffer host_bodies_, all_given_[2];
  DeviceBuffer device_bodies_;
  std::uint32_t fixed_count_ = 0;
  std::vector<std::uint32_t> moved_part_begin_, placed_;
  std::uint32_t moved_parts_ = 0, frames_ = 0;
  BodiesView bodies_;
  MovesView moves_;
  MoversView movers_{};
  const double* margins_ = nullptr;  // of the query's pairs; null if all margins are equal
  const CudaPairs* pairs_ = nullptr;
  Event ready_, boxes_begun_;
  std::unique_ptr<Slot> slots_[kSlots];
};

}  // namespace clearance::cuda
