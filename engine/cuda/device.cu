// The device's side of the cuda backend: resident hulls, workspaces, launches.
#include <memory>
#include <mutex>
#include <unordered_map>

#include "device.h"
#include "engine/scene.h"
#include "memory.cuh"
#include "overlap_kernel.cuh"
#include "pair_kernel.cuh"
#include "place_kernel.cuh"
#include "reply_columns.h"

namespace clearance::cuda {

namespace {

constexpr std::size_t kMostVertices =
    512;  // of a hull that the device looks at vertex by vertex; the CPU answers for larger ones
constexpr int kMostShared = 96 * 1024;      // bytes of a block's two hulls; devices that have less get smaller tables
constexpr std::size_t kTableVertices = 16;  // fewer are scanned as fast
constexpr std::size_t kFewVertices = 4;     // of a list of a table that is not worth dividing further
constexpr std::uint32_t kNarrowDivided = 1u << 15;  // DirectionTable::kDivided in 16 bits
constexpr std::uint64_t kOverlapBlocks = 512;       // how many pairs overlap is not known when they start
constexpr std::uint32_t kRestAtOnce = 4096;         // unsettled rows that come back without a second copy

DeviceInfo probe() {
  DeviceInfo info;
  int count = 0;
  if (const cudaError_t error = cudaGetDeviceCount(&count); error != cudaSuccess || count == 0) {
    info.reason = error != cudaSuccess ? cudaGetErrorString(error) : "no CUDA device";
    return info;
  }
  int device = 0;
  cudaDeviceProp properties{};
  cudaError_t error = cudaGetDevice(&device);
  if (error == cudaSuccess) error = cudaGetDeviceProperties(&properties, device);
  // Also asks whether this build has code for it.
  cudaFuncAttributes attributes{};
  if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, answer_groups);
  info.name = properties.name;
  info.present = error == cudaSuccess;
  if (!info.present) info.reason = info.name + ": " + cudaGetErrorString(error);
  return info;
}

// The scene's hulls in device memory.
class ResidentHulls {
 public:
  /// \param most_shared bytes that two hulls may take of a block's shared memory.
  ResidentHulls(const Scene& scene, int most_shared, MemoryCounters& counters)
      : most_shared_(static_cast<std::uint32_t>(most_shared)), memory_(counters) {
    std::vector<HullHead> heads;
    std::vector<double> x, y, z;
    std::vector<std::uint16_t> words;
    std::unordered_map<const Piece*, std::uint32_t> index;
    for (const Body& body : scene.bodies()) {
      const Piece& p = *body.pieces[0];
      if (body.pieces.size() > 1 || p.vertices.size() > kMostVertices) {
        of_body_.push_back(kNone);
        continue;
      }
      const auto [at, is_new] = index.try_emplace(&p, static_cast<std::uint32_t>(heads.size()));
      of_body_.push_back(at->second);
      if (!is_new) continue;
      HullHead head{p.centre,
                    p.half,
                    p.rho,
                    p.radius,
                    p.spread,
                    static_cast<std::uint32_t>(x.size()),
                    static_cast<std::uint32_t>(p.vertices.size()),
                    0,
                    0,
                    0,
                    0};
      add_table(p, head, words);
      heads.push_back(head);
      for (const Vec3d& v : p.vertices) {
        x.push_back(v.x);
        y.push_back(v.y);
        z.push_back(v.z);
      }
    }
    for (const HullHead& h : heads) shared_bytes_.push_back(shared_bytes(h));
    Upload& m = memory_;
    const std::size_t at_heads = m.add<HullHead>(heads), at_x = m.add<double>(x), at_y = m.add<double>(y),
                      at_z = m.add<double>(z), at_words = m.add<std::uint16_t>(words),
                      at_of = m.add<std::uint32_t>(of_body_);
    m.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying the scene to the device");
    m.forget_host();
    view_ = {m.at<HullHead>(at_heads),      m.at<double>(at_x),        m.at<double>(at_y), m.at<double>(at_z),
             m.at<std::uint16_t>(at_words), m.at<std::uint32_t>(at_of)};
  }
  const HullsView& view() const { return view_; }
  std::uint32_t of_body(std::uint32_t body) const { return of_body_[body]; }
  std::uint32_t bytes_in_shared_memory(std::uint32_t hull) const { return shared_bytes_[hull]; }

