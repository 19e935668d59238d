#include "tests/faults/soak.h"

#include <signal.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <thread>

#include "tests/faults/limits.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;

/// Processor seconds that a process has used.
double processor_seconds(int pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(stat, text);
  std::istringstream words(text.substr(text.rfind(')') + 2));
  std::string word;
  for (int i = 0; i < 11; ++i) words >> word;
  double user = 0, system = 0;
  words >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

Witness::Counts sum_of(const Witnesses& witnesses) {
  Witness::Counts sum;
  for (const auto& witness : witnesses) {
    const Witness::Counts c = witness->counts();
    sum.right += c.right, sum.wrong += c.wrong, sum.lost += c.lost;
    sum.renewed += c.renewed, sum.late += c.late, sum.busy += c.busy, sum.others += c.others;
  }
  return sum;
}

}  // namespace

Soak::Soak(std::uint64_t seed, double load)
    : random_(seed), exam_(kScene, seed), counters_(connect(living_.zmq(), 30s)) {
  counters_.set_timeout(30s);
  const auto witness = [&](Witnesses& all, const std::string& url, double part, std::chrono::nanoseconds timeout) {
    all.push_back(std::make_unique<Witness>(url, exam_, random_(), part, timeout));
  };
  witness(living_witnesses_, living_.shm(), load, 30s);
  witness(living_witnesses_, living_.shm() + "?spin_us=0", load, 30s);
  witness(living_witnesses_, living_.zmq(), load, 30s);
  if (living_.has_lcm()) witness(living_witnesses_, living_.lcm(), load, 5s);
  witness(mortal_witnesses_, mortal_.shm(), 0.1, 30s);
  witness(mortal_witnesses_, mortal_.zmq(), 0.1, 30s);
  if (mortal_.has_lcm()) witness(mortal_witnesses_, mortal_.lcm(), 0.1, 500ms);
  before_ = living_.census();
}

void Soak::expect(bool holds, const std::string& else_trouble) {
  if (!holds && trouble_.size() < 2000) trouble_ += else_trouble + "; ";
}

void Soak::fault() {
  if (living_.has_ended()) throw std::runtime_error("the daemon that should live has ended: " + living_.daemon().log());
  release_due(Clock::now());
  const std::uint64_t drawn = below(100);
  if (drawn < 45) return kill_client(living_, "killed");
  if (drawn < 55) return kill_client_at_any_moment();
  if (drawn < 70) return freeze_client();
  if (drawn < 80) return start_scribbler();
  if (drawn < 84) return take_descriptors();
  if (drawn < 87) return take_memory();
  if (drawn < 89) return limit_file_size();
  if (drawn < 92) return reload();
  if (drawn < 96) return kill_client(mortal_, "killed_of_mortal");
  kill_daemon();
}

void Soak::kill_client(Arena& arena, const char* name) {
  const std::string& url = any_url(arena);
  const auto points = points_of(url);
  const std::string_view point = points[below(points.size())];
  const int end = arena.talk(url, point, SIGKILL, random_()).await_end();
  expect(end == -SIGKILL,
         "a talk over " + url + " ended with " + std::to_string(end) + " before " + std::string(point));
  ++faults_[name];
}

void Soak::kill_client_at_any_moment() {
  Victim victim({"query", any_url(living_), std::to_string(random_())});
  std::this_thread::sleep_for(std::chrono::microseconds(below(60000)));
  victim.signal(SIGKILL);
  victim.await_end();
  ++faults_["killed"];
}

void Soak::freeze_client() {
  if (frozen_.size() >= 8) return;
  const std::string& url = any_url(living_);
  const auto points = points_of(url);
  const std::string_view point = points[below(points.size())];
  Frozen frozen{living_.talk(url, point, SIGSTOP, random_()), Clock::now() + std::chrono::milliseconds(below(3000)),
                below(2) == 0};
  expect(frozen.victim.await_stop(), "a talk over " + url + " ended before " + std::string(point));
  frozen_.push_back(std::move(frozen));
  ++faults_["frozen"];
}

void Soak::start_scribbler() {
  if (scribblers_.size() >= 2) return;
  scribblers_.push_back({Victim({"scribble", living_.shm(), std::to_string(random_())}),
                         Clock::now() + std::chrono::milliseconds(200 + below(2000))});
  ++faults_["scribbling"];
}

void Soak::release_due(Clock::time_point now) {
  frozen_.remove_if([&](Frozen& frozen) {
    if (frozen.until > now) return false;
    frozen.victim.signal(frozen.goes_on ? SIGCONT : SIGKILL);
    const int end = frozen.victim.await_end();
    // 1: the daemon has closed the connection (no hello for five seconds), or had no capacity because of another fault
    expect(end == (frozen.goes_on ? 0 : -SIGKILL) || (frozen.goes_on && end == 1),
           "a frozen client ended with " + std::to_string(end));
    return true;
  });
  scribblers_.remove_if([&](Scribbler& scribbler) {
    if (scribbler.until > now) return false;
    scribbler.victim.signal(SIGKILL);
    expect(scribbler.victim.await_end() == -SIGKILL, "a scribbler ended by itself");
    return true;
  });
}

