#include "server/app/endpoints.h"

#include <sys/stat.h>
#include <unistd.h>

#include "server/access/accepting.h"
#include "server/access/authorized_keys.h"
#include "server/access/fd_filter_proxy.h"
#include "server/base/log.h"
#include "server/shm/shm_transport.h"
#include "wire/api/unknown_name.h"
#include "wire/default_socket.h"

namespace clearance {
namespace {

/// Adds the endpoint that needs no set-up if no endpoint was given.
void add_default_endpoint(DaemonOptions& options) {
  if (!options.shm.empty() || !options.zmq.empty() || !options.lcm.empty()) return;
  const std::string folder = default_socket_folder();
  mkdir(folder.c_str(), 0700);  // only /tmp/clearance-UID may be missing
  struct stat info{};
  if (stat(folder.c_str(), &info) || info.st_uid != getuid())
    throw std::runtime_error("shm://" + default_socket_path() + ": the folder " + folder +
                             " does not belong to this user; choose an endpoint with --shm or --zmq");
  options.shm.push_back(default_socket_path());
}

std::unique_ptr<Transport> open_shm(const std::string& path, [[maybe_unused]] const Access& access,
                                    [[maybe_unused]] std::uint64_t pinned_bytes) {
#ifdef CLEARANCE_HAVE_SHM
  ShmLimits limits;
  limits.max_clients = access.max_clients;
  limits.pinned_bytes = pinned_bytes;
  return make_shm_transport(path, limits, access);
#else
  throw std::runtime_error("shm://" + path + ": this clearanced was built without shared memory");
#endif
}

std::unique_ptr<Transport> open_lcm(const std::string& url, [[maybe_unused]] const LcmPoses& poses,
                                    [[maybe_unused]] std::uint64_t gateway_bytes) {
#ifdef CLEARANCE_HAVE_LCM
  return make_lcm_transport(url, poses, gateway_bytes);
#else
  throw std::runtime_error(url + ": this clearanced was built without LCM");
#endif
}

}  // namespace

Access access_of(const DaemonOptions& options) {
  Access access;
  const auto option = [](const char* name, auto read) {
    try {
      return read();
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string(name) + ": " + error.what());
    }
  };
  if (!options.socket_group.empty())
    access.group = option("--socket-group", [&] { return group_named(options.socket_group); });
  access.group_rights = option("--group-rights", [&] { return parse_rights(options.group_rights); });
  for (const std::string& user : options.control_users)
    access.control_users.push_back(option("--control-user", [&] { return user_named(user); }));
  access.max_clients = options.max_clients;
  access.gateway_bytes = std::uint64_t{options.gateway_mib} << 20;
  if (!options.keys.empty()) access.keys = std::make_shared<AuthorizedKeys>(options.keys);
  return access;
}

LcmPoses lcm_poses_of(const DaemonOptions& options, const engine::Scene& scene) {
  using Words = std::vector<std::string>;
  const Words& names = options.lcm_poses;
  if (names.empty() || names == Words{"on"}) return {true, {}};
  if (names == Words{"off"}) return {false, {}};
  for (const std::string& name : names)
    if (scene.find_body(name) == kNone && scene.find_group(name) == kNone)
      throw std::invalid_argument("--lcm-poses: the scene has no body or group \"" + name + "\"" +
                                  did_you_mean(name, all_names(scene.groups(), all_names(scene.bodies()))));
  return {false, names};
}

void open_endpoints(Loop& loop, DaemonOptions& options, const Access& access, const LcmPoses& lcm_poses) {
  reserve_descriptor();
  log::info("event=descriptor_filter rejected_by={}", kernel_rejects_descriptors() ? "kernel" : "proxy");
  add_default_endpoint(options);
  for (const std::string& path : options.shm) loop.add(open_shm(path, access, std::uint64_t{options.pinned_mib} << 20));
  for (const std::string& endpoint : options.zmq) loop.add(make_zmq_transport(endpoint, access));
  if (!options.lcm.empty()) loop.add(open_lcm(options.lcm, lcm_poses, access.gateway_bytes));
}

}  // namespace clearance