 private:
  // Finer than the CPU's: threads that run side by side wait for the longest list. A table that leaves no room for
  // another hull is left out.
  void add_table(const Piece& p, HullHead& head, std::vector<std::uint16_t>& words) const {
    if (p.vertices.size() < kTableVertices) return;
    const DirectionTable table = make_direction_table(p.vertices, p.rho, kFewVertices);
    if (std::max(table.cells.size(), table.lists.size()) >= kNarrowDivided) return;
    HullHead with_table = head;
    with_table.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    if (2 * shared_bytes(with_table) > most_shared_) return;
    words.resize((words.size() + 7) / 8 * 8);
    head.first_word = static_cast<std::uint32_t>(words.size());
    head.grid_bits = table.grid_bits;
    head.cell_words = static_cast<std::uint32_t>(table.cells.size());
    head.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    for (const std::uint32_t cell : table.cells)
      words.push_back(static_cast<std::uint16_t>(cell & DirectionTable::kDivided ? kNarrowDivided | cell : cell));
    words.insert(words.end(), table.lists.begin(), table.lists.end());
    words.resize((words.size() + 7) / 8 * 8);
  }

  std::uint32_t most_shared_;
  Upload memory_;
  std::vector<std::uint32_t> of_body_, shared_bytes_;
  HullsView view_;
};

class CudaPairs final : public ResidentPairs {
 public:
  CudaPairs(const ResidentHulls& hulls, MemoryCounters& counters, std::span<const PairRef> p,
            std::span<const std::uint32_t> at, std::span<const Group> g, std::span<const std::uint32_t> tiles)
      : memory_(counters) {
    const std::size_t at_pairs = memory_.add(p), at_position = memory_.add(at), at_groups = memory_.add(g),
                      at_tiles = memory_.add(tiles);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying pairs to the device");
    memory_.forget_host();
    pairs = memory_.at<PairRef>(at_pairs);
    position = memory_.at<std::uint32_t>(at_position);
    groups = memory_.at<Group>(at_groups);
    group_of_tile = memory_.at<std::uint32_t>(at_tiles);
    for (const Group& group : g) {
      if (group.hull_a == kNone) continue;
      const std::uint32_t both = hulls.bytes_in_shared_memory(group.hull_a) +
                                 (group.hull_a == group.hull_b ? 0 : hulls.bytes_in_shared_memory(group.hull_b));
      shared_bytes = std::max<std::size_t>(shared_bytes, both);
    }
  }

  const PairRef* pairs;
  const std::uint32_t* position;
  const Group* groups;
  const std::uint32_t* group_of_tile;
  std::size_t shared_bytes = 0;  ///< for the hulls of any group

 private:
  Upload memory_;
};

class CudaWorkspace final : public Workspace {
 public:
  CudaWorkspace(const ResidentHulls& hulls, MemoryCounters& counters, std::atomic<std::uint64_t>& kernel_ns,
                std::atomic<std::uint64_t>& launches)
      : hulls_(hulls), kernel_ns_(kernel_ns), launches_(launches), setup_(counters) {
    // Blocks of the chunk that was started first go first, so that its answers are on their way while the next are
    // computed.
    int least = 0, greatest = 0;
    check(cudaDeviceGetStreamPriorityRange(&least, &greatest), "asking for priorities");
    for (int i = 0; i < kSlots; ++i)
      slots_[i] = std::make_unique<Slot>(counters, std::max(greatest, least - (kSlots - 1 - i)));
  }

  // Nothing may run on after a job that was given up.
  ~CudaWorkspace() override { wait_for_all(); }
  void wait_for_all() {
    for (const auto& slot : slots_) cudaStreamSynchronize(slot->stream);
  }

