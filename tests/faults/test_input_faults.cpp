// One daemon and more than a thousand invalid inputs, over each transport and through its files. After each of them
// every bit of a valid query's answer must be right.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <fstream>
#include <map>
#include <optional>

#include "tests/faults/arena.h"
#include "tests/faults/bad_frames.h"
#include "tests/faults/limits.h"
#include "tests/faults/raw_wire.h"
#include "tests/faults/rounds.h"
#include "tests/lcm/lcm_network.h"
#include "tests/patience.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

/// A tetrahedron as a binary STL file.
std::string stl() {
  std::string file(84, '\0');
  file[80] = 4;
  const float corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  for (const auto& face : faces) {
    file.append(12, '\0');
    for (const int corner : face) file.append(reinterpret_cast<const char*>(corners[corner]), 12);
    file.append(2, '\0');
  }
  return file;
}

class InputFaults : public testing::Test {
 protected:
  void SetUp() override {
    for (const std::string& url : arena_.urls()) {
      good_.emplace(url, patient(url));
      request_all(url);  // segments reach their final size
    }
    await_covers(good_.at(arena_.zmq()));
    before_ = arena_.census();
  }
  void TearDown() override {
    ASSERT_FALSE(arena_.has_ended()) << arena_.daemon().log();
    EXPECT_EQ(arena_.await_census(before_), "");
    const Stats now = stats_of(good_.at(arena_.zmq()));
    EXPECT_EQ(unbalanced(now), "");
    EXPECT_FALSE(now.contains("errors.internal"));
    EXPECT_FALSE(now.contains("errors.transport"));
    good_.clear();
    EXPECT_EQ(arena_.end(), 0);
  }

  void request_all(const std::string& url) {
    for (std::size_t i = 0; i < exam_.queries().size(); ++i) expect_good(url, "nothing");
  }
  /// The next query's answer, over the transport that had the bad input.
  void expect_good(const std::string& url, const std::string& after) {
    const KnownQuery& known = *exam_.queries()[requested_++ % exam_.queries().size()];
    ASSERT_TRUE(is_right(request_surely(good_.at(url), known), known)) << after;
    ++right_;
  }
  std::uint64_t counter(const std::string& name) { return stats_of(good_.at(arena_.zmq()))[name]; }

  /// Sends every kind of bad frame `rounds` times, and checks the outcome.
  void send_bad_frames(RawWire& wire, const std::string& url, int rounds) {
    std::map<std::string_view, int> rejected;
    for (int round = 0; round < rounds; ++round)
      for (const std::string_view kind : kBadKinds) {
        const Bytes frame = bad_frame(kind, ++id_, random_);
        const RawReply reply = wire.evaluate(frame);
        ASSERT_EQ(reply.header.request_id, id_) << kind;
        const bool is_error = reply.header.type == static_cast<std::uint16_t>(wire::FrameType::kError);
        rejected[kind] += is_error;
        EXPECT_TRUE(is_error || kind == kFlippedBits) << kind << " was answered";
        EXPECT_FALSE(is_error && reply.error.code == static_cast<std::uint16_t>(wire::ErrorCode::kInternal)) << kind;
        expect_good(url, std::string(kind));
        if (HasFatalFailure()) return;
      }
    for (const std::string_view kind : kBadKinds)
      EXPECT_GT(rejected[kind], kind == kFlippedBits ? 0 : rounds - 1) << kind;
  }
  Bytes noise(std::size_t size) {
    Bytes bytes(size);
    for (std::byte& b : bytes) b = static_cast<std::byte>(random_());
    return bytes;
  }

  TestFolder folder_;
  const std::string mesh_ = folder_.write("hull.stl", stl());
  const std::string yaml_ =
      "bodies:\n  - {name: part, mesh: hull.stl, mesh_as: hull, pose: [40,0,0, 1,0,0,0]}\n"
      "random: {count: 100, shape: {uv_sphere: {radius: 2, resolution: 5}}, box: 28, seed: 1}\n";
  const std::string scene_ = folder_.write("scene.yaml", yaml_);
  const Exam exam_{scene_, 5};
  Arena arena_{{}, scene_};
  std::map<std::string, Client> good_;  // by URL
  Census before_;
  std::mt19937_64 random_{11};
  std::uint64_t id_ = 0, requested_ = 0, right_ = 0;
};

TEST_F(InputFaults, FramesOverEveryTransport) {
  for (const std::string& url : arena_.urls()) {
    std::unique_ptr<RawWire> wire;
    if (url == arena_.shm()) wire = std::make_unique<RawShmWire>(url.substr(6));
    if (url == arena_.zmq()) wire = std::make_unique<RawZmqWire>(url);
    if (!wire) wire = std::make_unique<RawLcmWire>(url);
    send_bad_frames(*wire, url, 12 * rounds(1));
    if (HasFatalFailure()) return;
  }
  const std::size_t kinds = std::size(kBadKinds);
  EXPECT_GE(right_, arena_.urls().size() * (kinds * 12 + exam_.queries().size()));
  EXPECT_GE(counter("errors"), arena_.urls().size() * (kinds - 1) * 12);
}

