// Cryptographic digests (SHA-256, by libcrypto), for which no collisions are known.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

struct evp_md_ctx_st;

namespace clearance {

using Sha256Digest = std::array<unsigned char, 32>;
/// Formats a digest as lower-case hexadecimal digits.
std::string hex(const Sha256Digest& digest);

class Sha256 {
 public:
  Sha256();
  Sha256(Sha256&&) = default;
  ~Sha256();
  void add(const void* data, std::size_t bytes);
  void add(std::span<const std::byte> data) { add(data.data(), data.size()); }
  /// Returns the digest of all added data. No data can be added afterwards.
  Sha256Digest digest();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

}  // namespace clearance
