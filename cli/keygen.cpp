// clearance keygen: makes a pair of keys for TCP.
#include <iostream>
#include <memory>
#include <stdexcept>
#include <zmq.hpp>

#include "cli/commands.h"
#include "wire/key_file.h"

namespace clearance::cli {
namespace {

void keygen(const std::string& path) {
  char public_key[41], secret_key[41];
  if (zmq_curve_keypair(public_key, secret_key) != 0)
    throw std::runtime_error(std::string("this libzmq cannot make keys: ") + zmq_strerror(zmq_errno()));
  write_key_pair(path, {public_key, secret_key});
  std::cout << public_key << "\n";
}

}  // namespace

void add_keygen(CLI::App& app) {
  auto& command =
      *app.add_subcommand("keygen", "make a pair of keys (CURVE) for a daemon's TCP endpoint, or for a client of one");
  auto path = std::make_shared<std::string>();
  command.add_option("FILE", *path, "file for the pair; FILE.pub gets the public key, which is also printed")
      ->required();
  command.callback([path] { keygen(*path); });
  command.footer(R"(
The daemon, with a list of the clients' keys and of their rights (query, poses, admin):
  mkdir -m 700 keys && clearance keygen keys/server.key
  echo "$(clearance keygen planner.key) query,poses planner" >> keys/authorized
  clearanced --scene scene.yaml --zmq tcp://0.0.0.0:5555 --keys keys
The client, which identifies the daemon by server.key.pub:
  clearance query --connect "tcp://robot:5555?server_key=server.key.pub&key=planner.key"

Only this user can read both files, and existing files are never overwritten.)");
}

}  // namespace clearance::cli
