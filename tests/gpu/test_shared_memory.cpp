// Device queries whose poses are written and whose rows are read by another process, in device memory.
#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "engine/device/query/device_plan.h"
#include "engine/device/shared_memory.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/gpu/device_memory.h"

namespace clearance::test {
namespace {

namespace fs = std::filesystem;

std::string hex_of(const cuda::MemoryHandle& handle) {
  std::string hex;
  for (const std::byte byte : handle.ipc) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02x", static_cast<unsigned>(byte));
    hex += digits;
  }
  return hex;
}

// Starts the client program from this program's folder.
pid_t start_client(const std::string& what, const cuda::MemoryHandle& handle, const fs::path& file, std::size_t offset,
                   std::size_t bytes) {
  const std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "memory_client";
  const std::string hex = hex_of(handle), at = std::to_string(offset), size = std::to_string(bytes);
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl(program.c_str(), program.c_str(), what.c_str(), hex.c_str(), file.c_str(), at.c_str(), size.c_str(),
            static_cast<char*>(nullptr));
    ::_exit(127);
  }
  return child;
}
int status_of(pid_t child) {
  int status = -1;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return status;
}
// Waits until the child writes to a FIFO. Returns false if it ended without writing.
bool hears_from(pid_t child, const fs::path& fifo) {
  const int fd = ::open(fifo.c_str(), O_RDWR | O_CLOEXEC);
  pollfd heard{fd, POLLIN, 0};
  siginfo_t ended{};
  bool is_heard = false;
  do {
    ::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT);
    is_heard = ::poll(&heard, 1, ended.si_pid == 0 ? 20 : 0) == 1;
  } while (!is_heard && ended.si_pid == 0);
  ::close(fd);
  return is_heard;
}
// \returns its wait status
int run_client(const std::string& what, const cuda::MemoryHandle& handle, const fs::path& file, std::size_t offset,
               std::size_t bytes) {
  return status_of(start_client(what, handle, file, offset, bytes));
}

class SharedDeviceMemory : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_WITHOUT_DEVICE();
    std::string name = (fs::temp_directory_path() / "clearance-shared-XXXXXX").string();
    ASSERT_TRUE(::mkdtemp(name.data()));
    folder_ = name;
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }
  void write_over_there(const cuda::SharedMemory& memory, const std::vector<Pose>& poses) {
    const fs::path file = folder_ / "poses";
    const std::size_t bytes = poses.size() * sizeof(Pose);
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(poses.data()), static_cast<std::streamsize>(bytes));
    ASSERT_EQ(run_client("write", memory.handle(), file, 0, bytes), 0);
  }
  std::vector<char> read_over_there(const cuda::SharedMemory& memory, std::size_t offset, std::size_t bytes) {
    const fs::path file = folder_ / "rows";
    EXPECT_EQ(run_client("read", memory.handle(), file, offset, bytes), 0);
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  fs::path folder_;
};

engine::Scene some_bodies() {
  engine::Scene scene;
  Random random(31);
  for (int i = 0; i < 60; ++i) {
    const engine::Scene::BodyOptions options{.is_static = i % 6 == 5, .pose = random.pose(4)};
    const std::string name = "b" + std::to_string(i);
    if (i % 3 == 0)
      scene.add_box(name, {0.5, 1, 0.25}, options);
    else if (i % 3 == 1)
      scene.add_capsule(name, 0.2, 0.5, options);
    else
      scene.add_hull(name, cloud_on_sphere(60, 0.5, 4), options);
  }
  return scene;
}

std::vector<char> chars_of(const std::vector<std::byte>& bytes) {
  std::vector<char> chars(bytes.size());
  std::memcpy(chars.data(), bytes.data(), bytes.size());
  return chars;
}

constexpr std::uint32_t kConfigurations = 40;