  void begin(const QuerySetup& s) override {  // nothing is under way: whoever had this before waited when letting it go
    chunks_ = 0;
    question_ = s.question;
    fields_ = s.fields;
    given_count_ = s.given_count;
    setup_.clear();
    const std::size_t fixed = setup_.add(s.fixed), fixed_state = setup_.add(s.fixed_state),
                      moved_body = setup_.add(s.moved_body), source = setup_.add(s.source),
                      begin = setup_.add(s.chain_begin), chain = setup_.add(s.chain), own = setup_.add(s.own),
                      base = setup_.add(s.base), has_base = setup_.add(s.has_base);
    setup_.send(slots_[0]->stream);
    check(cudaEventRecord(ready_.event, slots_[0]->stream), "recording an event");
    for (int i = 1; i < kSlots; ++i)
      check(cudaStreamWaitEvent(slots_[i]->stream, ready_.event), "waiting for an event");
    bodies_ = {setup_.at<double>(fixed),
               setup_.at<std::uint8_t>(fixed_state),
               static_cast<std::uint32_t>(s.fixed_state.size()),
               nullptr,
               nullptr,
               setup_.at<std::uint32_t>(moved_body),
               static_cast<std::uint32_t>(s.moved_body.size()),
               s.components};
    moves_ = {nullptr,
              s.given_count,
              setup_.at<std::uint32_t>(source),
              setup_.at<Pose>(own),
              setup_.at<std::uint32_t>(begin),
              setup_.at<std::uint32_t>(chain),
              setup_.at<BodyPlacement>(base),
              setup_.at<std::uint8_t>(has_base)};
    pairs_ = static_cast<const CudaPairs*>(s.pairs);
  }

  Pose* room_for_poses(int slot, std::size_t count) override {
    return reinterpret_cast<Pose*>(slots_[slot]->host_poses.reserve(count * sizeof(Pose)));
  }

  void launch(int index, const ChunkSetup& chunk, const ReplyView& direct) override {
    Slot& slot = *slots_[index];
    const std::uint64_t rows = chunk.rows();
    ChunkView view;
    view.hulls = hulls_.view();
    view.bodies = bodies_;
    view.question = question_;
    if (bodies_.moved_count > 0) place(slot, chunk, view.bodies);

    std::uint64_t reply_bytes = 0;
    reply_view_over(nullptr, rows, fields_, &reply_bytes);
    view.reply = reply_view_over(slot.device_reply.reserve(reply_bytes), rows, fields_);
    const std::size_t counts_bytes = (kCounts + rows) * sizeof(std::uint32_t);
    view.counts = reinterpret_cast<std::uint32_t*>(slot.device_rest.reserve(counts_bytes));
    view.rest = view.counts + kCounts;
    view.enclosed = question_.prove_overlaps
                        ? reinterpret_cast<Enclosed*>(slot.device_enclosed.reserve(rows * sizeof(Enclosed)))
                        : nullptr;
    view.pairs = pairs_->pairs + chunk.first_pair;
    view.position = pairs_->position + chunk.first_pair;
    view.pair_count = chunk.pair_count;
    view.configurations = chunk.configurations;
    view.first_configuration = chunk.first_configuration;

    check(cudaMemsetAsync(view.counts, 0, kCounts * sizeof(std::uint32_t), slot.stream), "clearing counters");
    check(cudaEventRecord(slot.begun.event, slot.stream), "recording an event");
    if (chunk.group_tiles > 0) {
      view.groups = pairs_->groups;
      view.group_of_tile = pairs_->group_of_tile + chunk.first_tile;
      answer_groups<<<chunk.group_tiles, kTile, pairs_->shared_bytes, slot.stream>>>(view);
    }
    if (chunk.strays != kNone) {
      view.groups = pairs_->groups + chunk.strays;
      answer_strays<<<chunk.stray_tiles, kTile, 0, slot.stream>>>(view);
    }
    if (question_.prove_overlaps) {
      const auto blocks = static_cast<unsigned>(std::min<std::uint64_t>((rows + kTile - 1) / kTile, kOverlapBlocks));
      prove_overlaps<<<blocks, kTile, 0, slot.stream>>>(view);
    }
    check(cudaGetLastError(), "starting a kernel");
    slot.chunk = chunks_++;
    check(cudaEventRecord(ended_[slot.chunk % (kSlots + 1)].event, slot.stream), "recording an event");
    ++launches_;

    slot.rows = rows;
    slot.device_view = view;
    slot.host_view = reply_view_over(slot.host_reply.reserve(reply_bytes), rows, fields_);
    bring(slot, direct);
    slot.host_counts = reinterpret_cast<std::uint32_t*>(slot.host_rest.reserve(counts_bytes));
    const std::size_t at_once = (kCounts + std::min<std::uint64_t>(rows, kRestAtOnce)) * sizeof(std::uint32_t);
    check(cudaMemcpyAsync(slot.host_counts, view.counts, at_once, cudaMemcpyDeviceToHost, slot.stream),
          "copying counters");
  }

