#include "engine/mesh/readers/gltf_accessors.h"

#include <cmath>

#include "engine/mesh/mesh_bytes.h"

namespace clearance::gltf {

namespace {

// Bytes read before repeated reading is limited, and how often each byte may be read on average.
constexpr std::uint64_t kMostReadBytes = std::uint64_t{64} << 20, kMostReadings = 16;

std::string decoded_base64(std::string_view text, const std::string& where) {
  if (text.ends_with('=') && text.size() % 4 == 0) text.remove_suffix(text.ends_with("==") ? 2 : 1);
  std::string out;
  out.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t word = 0;
  int bits = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    std::uint32_t digit = 0;
    if (c >= 'A' && c <= 'Z')
      digit = static_cast<std::uint32_t>(c - 'A');
    else if (c >= 'a' && c <= 'z')
      digit = static_cast<std::uint32_t>(c - 'a' + 26);
    else if (c >= '0' && c <= '9')
      digit = static_cast<std::uint32_t>(c - '0' + 52);
    else if (c == '+' || c == '-')
      digit = 62;
    else if (c == '/' || c == '_')
      digit = 63;
    else
      fail(where + ".uri: character " + std::to_string(i) + " is not base64");
    word = (word << 6 | digit) & 0xffffff;
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    out.push_back(static_cast<char>(word >> bits & 0xff));
  }
  if (bits == 6) fail(where + ".uri: its base64 ends within a byte");
  return out;
}

std::string without_percents(const std::string& uri) {
  std::string out;
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escaped = uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0;
    out += escaped ? static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2])) : uri[i];
    if (escaped) i += 2;
  }
  return out;
}

}  // namespace

std::vector<MeshTransform> Accessors::inverse_binds(const Json& skin, const std::string& where, std::size_t joints) {
  std::vector<MeshTransform> out(joints);
  if (!find(skin, "inverseBindMatrices")) return out;
  const std::uint64_t index = unsigned_in(skin, "inverseBindMatrices", where);
  const Json& accessor = document_.entry("accessors", index);
  const std::string at = place("accessors", index);
  const Json* type = find(accessor, "type");
  if (!type || *type != "MAT4" || unsigned_in(accessor, "componentType", at) != 5126)
    fail(at + " holds inverseBindMatrices; expected MAT4 of float32 (5126)");
  if (unsigned_in(accessor, "count", at) < joints) fail(at + " has fewer matrices than " + where + " has joints");
  const Rows data = rows(accessor, at, joints, 64);
  for (std::size_t j = 0; j < joints; ++j)
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 4; ++c) out[j].m[r][c] = real_at<float>(data.bytes, data.stride * j + 16 * c + 4 * r);
  return out;
}

// Returns the `count` rows of `size` bytes of an accessor, or of a part of a sparse one.
Accessors::Rows Accessors::rows(const Json& holder, const std::string& where, std::uint64_t count, std::size_t size) {
  const std::uint64_t index = unsigned_in(holder, "bufferView", where);
  const Json& view = document_.entry("bufferViews", index);
  const std::string view_place = place("bufferViews", index);
  const std::string& bytes = buffer(unsigned_in(view, "buffer", view_place));
  const std::uint64_t begin = unsigned_in(view, "byteOffset", view_place, 0);
  const std::uint64_t length = unsigned_in(view, "byteLength", view_place);
  if (begin + length > bytes.size())
    fail(view_place + " ends at byte " + std::to_string(begin + length) + " of a buffer of " +
         std::to_string(bytes.size()));
  const std::uint64_t stride = unsigned_in(view, "byteStride", view_place, size);
  const std::uint64_t offset = unsigned_in(holder, "byteOffset", where, 0);
  if (stride < size)
    fail(view_place + ".byteStride of " + std::to_string(stride) + "; its rows have " + std::to_string(size));
  if (count > 0 && (offset + size > length || (count - 1) > (length - offset - size) / stride))
    fail(where + " has " + std::to_string(count) + " rows, more than its " + view_place + " holds");
  read_bytes_ += count * size;
  if (read_bytes_ > kMostReadBytes && read_bytes_ / kMostReadings > buffer_bytes_)
    fail("its accessors read the same bytes too often");
  return {std::string_view(bytes).substr(begin + offset, count == 0 ? 0 : length - offset), stride};
}

