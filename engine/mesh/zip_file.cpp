#include "engine/mesh/zip_file.h"

#include <minizip/unzip.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>

#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

// An archive in memory, as minizip reads it.
struct Source {
  std::string_view bytes;
  std::size_t at = 0;
};

Source* source(void* stream) {
  return static_cast<Source*>(stream);
}

uLong read_source(void*, void* stream, void* to, uLong size) {
  Source* s = source(stream);
  const std::size_t n = std::min<std::size_t>(size, s->bytes.size() - s->at);
  std::memcpy(to, s->bytes.data() + s->at, n);
  s->at += n;
  return static_cast<uLong>(n);
}

long seek_source(void*, void* stream, ZPOS64_T offset, int origin) {
  Source* s = source(stream);
  const ZPOS64_T from = origin == ZLIB_FILEFUNC_SEEK_CUR   ? s->at
                        : origin == ZLIB_FILEFUNC_SEEK_END ? s->bytes.size()
                                                           : 0;
  const ZPOS64_T at = from + offset;  // modulo 2^64: offsets may be negative
  if (at > s->bytes.size()) return -1;
  s->at = static_cast<std::size_t>(at);
  return 0;
}

}  // namespace

std::vector<std::string> zip_entries(std::string_view archive, std::string_view suffix) {
  Source bytes{archive};
  zlib_filefunc64_def memory{};
  memory.zopen64_file = [](void* opaque, const void*, int) { return opaque; };
  memory.zread_file = read_source;
  memory.zwrite_file = [](void*, void*, const void*, uLong) { return uLong{0}; };
  memory.ztell64_file = [](void*, void* stream) { return ZPOS64_T{source(stream)->at}; };
  memory.zseek64_file = seek_source;
  memory.zclose_file = [](void*, void*) { return 0; };
  memory.zerror_file = [](void*, void*) { return 0; };
  memory.opaque = &bytes;
  const std::unique_ptr<void, int (*)(void*)> zip(::unzOpen2_64("", &memory), &::unzClose);
  std::vector<std::string> out;
  if (!zip) return out;
  for (int state = ::unzGoToFirstFile(zip.get()); state == UNZ_OK; state = ::unzGoToNextFile(zip.get())) {
    char name[512] = {};
    if (::unzGetCurrentFileInfo64(zip.get(), nullptr, name, sizeof name - 1, nullptr, 0, nullptr, 0) != UNZ_OK) break;
    if (!lower(name).ends_with(suffix)) continue;
    const auto fail = [&name] { throw LoadError("its entry " + in_quotes(name) + " cannot be unpacked"); };
    if (::unzOpenCurrentFile(zip.get()) != UNZ_OK) fail();
    char chunk[1 << 14];
    int got = 0;
    out.emplace_back();
    while ((got = ::unzReadCurrentFile(zip.get(), chunk, sizeof chunk)) > 0)
      out.back().append(chunk, static_cast<std::size_t>(got));
    if (got < 0 || ::unzCloseCurrentFile(zip.get()) != UNZ_OK) fail();  // the latter compares the checksum
  }
  return out;
}

}  // namespace clearance
