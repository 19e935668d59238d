// Options of clearanced, from the command line and the configuration file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace clearance {

/// Exit codes of clearanced, which are part of its interface (--help lists them).
enum ExitCode : int {
  kExitClean = 0,
  kExitUnexpected = 1,
  kExitCommandLine = 2,
  kExitScene = 3,
  kExitEndpoint = 4,
  kExitBackend = 5,
};

struct DaemonOptions {
  std::string scene;
  bool allow_outside = false;
  std::vector<std::string> shm;  ///< socket paths
  std::vector<std::string> zmq;  ///< endpoints
  std::string keys;              ///< folder, or empty for no keys
  std::string socket_group;      ///< name or number, or empty
  std::string group_rights = "query";
  std::vector<std::string> control_users;  ///< names or numbers
  std::string lcm;                         ///< url, or empty for no LCM
  std::vector<std::string> lcm_poses;      ///< "on" (as if empty), "off", or bodies and groups
  std::string backend = "auto";
  int threads = 0;
  std::vector<int> devices;  ///< numbers, or empty for the current one
  bool device_fallback = true;
  std::string covers = "background";
  bool real_time = false;
  int loop_cpu = -1;  ///< or -1 for any
  bool require_epoch = false;
  std::string log_level = "info";
  std::string metrics;  ///< endpoint, or empty
  int ready_fd = -1;

  // The limits, which --help lists with their defaults.
  std::uint64_t max_waiting = 64, max_clients = 256, max_client_mib = 2048, gateway_mib = 2048;
  std::uint64_t max_pairs = 10'000'000'000, max_part_pairs = 10'000'000'000'000;
  std::uint64_t max_body_points = 2'000'000, max_client_points = 8'000'000, max_points = 16'000'000;
  std::uint64_t max_client_plans = 8, max_plans = 64, max_client_plan_mib = 2048, max_plan_mib = 8192;
  std::uint64_t max_added_bodies = 64, max_added_vertices = 20'000, max_added_triangles = 40'000,
                max_added_points = 80'000;
  std::uint64_t device_memory_mib = 0, pinned_mib = 1024;
  std::uint64_t max_stamp_lead_s = 60, slice_us = 200, spin_us = 50;
};

/// Reads the command line. Returns true if the daemon is to run, else sets `exit_code` (help or version were printed,
/// or an error).
bool parse_options(int argc, const char* const* argv, DaemonOptions& options, int& exit_code);

}  // namespace clearance
