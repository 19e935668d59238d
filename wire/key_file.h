// Files with CURVE keys, written by `clearance keygen` and read by daemon and clients.
//
//   a key pair, mode 0600        public rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7
//                                secret JTKVSB%%)wK0E.X)V>+}o?pNmC{O&4W4b!Ni{Lh6
//   a public key, FILE.pub       the 40 characters alone
//
// Keys are in Z85 (https://rfc.zeromq.org/spec/32), 40 characters for 32 bytes.
#pragma once

#include <string>

namespace clearance {

struct KeyPair {
  std::string public_key, secret_key;  ///< Z85
};

/// Whether a text is a key of 40 characters in Z85.
bool is_key(const std::string& text);

/// Writes the pair to `path` and its public key to `path`.pub, both readable by this user alone. Throws
/// std::runtime_error naming the file, and never overwrites an existing one.
void write_key_pair(const std::string& path, const KeyPair& pair);
/// Throws std::runtime_error naming file and cause, also if users other than its owner can read it.
KeyPair read_key_pair(const std::string& path);
/// Reads a file of either kind. Throws std::runtime_error naming file and cause.
std::string read_public_key(const std::string& path);

}  // namespace clearance