void Soak::take_descriptors() {
  std::vector<Client> clients;
  std::string rejected;
  const int pid = living_.daemon().pid();
  const Limit limit(pid, RLIMIT_NOFILE, descriptors_for(pid, static_cast<int>(below(12))));
  while (rejected.empty() && clients.size() < 100) {
    const std::string& url = below(3) ? living_.shm() : living_.zmq();
    rejected = error_of([&] { clients.push_back(connect(url, 30s)); });
  }
  expect(!rejected.empty(), "100 clients without descriptors");
  ++faults_["descriptors"];
}

void Soak::take_memory() {
  const int pid = living_.daemon().pid();
  Client client = connect(below(2) ? living_.shm() : living_.zmq(), 30s);
  client.set_timeout(30s);
  const std::vector<Pose7> poses(20000, Pose7{1, 2, 3, 1, 0, 0, 0});
  const std::uint32_t body = 1;
  Query query;
  query.bodies = {&body, 1};
  query.configurations = poses;
  query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
  query.max_distance = 0.1;
  const Limit limit(pid, RLIMIT_AS, address_space_of(pid) + (96 << 20));
  // Usually rejected; answered if others have just released their slots.
  const std::string rejected = error_of([&] { client.distances(query); });
  expect(rejected.find("is gone") == std::string::npos && rejected.find("has gone") == std::string::npos, rejected);
  ++faults_["memory"];
}

void Soak::limit_file_size() {
  const Limit limit(living_.daemon().pid(), RLIMIT_FSIZE, 1 << 20);
  const std::string rejected = error_of([&] { connect(living_.shm(), 30s); });
  expect(rejected.find("File too large") != std::string::npos, "beyond the file size limit: " + rejected);
  ++faults_["file_size"];
}

void Soak::reload() {
  kill(living_.daemon().pid(), SIGHUP);
  ++faults_["reloads"];
}

void Soak::kill_daemon() {
  const std::string waiting = await_answers(mortal_witnesses_, 1);
  expect(waiting.empty(), "after " + std::to_string(faults_["daemons_killed"]) + " deaths of the daemon " + waiting);
  std::this_thread::sleep_for(std::chrono::microseconds(below(20000)));
  mortal_.kill_and_restart();
  ++faults_["daemons_killed"];
}

Soak::Sample Soak::keep_still() {
  release_due(Clock::time_point::max());
  const std::string left = living_.await_census(before_);
  expect(left.empty(), "left behind: " + left);
  for (const Witnesses* witnesses : {&living_witnesses_, &mortal_witnesses_}) {
    const std::string starving = await_answers(*witnesses, 1);
    expect(starving.empty(), starving);
  }

  Sample sample;
  const auto now = Clock::now();
  const double cpu = processor_seconds(living_.daemon().pid());
  sample.seconds = std::chrono::duration<double>(now - begin_).count();
  sample.cpu = (cpu - cpu_before_) / std::chrono::duration<double>(now - last_sample_).count();
  cpu_before_ = cpu;
  last_sample_ = now;
  sample.living = sum_of(living_witnesses_);
  sample.mortal = sum_of(mortal_witnesses_);
  sample.stats = stats_of(counters_);
  sample.census = living_.census();
  sample.faults = faults_;
  const std::string off = unbalanced(sample.stats);
  expect(off.empty(), off);
  expect(sample.stats["replies"] >= sample.living.right, "fewer replies counted than received");
  expect(sample.stats["errors.internal"] == 0 && sample.stats["errors.transport"] == 0, "internal errors");
  expect(sample.living.wrong + sample.mortal.wrong == 0, "WRONG ANSWERS");
  expect(sample.living.others + sample.mortal.others == 0, "unexpected errors");
  for (const auto& witness : living_witnesses_) {
    const Witness::Counts counts = witness->counts();
    expect(counts.lost == 0, witness->url() + " lost its daemon, which lives");
    if (!may_lose(witness->url())) expect(counts.late == 0, witness->url() + " was kept waiting");
  }
  for (const auto& witness : mortal_witnesses_)
    if (!may_lose(witness->url())) {
      const Witness::Counts counts = witness->counts();
      expect(counts.lost >= faults_["daemons_killed"], witness->url() + ": a death was passed over in silence");
      expect(counts.late == 0, witness->url() + ": a death was not noticed");
    }
  sample.trouble = std::exchange(trouble_, "");
  return sample;
}

std::string Soak::end() {
  for (Witnesses* witnesses : {&living_witnesses_, &mortal_witnesses_})
    for (const auto& witness : *witnesses) witness->stop();
  for (Arena* arena : {&living_, &mortal_}) {
    const int code = arena->end();
    expect(code == 0, "a daemon ended with " + std::to_string(code));
    for (const std::string& file : entries_of(arena->folder())) expect(false, "left behind: " + file);
  }
  return std::exchange(trouble_, "");
}

std::vector<std::string> Soak::complaints() const {
  std::vector<std::string> all;
  for (const Witnesses* witnesses : {&living_witnesses_, &mortal_witnesses_})
    for (const auto& witness : *witnesses)
      for (std::string& text : witness->complaints()) all.push_back(std::move(text));
  return all;
}

}  // namespace clearance::faults