std::vector<Vec3d> Accessors::positions(std::uint64_t index) {
  const Json& accessor = document_.entry("accessors", index);
  const std::string where = place("accessors", index);
  const Json* type = find(accessor, "type");
  if (!type || *type != "VEC3" || unsigned_in(accessor, "componentType", where) != 5126)
    fail(where + " is a POSITION; expected VEC3 of float32 (5126); KHR_mesh_quantization is not read");
  const std::uint64_t count = unsigned_in(accessor, "count", where);
  const Json* sparse = find(accessor, "sparse");
  if (!sparse && !find(accessor, "bufferView")) fail(where + " has no data");
  std::vector<Vec3d> out;
  const auto row = [](const Rows& r, std::uint64_t i) {
    return Vec3d{real_at<float>(r.bytes, r.stride * i), real_at<float>(r.bytes, r.stride * i + 4),
                 real_at<float>(r.bytes, r.stride * i + 8)};
  };
  if (find(accessor, "bufferView")) {
    const Rows data = rows(accessor, where, count, 12);
    out.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) out.push_back(row(data, i));
  } else {
    out.resize(count, {0, 0, 0});
  }
  if (sparse) {
    const std::uint64_t n = unsigned_in(*sparse, "count", where + ".sparse");
    const Json *at = find(*sparse, "indices"), *values = find(*sparse, "values");
    if (!at || !values) fail(where + ".sparse has no indices or no values");
    const std::vector<std::uint32_t> replaced = index_rows(*at, where + ".sparse.indices", n, count);
    const Rows data = rows(*values, where + ".sparse.values", n, 12);
    for (std::uint64_t i = 0; i < n; ++i) out[replaced[i]] = row(data, i);
  }
  for (std::uint64_t i = 0; i < count; ++i)
    if (!std::isfinite(out[i].x) || !std::isfinite(out[i].y) || !std::isfinite(out[i].z))
      fail("position " + std::to_string(i) + " of " + where + " is not finite");
  return out;
}

std::vector<std::uint32_t> Accessors::indices(std::uint64_t index, std::size_t vertices) {
  const Json& accessor = document_.entry("accessors", index);
  const std::string where = place("accessors", index);
  const Json* type = find(accessor, "type");
  if (!type || *type != "SCALAR") fail(where + " holds indices; expected SCALAR");
  if (find(accessor, "sparse") || !find(accessor, "bufferView"))
    fail(where + " holds indices and is sparse or has no data");
  return index_rows(accessor, where, unsigned_in(accessor, "count", where), vertices);
}

std::vector<std::uint32_t> Accessors::index_rows(const Json& holder, const std::string& where, std::uint64_t count,
                                                 std::uint64_t end) {
  const std::uint64_t type = unsigned_in(holder, "componentType", where);
  const std::size_t size = type == 5121 ? 1 : type == 5123 ? 2 : type == 5125 ? 4 : 0;
  if (size == 0) fail(where + " holds indices; expected componentType 5121, 5123 or 5125");
  const Rows data = rows(holder, where, count, size);
  std::vector<std::uint32_t> out(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    out[i] = static_cast<std::uint32_t>(unsigned_at(data.bytes, data.stride * i, size));
    if (out[i] >= end)
      fail("index " + std::to_string(i) + " of " + where + " names vertex " + std::to_string(out[i]) +
           ", and there are " + std::to_string(end) + ", from 0");
  }
  return out;
}

const std::string& Accessors::buffer(std::uint64_t index) {
  const auto [at, fresh] = buffers_.try_emplace(index);
  if (!fresh) return at->second;
  const Json& described = document_.entry("buffers", index);
  const std::string where = place("buffers", index);
  const Json* uri = find(described, "uri");
  if (!uri) {
    if (index != 0 || !chunk_) fail(where + " has no \"uri\"");
    at->second = *chunk_;
  } else if (!uri->is_string()) {
    fail(where + ".uri: expected text");
  } else if (const std::string& text = uri->get_ref<const std::string&>(); text.starts_with("data:")) {
    const std::size_t comma = text.find(',');
    if (comma == std::string::npos || !std::string_view(text).substr(0, comma).ends_with(";base64"))
      fail(where + ".uri: data that is not base64");
    at->second = decoded_base64(std::string_view(text).substr(comma + 1), where);
  } else {
    at->second = folder_.read(without_percents(text));
  }
  const std::uint64_t length = unsigned_in(described, "byteLength", where);
  if (length > at->second.size())
    fail(where + ".byteLength is " + std::to_string(length) + ", and there are " + std::to_string(at->second.size()) +
         " bytes");
  buffer_bytes_ += at->second.size();
  return at->second;
}

}  // namespace clearance::gltf
