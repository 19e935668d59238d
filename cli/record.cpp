// clearance record and replay: messages of the daemon's LCM channels, in LCM's own log format.
#include <lcm/eventlog.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>

#include <chrono>
#include <cstring>
#include <iostream>
#include <map>
#include <memory>
#include <set>
#include <thread>

#include "commands.h"
#include "wire/lcm_bus.h"

namespace clearance::cli {
namespace {

using Clock = std::chrono::steady_clock;

/// Messages that wait between two looks at the network.
constexpr int kQueue = 10000;
/// What goes to a daemon, and not what it says: to be played to another one.
const std::set<std::string> kInputs{"CLEARANCE_POSES",        "CLEARANCE_POSES_NAMED", "CLEARANCE_JOINTS",
                                    "CLEARANCE_JOINTS_NAMED", "CLEARANCE_QUERY",       "CLEARANCE_JOINT_QUERY"};

struct RecordOptions {
  std::string file;
  std::string lcm = "udpm://239.255.76.67:7667?ttl=0";
  bool force = false, inputs = false;
  double seconds = 0, speed = 1;
};

volatile sig_atomic_t interrupted = 0;

/// Ctrl-C and SIGTERM end a loop instead of the program, so that what is written is whole.
void end_by_signal() {
  struct sigaction action{};
  action.sa_handler = [](int) { interrupted = 1; };
  for (const int number : {SIGINT, SIGTERM}) ::sigaction(number, &action, nullptr);
}

/// An LCM log, closed with its owner.
class Log {
 public:
  Log(const std::string& file, const char* mode) : file_(file), log_(lcm_eventlog_create(file.c_str(), mode)) {
    if (log_ == nullptr) throw std::runtime_error(file + ": " + std::strerror(errno));
  }
  ~Log() { lcm_eventlog_destroy(log_); }
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  void add(std::int64_t time_us, const std::string& channel, std::span<const std::byte> message) {
    lcm_eventlog_event_t event{};
    event.timestamp = time_us;
    event.channellen = static_cast<std::int32_t>(channel.size());
    event.datalen = static_cast<std::int32_t>(message.size());
    event.channel = const_cast<char*>(channel.data());
    event.data = const_cast<std::byte*>(message.data());
    if (lcm_eventlog_write_event(log_, &event) != 0) fail();
  }
  /// All that was added can be read, whatever becomes of this program.
  void flush() {
    if (std::fflush(log_->f) != 0) fail();
  }

  using Event = std::unique_ptr<lcm_eventlog_event_t, decltype(&lcm_eventlog_free_event)>;
  /// The next message; null at the end.
  Event next() {
    Event event{lcm_eventlog_read_next_event(log_), &lcm_eventlog_free_event};
    if (event) understood_ += kEventHeader + event->channellen + event->datalen;
    return event;
  }
  /// Whether next() passed over bytes that are no message: liblcm looks for the next one without a word.
  bool is_damaged() const { return std::fseek(log_->f, 0, SEEK_END) != 0 || std::ftell(log_->f) != understood_; }

 private:
  [[noreturn]] void fail() const { throw std::runtime_error(file_ + ": cannot be written: " + std::strerror(errno)); }

  /// A word to find it by, its number, its time, and two lengths.
  static constexpr long kEventHeader = 28;