  ChunkResult finish(int index) override {
    Slot& slot = *slots_[index];
    check(cudaStreamSynchronize(slot.stream), "answering a query");
    const std::uint32_t rest = slot.host_counts[kRest];
    std::uint32_t* const listed = slot.host_counts + kCounts;
    if (rest > kRestAtOnce) {
      check(cudaMemcpyAsync(listed + kRestAtOnce, slot.device_view.rest + kRestAtOnce,
                            (rest - kRestAtOnce) * sizeof(std::uint32_t), cudaMemcpyDeviceToHost, slot.stream),
            "copying rows");
      check(cudaStreamSynchronize(slot.stream), "copying rows");
    }
    kernel_ns_ += static_cast<std::uint64_t>(1e6 * kernel_milliseconds(slot));
    return {slot.host_view, {listed, rest}, slot.host_counts[kSettledRows]};
  }

 private:
  struct Event {
    cudaEvent_t event{};
    Event() { check(cudaEventCreate(&event), "making an event"); }
    ~Event() { cudaEventDestroy(event); }
    Event(const Event&) = delete;
  };
  struct Slot {
    Slot(MemoryCounters& c, int priority)
        : device_poses(c),
          device_bodies(c),
          device_reply(c),
          device_rest(c),
          device_enclosed(c),
          host_poses(c),
          host_reply(c),
          host_rest(c) {
      check(cudaStreamCreateWithPriority(&stream, cudaStreamNonBlocking, priority), "making a stream");
    }
    ~Slot() { cudaStreamDestroy(stream); }
    Slot(const Slot&) = delete;

    cudaStream_t stream{};
    Event begun;
    std::uint64_t chunk = 0;  // of the query
    DeviceBuffer device_poses, device_bodies, device_reply, device_rest, device_enclosed;
    PinnedBuffer host_poses, host_reply, host_rest;
    std::uint64_t rows = 0;
    ChunkView device_view;
    ReplyView host_view;
    std::uint32_t* host_counts = nullptr;
  };

  // Since the chunk's kernels began, or since the chunk before ended if they ran side by side.
  float kernel_milliseconds(const Slot& slot) {
    const cudaEvent_t ended = ended_[slot.chunk % (kSlots + 1)].event;
    float alone = 0, after = 0;
    check(cudaEventElapsedTime(&alone, slot.begun.event, ended), "reading events");
    if (slot.chunk == 0) return alone;
    check(cudaEventElapsedTime(&after, ended_[(slot.chunk - 1) % (kSlots + 1)].event, ended), "reading events");
    return std::max(0.0f, std::min(alone, after));
  }

  void place(Slot& slot, const ChunkSetup& chunk, BodiesView& bodies) {
    const std::size_t given_bytes = sizeof(Pose) * given_count_ * chunk.configurations;
    std::byte* given = slot.device_poses.reserve(given_bytes);
    check(cudaMemcpyAsync(given, slot.host_poses.data(), given_bytes, cudaMemcpyHostToDevice, slot.stream),
          "copying poses");
    const std::size_t states = std::size_t{bodies.moved_count} * chunk.configurations,
                      numbers = states * bodies.components;
    std::byte* memory = slot.device_bodies.reserve(numbers * sizeof(double) + states);
    bodies.moved = reinterpret_cast<double*>(memory);
    bodies.moved_state = reinterpret_cast<std::uint8_t*>(memory + numbers * sizeof(double));
    MovesView moves = moves_;
    moves.given = reinterpret_cast<const Pose*>(given);
    place_bodies<<<static_cast<unsigned>((states + 127) / 128), 128, 0, slot.stream>>>(hulls_.view(), bodies, moves,
                                                                                       chunk.configurations);
    check(cudaGetLastError(), "starting a kernel");
  }

