// Stands between the daemon's threads and Unix sockets of strangers.
//
// A stranger's message may carry descriptors (SCM_RIGHTS), and whoever receives it, or closes the socket with it in the
// queue, closes them: if he is the last to hold one, he waits for as long as that takes. For a TCP socket with
// SO_LINGER that is as long as its sender likes. So no such descriptor may reach a thread that others wait for.
#pragma once

#include <sys/socket.h>

#include "wire/shm_os.h"

namespace clearance {

/// Whether the kernel keeps descriptors out (SO_PASSRIGHTS, Linux 6.16): then strangers' sockets are like any others,
/// and the doorman has nothing to do. False also with CLEARANCE_DOORMAN=on in the environment, for tests.
bool kernel_refuses_descriptors();

/// Has a Unix socket that does not listen yet refuse descriptors, and each connection that it will take. Does nothing
/// where the kernel cannot. Throws std::runtime_error.
void refuse_descriptors(int listener);

/// A socket of the same type to use in place of a connection that was taken from strangers at a Unix socket: a thread
/// of its own passes on what they say, without descriptors, and what they are told, with them, and closes their end.
/// Where the kernel refuses descriptors, and of other families, the connection itself. None, and the connection is
/// closed, if there is no thread or descriptor for it or its user has too many doors.
shm::UniqueFd let_in(shm::UniqueFd stranger);

/// Has a connection that was taken from strangers closed by `close`, on a thread that nobody waits for.
void turn_away(shm::UniqueFd stranger, void (*close)(shm::UniqueFd) = +[](shm::UniqueFd) {});

/// Who is behind a socket of let_in(): SO_PEERCRED, asked of the stranger's. False: it is none of those.
bool credentials_behind(int socket, ucred& who);

}  // namespace clearance
