// Baseline of shared memory: two processes, one mapping and one counter each way. Each side spins for a while, then
// sleeps in a futex. The request is copied in and out and the reply written once, as in any server.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <new>
#include <stdexcept>

#include "bench/latency/bench_floor.h"
#include "bench/latency/bench_samples.h"
#include "wire/shm_os.h"

namespace clearance::cli {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::chrono::nanoseconds kSpins[] = {0us, 20us, 200us, 2000us};
constexpr int kMostTrials = 201, kFewestTrials = 5;
constexpr std::chrono::nanoseconds kTrialTime = 20ms;  ///< per candidate spin time
constexpr std::chrono::nanoseconds kNap = 10ms;
constexpr std::chrono::seconds kGiveUp{5};
constexpr std::uint64_t kPage = 4096;

struct Line {
  alignas(64) std::atomic<std::uint32_t> count;  ///< messages sent so far in this direction
  std::atomic<std::uint32_t> waiting;            ///< whether the reader sleeps
};
struct Words {
  Line request, reply;
  alignas(64) std::atomic<std::int64_t> spin_ns;  ///< of both sides
};
static_assert(sizeof(Words) <= kPage);

/// A mapping with the counters, the request's bytes and the reply's.
class Memory {
 public:
  Memory(int fd, const EchoSize& size) : size_(size), bytes_(total(size)) {
    void* base = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (base == MAP_FAILED) throw std::runtime_error(std::string("floor: mmap: ") + std::strerror(errno));
    base_ = static_cast<std::byte*>(base);
  }
  ~Memory() { ::munmap(base_, bytes_); }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;

  static std::uint64_t round(std::uint64_t bytes) { return (bytes + kPage - 1) / kPage * kPage; }
  static std::uint64_t total(const EchoSize& size) {
    return kPage + round(size.request_bytes) + round(size.reply_bytes);
  }
  Words& words() { return *reinterpret_cast<Words*>(base_); }
  std::byte* request() { return base_ + kPage; }
  std::byte* reply() { return base_ + kPage + round(size_.request_bytes); }

 private:
  EchoSize size_;
  std::uint64_t bytes_;
  std::byte* base_ = nullptr;
};

void post(Line& line, std::uint32_t count) {
  line.count.store(count, std::memory_order_seq_cst);
  if (line.waiting.load(std::memory_order_seq_cst)) shm::futex_wake(line.count);
}

/// Waits until the line's count differs from `seen`; false after `timeout`.
bool await(Line& line, std::uint32_t seen, const Words& words, std::chrono::nanoseconds timeout) {
  const auto begin = Clock::now();
  do {
    for (int i = 0; i < 16; ++i) {
      if (line.count.load(std::memory_order_acquire) != seen) return true;
      shm::cpu_relax();
    }
  } while (Clock::now() - begin < std::chrono::nanoseconds(words.spin_ns.load(std::memory_order_relaxed)));
  for (;;) {
    line.waiting.store(1, std::memory_order_seq_cst);
    if (line.count.load(std::memory_order_seq_cst) == seen) shm::futex_wait(line.count, seen, kNap);
    line.waiting.store(0, std::memory_order_relaxed);
    if (line.count.load(std::memory_order_acquire) != seen) return true;
    if (Clock::now() - begin > timeout) return false;
  }
}

class ShmFloor final : public Floor {
 public:
  explicit ShmFloor(const EchoSize& size)
      : memfd_(make_memory(size)),
        memory_(memfd_.get(), size),
        request_(size.request_bytes),
        echo_(
            {"shm", std::to_string(memfd_.get()), std::to_string(size.request_bytes), std::to_string(size.reply_bytes)},
            memfd_.get()) {}

  bool exchange(std::chrono::nanoseconds held) override {
    request_to_hold(request_.data(), held);
    std::memcpy(memory_.request(), request_.data(), request_.size());
    const std::uint32_t seen = count_++;
    post(memory_.words().request, count_);
    while (!await(memory_.words().reply, seen, memory_.words(), kGiveUp))
      if (!echo_.alive()) throw std::runtime_error("floor: the echo process is gone");
    return true;
  }
  void tune(std::chrono::nanoseconds held) override {
    Samples best;
    for (const auto spin : kSpins) {
      memory_.words().spin_ns = spin.count();
      Samples samples;
      const auto first = Clock::now();
      for (int i = 0; i < kMostTrials && (i < kFewestTrials || Clock::now() - first < kTrialTime); ++i) {
        const auto begin = Clock::now();
        exchange(held);
        samples.add(std::chrono::nanoseconds(Clock::now() - begin).count());
      }
      if (best.size() == 0 || samples.percentile_us(0.5) < best.percentile_us(0.5)) {
        best = samples;
        spin_ = spin;
      }
    }
    memory_.words().spin_ns = spin_.count();
  }
  std::string description() const override {
    return "two processes on one memory, spinning " + std::to_string(spin_.count() / 1000) +
           " us before a futex (the best of 0, 20, 200 and 2000)";
  }

 private:
  static shm::UniqueFd make_memory(const EchoSize& size) {
    shm::UniqueFd fd(::memfd_create("clearance-bench", MFD_CLOEXEC));
    if (!fd || ::ftruncate(fd.get(), static_cast<off_t>(Memory::total(size))) != 0)
      throw std::runtime_error(std::string("floor: memfd: ") + std::strerror(errno));
    return fd;
  }

  shm::UniqueFd memfd_;
  Memory memory_;
  std::vector<std::byte> request_;
  std::uint32_t count_ = 0;
  std::chrono::nanoseconds spin_{0};
  EchoProcess echo_;
};

}  // namespace

std::unique_ptr<Floor> open_shm_floor(const std::string&, const EchoSize& size) {
  return std::make_unique<ShmFloor>(size);
}

int run_shm_echo(const std::vector<std::string>& arguments) {
  const EchoSize size{std::stoull(arguments.at(1)), std::stoull(arguments.at(2))};
  Memory memory(std::stoi(arguments.at(0)), size);
  std::vector<std::byte> request(size.request_bytes), reply(size.reply_bytes);
  if (::write(STDOUT_FILENO, "ready \n", 7) != 7) return 1;
  ::close(STDOUT_FILENO);
  for (std::uint32_t count = 0;;) {
    if (!await(memory.words().request, count, memory.words(), kGiveUp)) continue;
    std::memcpy(request.data(), memory.request(), request.size());
    hold(request.data());
    std::memcpy(memory.reply(), reply.data(), reply.size());
    post(memory.words().reply, ++count);
  }
}

}  // namespace clearance::cli
