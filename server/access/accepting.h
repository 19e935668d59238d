// Taking connections when there is no descriptor left for them.
#pragma once

#include <functional>

namespace clearance {

/// The next connection of a listening socket that does not block, as accept4() with SOCK_CLOEXEC and SOCK_NONBLOCK; -1
/// if there is none. Without a descriptor for it the connection is taken by one that is kept in reserve, given to
/// `refuse` to say why, and closed: else it would wait, and keep the loop awake, for as long as the others stay.
int accept_or_refuse(int listener, const std::function<void(int socket)>& refuse);

/// Keeps a descriptor for that. libzmq's threads then take their connections in the same way, through the accept() of
/// accepting.cpp: libzmq 4.3 ends the process when a Unix socket's accept() fails with EMFILE.
void reserve_descriptor();

}  // namespace clearance