  std::string file_;
  lcm_eventlog_t* log_;
  long understood_ = 0;
};

std::int64_t now_us() {
  using std::chrono::microseconds;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<microseconds>(now).count();
}

void print_counts(const std::map<std::string, std::uint64_t>& counts) {
  for (const auto& [channel, count] : counts) std::cout << channel << ' ' << count << '\n';
}

void record(const RecordOptions& o) {
  struct stat found{};
  if (!o.force && ::stat(o.file.c_str(), &found) == 0)
    throw std::runtime_error(o.file + ": is there already; --force writes over it");
  const LcmAddress address = parse_lcm_address(o.lcm);
  LcmBus bus(address);
  Log log(o.file, "w");
  std::map<std::string, std::uint64_t> counts;
  bus.subscribe_all(kQueue, [&](const std::string& channel, std::span<const std::byte> message) {
    log.add(now_us(), channel, message);
    ++counts[channel];
  });
  end_by_signal();
  std::cerr << "recording " << address.url() << " into " << o.file << "; Ctrl-C ends it" << std::endl;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(o.seconds));
  while (!interrupted && (o.seconds <= 0 || Clock::now() < end)) {
    pollfd waiting{bus.descriptor(), POLLIN, 0};
    ::poll(&waiting, 1, 100);  // a signal ends it early
    while (bus.handle() && !interrupted) {
    }
    log.flush();
  }
  print_counts(counts);
}

/// The channel's name without the prefix of a network that several daemons share.
std::string own_name(const std::string& channel) {
  const std::size_t at = channel.rfind("CLEARANCE_");
  return at == std::string::npos ? channel : channel.substr(at);
}

/// Sleeps until `due`; false if a signal came first.
bool sleep_until(Clock::time_point due) {
  while (!interrupted && Clock::now() < due)
    std::this_thread::sleep_for(std::min<Clock::duration>(due - Clock::now(), std::chrono::milliseconds(100)));
  return !interrupted;
}

void replay(const RecordOptions& o) {
  LcmAddress address = parse_lcm_address(o.lcm);
  if (!address.prefix.empty())
    throw std::invalid_argument("--lcm: channels keep the names that the log has; leave prefix=" + address.prefix +
                                " out");
  Log log(o.file, "r");
  LcmBus bus(address);
  LcmPacer pacer;
  end_by_signal();
  std::map<std::string, std::uint64_t> counts;
  std::uint64_t refused = 0;
  std::int64_t first_us = 0;
  bool begun = false;
  const auto begin = Clock::now();
  while (const auto event = log.next()) {
    const std::string channel(event->channel, static_cast<std::size_t>(event->channellen));
    if (!begun) first_us = event->timestamp;
    begun = true;
    if (o.inputs && !kInputs.contains(own_name(channel))) continue;
    const std::chrono::duration<double> after(static_cast<double>(event->timestamp - first_us) * 1e-6 / o.speed);
    if (!sleep_until(begin + std::chrono::duration_cast<Clock::duration>(after))) break;
    while (!pacer.ready(Clock::now())) std::this_thread::sleep_for(pacer.pause());
    const std::size_t size = static_cast<std::size_t>(event->datalen);
    pacer.sent(size);
    const bool fits = size <= kLcmDatagramBytes;
    if (!fits || !bus.publish(channel, {static_cast<const std::byte*>(event->data), size})) ++refused;
    ++counts[channel];
  }
  print_counts(counts);
  if (refused > 0) throw std::runtime_error(std::to_string(refused) + " messages could not be sent");
  if (!interrupted && log.is_damaged())
    throw std::runtime_error(o.file + ": is damaged, or no LCM log: parts of it are no message");
}

CLI::App& add(CLI::App& app, const char* name, const char* what, const std::shared_ptr<RecordOptions>& o) {
  auto& command = *app.add_subcommand(name, what);
  command.add_option("file", o->file, "an LCM log")->required()->type_name("FILE");
  command.add_option("--lcm", o->lcm, "the network, as the daemon's --lcm")->type_name("URL")->capture_default_str();
  return command;
}

}  // namespace

void add_record(CLI::App& app) {
  const auto o = std::make_shared<RecordOptions>();
  auto& command = add(app, "record", "writes every message of the daemon's LCM channels to a log", o);
  command.add_flag("--force", o->force, "write over a file that is there");
  command.add_option("--seconds", o->seconds, "stop after so long; default: at Ctrl-C")
      ->check(quiet(CLI::PositiveNumber))
      ->type_name("S");
  command.callback([o] { record(*o); });
}

void add_replay(CLI::App& app) {
  const auto o = std::make_shared<RecordOptions>();
  auto& command = add(app, "replay", "publishes the messages of an LCM log as they were", o);
  command.add_option("--speed", o->speed, "times as fast as it was")
      ->check(quiet(CLI::PositiveNumber))
      ->type_name("X")
      ->capture_default_str();
  command.add_flag("--inputs", o->inputs, "only what goes to a daemon: poses, joints, questions; not what one said");
  command.callback([o] { replay(*o); });
}

}  // namespace clearance::cli
