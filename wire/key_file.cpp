#include "wire/key_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace clearance {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& cause) {
  throw std::runtime_error(path + ": " + cause);
}

void write_new(const std::string& path, const std::string& text) {
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) fail(path, errno == EEXIST ? "is there already, and a key is never overwritten" : std::strerror(errno));
  const bool written = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd) == 0;
  const int error = errno;
  close(fd);
  if (written) return;
  unlink(path.c_str());
  fail(path, std::string("cannot be written: ") + std::strerror(error));
}

/// Reads the words of a key file: one key, or "public" and "secret" with a key each.
KeyPair parse(const std::string& path) {
  std::ifstream in(path);
  if (!in) fail(path, std::strerror(errno));
  KeyPair pair;
  for (std::string word; in >> word;) {
    std::string* key = word == "public" ? &pair.public_key : word == "secret" ? &pair.secret_key : nullptr;
    if (key && !(in >> word)) fail(path, "a key is missing");
    if (!is_key(word)) fail(path, "expected a key of 40 characters (Z85), as clearance keygen writes it");
    (key ? *key : pair.public_key) = word;
  }
  if (pair.public_key.empty()) fail(path, "there is no public key in it");
  return pair;
}

}  // namespace

bool is_key(const std::string& text) {
  constexpr const char* kZ85 = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#";
  return text.size() == 40 && text.find_first_not_of(kZ85) == std::string::npos;
}

void write_key_pair(const std::string& path, const KeyPair& pair) {
  write_new(path, "public " + pair.public_key + "\nsecret " + pair.secret_key + "\n");
  try {
    write_new(path + ".pub", pair.public_key + "\n");
  } catch (...) {
    unlink(path.c_str());
    throw;
  }
}

KeyPair read_key_pair(const std::string& path) {
  KeyPair pair = parse(path);
  if (pair.secret_key.empty()) fail(path, "there is no secret key in it");
  struct stat info{};
  if (stat(path.c_str(), &info) != 0) fail(path, std::strerror(errno));
  if (info.st_mode & 077) fail(path, "others may read this secret key; chmod 600 it");
  return pair;
}

std::string read_public_key(const std::string& path) {
  return parse(path).public_key;
}

}  // namespace clearance