TEST_F(InputFaults, WordsInTheRingAndMessagesOnItsSocket) {
  const std::string path = arena_.shm().substr(6);
  const std::uint32_t odd[] = {0, 1, 2, 15, 16, 17, 64, 255, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
  const auto any = [&] { return odd[random_() % std::size(odd)]; };
  const std::uint64_t violations = counter("shm.violations"), rejected = counter("shm.rejected");
  for (int i = 0; i < 80 * rounds(1); ++i) {
    RawClient client(path);
    // Avoids the one value that keeps the rules: slot below 16, generation 1, head 1.
    const std::uint32_t head = 17 + any() % 0xFFFFFF00u;
    client.post(shm::pack_ticket(any(), any()), random_() % 2 ? any() : std::uint64_t{any()} << 32, i % 2 ? head : 1);
    if (i % 2 == 0) client.post(shm::pack_ticket(16 + any() % 0xFFFFFF00u, 1), 64, 2);
    EXPECT_EQ(client.receive().kind, static_cast<std::uint32_t>(shm::MessageKind::kRejected)) << i;
    expect_good(arena_.shm(), "words in the ring");
    if (HasFatalFailure()) return;
  }
  EXPECT_GE(counter("shm.violations"), violations + 80);
  for (int i = 0; i < 80 * rounds(1); ++i) {
    RawClient client(path, i % 2 == 0);
    shm::Message message = RawClient::make(shm::MessageKind{random_() % 3 ? 3 : any()});
    message.segment_id = 7 + any() % 0xFFFFFF00u;
    message.request_capacity = std::uint64_t{any()} << random_() % 33;
    if (i % 4 == 1) message.magic ^= 1u << random_() % 32;
    if (i % 4 == 3) message.wire_version ^= 0x8000;
    client.send(message, i % 8 == 5 ? random_() % sizeof message : sizeof message);
    // It need only end or get an answer, because a request for space may be granted.
    shutdown(client.socket.get(), SHUT_WR);
    while (client.receive().kind != 0) {
    }
    expect_good(arena_.shm(), "messages on the socket");
    if (HasFatalFailure()) return;
  }
  EXPECT_GE(counter("shm.rejected") + counter("shm.violations"), rejected + violations + 120);
}

TEST_F(InputFaults, PartsOverZeroMqAndOtherPeersAtItsSocket) {
  std::optional<RawZmqWire> wire(arena_.zmq());
  const std::uint64_t bad = counter("errors.bad_frame");
  for (int i = 0; i < 80 * rounds(1); ++i) {
    std::vector<Bytes> parts(1 + random_() % 6);
    for (Bytes& part : parts) part = noise(random_() % 3 ? random_() % 130 : random_() % 5000);
    if (parts.size() == 2 && parts[0].size() == sizeof(wire::FrameHeader)) parts.pop_back();
    const RawReply reply = wire->request_parts(parts);
    EXPECT_EQ(reply.error.code, static_cast<std::uint16_t>(wire::ErrorCode::kBadFrame)) << i;
    expect_good(arena_.zmq(), "parts");
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(counter("errors.bad_frame"), bad + 80 * static_cast<std::uint64_t>(rounds(1)));
  wire.reset();
  const char greeting[] = "\xff\0\0\0\0\0\0\0\1\x7f\3\0NULL";
  for (int i = 0; i < 60 * rounds(1); ++i) {
    sockaddr_un address;
    ASSERT_TRUE(shm::socket_address(arena_.zmq().substr(6).c_str(), address));
    const shm::UniqueFd socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    Bytes said = noise(random_() % 3000);
    if (i % 3) {  // a valid start of a peer, then random bytes
      Bytes begun(64);
      std::memcpy(begun.data(), greeting, sizeof greeting);
      if (i % 3 == 1) begun.resize(random_() % 64);
      said.insert(said.begin(), begun.begin(), begun.end());
    }
    [[maybe_unused]] const auto sent = ::send(socket.get(), said.data(), said.size(), MSG_NOSIGNAL);
    expect_good(arena_.zmq(), "a stranger");
    if (HasFatalFailure()) return;
  }
}

TEST_F(InputFaults, PacketsOnTheLcmNetwork) {
  if (!arena_.has_lcm()) GTEST_SKIP() << "no multicast route";
  const LcmAddress address = parse_lcm_address(arena_.lcm());
  RawSender sender(address.port);
  const std::uint64_t bad = counter("lcm.bad_messages");
  clearance_lcm::frame_t part{};
  part.client_id = 1, part.parts = 1, part.frame_bytes = 64, part.byte_count = 64;
  part.bytes.resize(64);
  Bytes frame(static_cast<std::size_t>(part.getEncodedSize()));
  part.encode(frame.data(), 0, static_cast<int>(frame.size()));
  const char* const channels[] = {"CLEARANCE_POSES", "CLEARANCE_JOINTS", "CLEARANCE_QUERY", "CLEARANCE_FRAME_IN"};
  int on_a_channel = 0;
  for (int i = 0; i < 200 * rounds(1); ++i) {
    const std::string channel = address.prefix + channels[random_() % std::size(channels)];
    switch (i % 5) {
      case 0:
        sender.send(noise(random_() % 60000));
        break;
      case 1: {  // a channel without a terminator, a random fragment
        Bytes cut = RawSender::datagram(channel, {});
        cut.resize(random_() % cut.size());
        sender.send(cut);
        Bytes fragment = RawSender::big_endian({0x4c433033, 7, static_cast<std::uint32_t>(random_()),
                                                static_cast<std::uint32_t>(random_()),
                                                static_cast<std::uint32_t>(random_() % 5 << 16 | random_() % 5)});
        const Bytes tail = noise(random_() % 300);
        fragment.insert(fragment.end(), tail.begin(), tail.end());
        sender.send(fragment);
        break;
      }
      case 2:
        sender.send(RawSender::datagram(channel, noise(random_() % 2000)));
        ++on_a_channel;
        break;
      case 3:
        sender.send(RawSender::datagram(channel, std::span(frame).first(random_() % frame.size())));
        ++on_a_channel;
        break;
      default: {  // a random number instead of one of the frame's own: sizes, parts, counts
        Bytes odd = frame;
        for (int k = 0; k < 4; ++k) odd[40 + random_() % 20] = static_cast<std::byte>(random_());
        sender.send(RawSender::datagram(address.prefix + "CLEARANCE_FRAME_IN", odd));
      }
    }
    expect_good(arena_.lcm(), "packet " + std::to_string(i));
    if (HasFatalFailure()) return;
  }
  EXPECT_GE(counter("lcm.bad_messages"), bad + static_cast<std::uint64_t>(on_a_channel) / 2)
      << "a packet may be lost, not half of them";
}

TEST_F(InputFaults, ScenesAndMeshesAtAReload) {
  std::vector<std::string> scenes{
      "",
      "[]",
      "bodies: 3\n",
      "bodies: [{name: x}]\n",
      "bodies: [{name: x, sphere: nan}]\n",
      "\t- : :\n",
      "random: {count: 1e18, shape: {uv_sphere: {radius: 2, resolution: 5}}, box: 28, seed: 1}\n",
      "bodies: [{name: x, mesh: ../../../../etc/passwd}]\n",
      "bodies: [{name: x, mesh: nowhere.stl}]\n",
      "bodies: [{name: x, mesh: scene.yaml}]\n",
      "bodies: &a [*a, *a]\n",
      std::string(100'000, '['),
      std::string("bodies: [{name: \0x}]\n", 21),
      "bodies:\n  - {name: a, box: [1,1,1], parent: b}\n"};
  for (int i = 0; i < 9 * rounds(1); ++i) {
    std::string text = yaml_;
    if (i % 3 == 0) text.resize(random_() % text.size());
    for (int k = i % 3; k > 0; --k) text[random_() % text.size()] = static_cast<char>(random_());
    scenes.push_back(text);
  }
  std::vector<std::string> meshes;
  for (int i = 0; i < 8 * rounds(1); ++i) {
    std::string bytes = stl();
    if (i % 4 == 0) bytes.resize(random_() % bytes.size());
    if (i % 4 == 1) bytes += std::string(1 + random_() % 100, 'x');
    if (i % 4 == 2) bytes[80 + random_() % 4] ^= static_cast<char>(1 + random_() % 255);
    if (i % 4 == 3)
      for (char& c : bytes) c = static_cast<char>(random_());
    meshes.push_back(bytes);
  }
  Client& client = good_.at(arena_.zmq());
  const std::uint64_t revision = client.scene().revision;
  client.reload();
  await_covers(client);
  before_ = arena_.census();  // after one load, because OpenMP may keep a thread for it
  int rejected = 0, taken = 0;
  const auto reload = [&](const std::string& file, const std::string& bad, const std::string& good) {
    folder_.write(file, bad);
    bool is_new = false;
    try {
      is_new = client.reload().scene_revision != revision;  // a changed comment changes nothing
      ++taken;
    } catch (const RequestError& error) {
      EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kReloadFailed)) << error.what();
      ++rejected;
    }
    folder_.write(file, good);
    if (is_new) client.reload();
    for (const std::string& url : arena_.urls()) {
      if (is_new) good_.at(url).refresh();
      expect_good(url, "a reload of " + bad.substr(0, 200));
    }
  };
  for (const std::string& scene : scenes) ASSERT_NO_FATAL_FAILURE(reload("scene.yaml", scene, yaml_));
  const int rejected_scenes = rejected;
  for (const std::string& mesh : meshes) ASSERT_NO_FATAL_FAILURE(reload("hull.stl", mesh, stl()));
  EXPECT_GE(rejected_scenes, 13);
  EXPECT_GE(rejected - rejected_scenes, 5);
  EXPECT_EQ(client.scene().revision, revision);
  RecordProperty("taken", taken);
}

}  // namespace
}  // namespace clearance::faults