  // Copies columns to where they are wanted; those that wait in the workspace lie side by side and go at once.
  void bring(Slot& slot, const ReplyView& direct) {
    const std::byte *from = nullptr, *to = nullptr;
    std::byte* target = nullptr;
    const auto flush = [&] {
      if (from != to)
        check(cudaMemcpyAsync(target, from, to - from, cudaMemcpyDeviceToHost, slot.stream), "copying answers");
      from = to = nullptr;
    };
    const auto column = [&]<class T>(T* device, T* host, T* caller, std::size_t width) {
      if (!device) return;
      const std::size_t bytes = slot.rows * width * sizeof(T);
      const auto* begin = reinterpret_cast<const std::byte*>(device);
      if (caller) {
        check(cudaMemcpyAsync(caller, device, bytes, cudaMemcpyDeviceToHost, slot.stream), "copying answers");
        return;
      }
      auto* destination = reinterpret_cast<std::byte*>(host);
      if (from == nullptr || destination - target != begin - from) {
        flush();
        from = begin;
        target = destination;
      }
      to = begin + bytes;
    };
    const ReplyView &d = slot.device_view.reply, &h = slot.host_view;
    for_each_column(column, d, h, direct);
    flush();
  }

  const ResidentHulls& hulls_;
  std::atomic<std::uint64_t>&kernel_ns_, &launches_;
  Question question_;
  std::uint32_t fields_ = 0, given_count_ = 0;
  Upload setup_;
  BodiesView bodies_;
  MovesView moves_;
  const CudaPairs* pairs_ = nullptr;
  Event ready_;
  Event ended_[kSlots + 1];  // of chunks, by their number
  std::uint64_t chunks_ = 0;
  std::unique_ptr<Slot> slots_[kSlots];
};

int most_shared() {
  int device = 0, bytes = 0;
  check(cudaGetDevice(&device), "asking for the device");
  check(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
        "asking for its shared memory");
  return std::min(bytes, kMostShared);
}

class CudaDevice final : public Device, public std::enable_shared_from_this<CudaDevice> {
 public:
  explicit CudaDevice(const Scene& scene) : hulls_(scene, most_shared(), scene_memory_) {
    check(cudaFuncSetAttribute(answer_groups, cudaFuncAttributeMaxDynamicSharedMemorySize, most_shared()),
          "asking for shared memory");
  }

  std::uint32_t hull_of(std::uint32_t body) const override { return hulls_.of_body(body); }

  std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs, std::span<const std::uint32_t> position,
                                              std::span<const Group> groups,
                                              std::span<const std::uint32_t> group_of_tile) override {
    return std::make_shared<CudaPairs>(hulls_, query_memory_, pairs, position, groups, group_of_tile);
  }

  std::shared_ptr<Workspace> borrow() override {
    std::unique_ptr<CudaWorkspace> workspace;
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        workspace = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!workspace) workspace = std::make_unique<CudaWorkspace>(hulls_, query_memory_, kernel_ns_, launches_);
    return {workspace.release(), [self = shared_from_this()](Workspace* w) {
              std::unique_ptr<CudaWorkspace> returned(static_cast<CudaWorkspace*>(w));
              returned->wait_for_all();  // a job that was given up may still write to its caller's memory
              const std::lock_guard lock(self->mutex_);
              self->free_.push_back(std::move(returned));
            }};
  }

  DeviceCounters counters() const override {
    DeviceCounters c;
    c.scene_bytes = scene_memory_.device_bytes;
    c.query_bytes = query_memory_.device_bytes;
    c.pinned_bytes = query_memory_.pinned_bytes;
    c.allocations = query_memory_.allocations;
    c.kernel_ns = kernel_ns_;
    c.launches = launches_;
    return c;
  }

 private:
  MemoryCounters scene_memory_, query_memory_;
  std::atomic<std::uint64_t> kernel_ns_{0}, launches_{0};
  ResidentHulls hulls_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<CudaWorkspace>> free_;
};

}  // namespace

const DeviceInfo& device_info() {
  static const DeviceInfo info = probe();
  return info;
}

std::shared_ptr<Device> make_device(const Scene& scene) {
  if (!device_info().present) throw std::runtime_error(device_info().reason);
  return std::make_shared<CudaDevice>(scene);
}

bool is_pinned(const void* memory) {
  cudaPointerAttributes attributes{};
  if (!memory || cudaPointerGetAttributes(&attributes, memory) != cudaSuccess) {
    cudaGetLastError();
    return false;
  }
  return attributes.type == cudaMemoryTypeHost;
}

PinnedMemory::PinnedMemory(std::size_t bytes) : data_(PinnedKind::allocate(bytes)) {}
PinnedMemory::~PinnedMemory() {
  PinnedKind::release(data_);
}

}  // namespace clearance::cuda