TEST_F(SharedDeviceMemory, GivesAnotherProcessTheBitsThatAPlanHasHere) {
  const engine::Engine engine(some_bodies(), {"cuda"});
  const std::vector<std::uint32_t> moved{0, 1, 2, 9, 13};
  for (const Precision precision : {Precision::kF64, Precision::kF32})
    for (const std::uint32_t fields : {kDefaultFields | kFieldBounds, kFloat32}) {
      std::vector<Pose> poses(kConfigurations * moved.size());
      QueryView q;
      q.precision = precision;
      q.fields = fields;
      q.configuration_count = kConfigurations;
      q.bodies = moved;
      q.configurations = poses;
      const auto plan = engine.plan_on_device(q);
      const QuerySize size = plan->size();
      ASSERT_GT(size.rows, 1000u);
      std::uint64_t bytes = 0;
      reply_view_over(nullptr, size.rows, size.fields, &bytes);
      const std::size_t first = (poses.size() * sizeof(Pose) + 63) / 64 * 64;
      cuda::SharedMemory memory(plan->device(), first + bytes);
      DeviceMemory own_poses(poses.size() * sizeof(Pose)), own_rows(bytes);
      own_rows.fill(0);
      const ReplyView shared = reply_view_over(memory.data() + first, size.rows, size.fields);
      EXPECT_EQ(read_over_there(memory, first, bytes), std::vector<char>(bytes)) << "what somebody else left there";
      std::vector<char> before;
      Random random(11);
      for (int turn = 0; turn < 2; ++turn) {
        for (Pose& pose : poses) pose = random.pose(4);
        write_over_there(memory, poses);
        plan->run({.poses = reinterpret_cast<const Pose*>(memory.data())}, shared, memory.stream());
        memory.wait();
        const std::vector<char> over_there = read_over_there(memory, first, bytes);
        own_poses.put(poses.data(), own_poses.size());
        DeviceStream stream;
        plan->run({.poses = reinterpret_cast<const Pose*>(own_poses.data())},
                  reply_view_over(own_rows.data(), size.rows, size.fields), stream.get());
        stream.wait();
        EXPECT_TRUE(over_there == chars_of(own_rows.get())) << "turn " << turn << ", fields " << fields;
        EXPECT_FALSE(over_there == before) << "these poses give other rows";
        before = over_there;
      }
    }
}

TEST_F(SharedDeviceMemory, OutlivesAProcessThatIsKilledWithAMapping) {
  cuda::SharedMemory memory(0, 4096);
  std::vector<Pose> poses(20);
  Random random(3);
  for (Pose& pose : poses) pose = random.pose(1);
  write_over_there(memory, poses);
  const std::size_t bytes = poses.size() * sizeof(Pose);
  const int status = run_client("die", memory.handle(), "/dev/null", 0, 0);
  ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << status;
  memory.wait();
  const std::vector<char> now = read_over_there(memory, 0, bytes);
  ASSERT_EQ(now.size(), bytes);
  EXPECT_EQ(std::memcmp(now.data(), poses.data(), bytes), 0);
}

// CUDA does not define a mapping of freed memory. A process that keeps its mapping must not see later contents of that
// memory.
TEST_F(SharedDeviceMemory, ShowsNothingOfWhatComesAfterItToWhoKeepsAMapping) {
  constexpr std::size_t kBytes = std::size_t{64} << 20;
  constexpr char kSecret = 0x5a;
  const fs::path file = folder_ / "held", mapped = folder_ / "held.mapped", go = folder_ / "held.go";
  ASSERT_EQ(::mkfifo(mapped.c_str(), 0600), 0);
  ASSERT_EQ(::mkfifo(go.c_str(), 0600), 0);
  pid_t child = 0;
  {
    const cuda::SharedMemory memory(0, kBytes);
    child = start_client("hold", memory.handle(), file, 0, kBytes);
    ASSERT_TRUE(hears_from(child, mapped)) << status_of(child);
  }
  std::vector<std::unique_ptr<DeviceMemory>> later;  // at any address
  for (int i = 0; i < 64; ++i) {
    later.push_back(std::make_unique<DeviceMemory>(i % 2 ? kBytes : kBytes / 32));
    later.back()->fill(kSecret);
  }
  const int said = ::open(go.c_str(), O_RDWR | O_CLOEXEC);  // whether or not the child still exists
  const int status = status_of(child);
  ::close(said);
  ASSERT_TRUE(WIFEXITED(status) && (WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == 3)) << status;
  std::ifstream in(file, std::ios::binary);
  const std::vector<char> seen{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  std::printf("a mapping whose memory was freed: %s\n",
              seen.empty() ? "cannot be read" : "reads what was there, or zeros");
  EXPECT_EQ(std::count(seen.begin(), seen.end(), kSecret), 0);
}

TEST_F(SharedDeviceMemory, NamesItsDevice) {
  const cuda::SharedMemory one(0, 1), other(0, 1);
  EXPECT_EQ(one.handle().uuid, other.handle().uuid);
  EXPECT_NE(one.handle().uuid, decltype(one.handle().uuid){});
  EXPECT_NE(one.handle().ipc, other.handle().ipc);
}

TEST_F(SharedDeviceMemory, IsRejectedWhereMemoryIsShort) {
  try {
    const cuda::SharedMemory memory(0, std::size_t{1} << 50);
    FAIL() << "a petabyte";
  } catch (const cuda::DeviceError& error) {
    EXPECT_EQ(error.kind, cuda::DeviceError::kNoMemory) << error.what();
  }
  const cuda::SharedMemory small(0, 1);  // the device still works
}

}  // namespace
}  // namespace clearance::test
