#include "engine/cache/sha256.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace clearance {

namespace {

void check(int done) {
  if (done != 1) throw std::runtime_error("libcrypto computes no SHA-256 here");
}

}  // namespace

std::string hex(const Sha256Digest& digest) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : digest) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

void Sha256::Free::operator()(evp_md_ctx_st* context) const {
  ::EVP_MD_CTX_free(context);
}

Sha256::Sha256() : context_(::EVP_MD_CTX_new()) {
  if (!context_) throw std::bad_alloc();
  check(::EVP_DigestInit_ex(context_.get(), ::EVP_sha256(), nullptr));
}

Sha256::~Sha256() = default;

void Sha256::add(const void* data, std::size_t bytes) {
  check(::EVP_DigestUpdate(context_.get(), data, bytes));
}

Sha256Digest Sha256::digest() {
  Sha256Digest digest;
  check(::EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr));
  return digest;
}

}  // namespace clearance
