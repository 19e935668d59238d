// A proxy between the daemon's threads and Unix sockets of unauthenticated peers.
//
// A message may carry descriptors (SCM_RIGHTS). A thread that receives it, or closes the socket with it in the queue,
// closes the descriptors, and if it holds the last reference it waits: for a TCP socket with SO_LINGER as long as the
// sender likes. So such descriptors must not reach a thread that others wait for.
#pragma once

#include <sys/socket.h>

#include "wire/shm_os.h"

namespace clearance {

/// Whether the kernel rejects descriptors (SO_PASSRIGHTS, Linux 6.16), so that no proxy is needed. False with
/// CLEARANCE_FD_FILTER_PROXY=on in the environment, for tests.
bool kernel_rejects_descriptors();

/// Makes a Unix socket that does not listen yet reject descriptors, and each connection that it accepts. Does nothing
/// if the kernel cannot. Throws std::runtime_error.
void reject_descriptors(int listener);

/// Returns a socket of the same type that replaces a connection at a Unix socket. A thread forwards the peer's data
/// without descriptors, and the daemon's with them, and closes the peer's socket. Returns the connection itself for
/// other families or if the kernel rejects descriptors, and nothing, closing the connection, if there is no thread or
/// descriptor for it or its user has too many proxies.
shm::UniqueFd without_descriptors(shm::UniqueFd peer);

/// Closes an unauthenticated peer's connection by `close`, on a detached thread.
void close_detached(shm::UniqueFd peer, void (*close)(shm::UniqueFd) = +[](shm::UniqueFd) {});

/// Credentials of the peer of a socket from without_descriptors() (SO_PEERCRED). Returns false for any other socket.
bool credentials_of_proxied(int socket, ucred& who);

}  // namespace clearance
