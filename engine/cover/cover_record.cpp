#include "engine/cover/cover_record.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "algorithm_version.h"
#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

namespace {

/// Header of a record. The packets follow, in order and without padding.
struct CoverHeader {
  double seconds, reach;
  CoverBall root;
  std::array<std::uint32_t, Cover::kLevels + 1> level_begin;
};
/// A packet without padding.
struct PacketRecord {
  std::array<std::array<float, BallPacket::kBalls>, 5> columns;
  std::array<std::uint32_t, BallPacket::kBalls> children;
  std::uint32_t count;
};
static_assert(sizeof(CoverHeader) == 16 + 20 + 20 && sizeof(PacketRecord) == 4 * (6 * BallPacket::kBalls + 1));

constexpr std::array kColumns{&BallPacket::x, &BallPacket::y, &BallPacket::z, &BallPacket::outer, &BallPacket::inner};

PacketRecord record_of(const BallPacket& packet) {
  PacketRecord record{};
  for (std::size_t c = 0; c < kColumns.size(); ++c)
    std::copy_n(packet.*kColumns[c], BallPacket::kBalls, record.columns[c].begin());
  std::copy_n(packet.children, BallPacket::kBalls, record.children.begin());
  record.count = packet.count;
  return record;
}

BallPacket packet_of(const PacketRecord& record) {
  BallPacket packet{};
  for (std::size_t c = 0; c < kColumns.size(); ++c)
    std::copy(record.columns[c].begin(), record.columns[c].end(), packet.*kColumns[c]);
  std::copy(record.children.begin(), record.children.end(), packet.children);
  packet.count = record.count;
  return packet;
}

bool is_sound(const CoverBall& ball, double reach) {
  const auto [x, y, z] = ball.centre;
  return std::hypot(double{x}, double{y}, double{z}) <= reach * (1 + 0x1p-40) && ball.outer >= 0 &&
         ball.outer <= kMaxCoordinate && std::abs(ball.inner) <= kMaxCoordinate;
}

/// Whether the balls in use have finite radii, the others none, and children are packets of the next level.
bool is_sound(const BallPacket& packet, const Cover& cover, int level) {
  if (packet.count < 1 || packet.count > BallPacket::kBalls) return false;
  for (std::uint32_t i = 0; i < packet.count; ++i) {
    const std::uint32_t children = packet.children[i];
    if (!is_sound({{packet.x[i], packet.y[i], packet.z[i]}, packet.outer[i], packet.inner[i]}, cover.reach) ||
        (children != kNone && (level + 1 == Cover::kLevels || children < cover.level_begin[level + 1] ||
                               children >= cover.level_begin[level + 2])))
      return false;
  }
  for (std::uint32_t i = packet.count; i < BallPacket::kBalls; ++i)
    if (packet.outer[i] != BallPacket::kNoRadius || packet.inner[i] != BallPacket::kNoRadius ||
        !std::isfinite(packet.x[i]) || !std::isfinite(packet.y[i]) || !std::isfinite(packet.z[i]))
      return false;
  return true;
}

bool is_sound(const Cover& cover) {
  const auto& begin = cover.level_begin;
  if (begin[0] != 0 || begin[1] != 0 || !std::is_sorted(begin.begin(), begin.end()) || begin[2] == 0 ||
      begin.back() != cover.packets.size() || !(cover.reach >= 0 && cover.reach <= kMaxCoordinate) ||
      !is_sound(cover.root, cover.reach))
    return false;
  for (int level = 1; level < Cover::kLevels; ++level)
    for (const BallPacket& packet : cover.level(level))
      if (!is_sound(packet, cover, level)) return false;
  return true;
}

}  // namespace

bool may_have_cover(std::span<const ConvexPartPtr> parts) {
  return !parts.empty() && parts.size() <= kMostCoveredParts &&
         std::none_of(parts.begin(), parts.end(), [](const ConvexPartPtr& part) { return is_half_space(*part); });
}

bool same_parts(std::span<const ConvexPartPtr> a, std::span<const ConvexPartPtr> b) {
  const auto is_same_point = [](const Vec3d& p, const Vec3d& q) { return p.x == q.x && p.y == q.y && p.z == q.z; };
  const auto are_same_points = [&](std::span<const Vec3d> p, std::span<const Vec3d> q) {
    return std::equal(p.begin(), p.end(), q.begin(), q.end(), is_same_point);
  };
  const auto is_same_mesh = [&](const SurfacePtr& p, const SurfacePtr& q) {
    return p == q ||
           (p && q && p->kind() == q->kind() && are_same_points(p->vertices(), q->vertices()) &&
            std::equal(p->triangles().begin(), p->triangles().end(), q->triangles().begin(), q->triangles().end()) &&
            p->edge() == q->edge() && std::ranges::equal(p->points(), q->points()));
  };
  const auto is_same = [&](const ConvexPartPtr& p, const ConvexPartPtr& q) {
    return p == q || (p->digest == q->digest && p->radius == q->radius && same_primitive(*p, *q) &&
                      are_same_points(p->vertices, q->vertices) && is_same_mesh(p->surface, q->surface));
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), is_same);
}

std::string cover_name(std::span<const ConvexPartPtr> parts) {
  CacheKey key("cover", kAlgorithmVersion);
  for (const ConvexPartPtr& part : parts) {
    key.add(part->radius).add(static_cast<std::uint64_t>(part->primitive ? part->primitive->kind : Primitive::Kind{}));
    for (int k = 0; k < 3; ++k) key.add(part->primitive ? part->primitive->size[k] : 0);
    const auto add_bytes = [&](const auto& values) {
      key.add(std::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof values[0]));
    };
    add_bytes(part->vertices);
    if (!part->surface) continue;
    key.add(static_cast<std::uint64_t>(part->surface->kind())).add(double{part->surface->edge()});
    add_bytes(part->surface->vertices());
    add_bytes(part->surface->triangles());
    add_bytes(part->surface->points());
  }
  return key.name();
}

std::vector<std::byte> cover_record(const TimedCover& made) {
  const Cover& cover = made.cover;
  const CoverHeader header{made.seconds, cover.reach, cover.root, cover.level_begin};
  std::vector<std::byte> bytes(sizeof header + cover.packets.size() * sizeof(PacketRecord));
  std::memcpy(bytes.data(), &header, sizeof header);
  std::byte* to = bytes.data() + sizeof header;
  for (const BallPacket& packet : cover.packets) {
    const PacketRecord record = record_of(packet);
    std::memcpy(to, &record, sizeof record);
    to += sizeof record;
  }
  return bytes;
}

std::optional<TimedCover> cover_of_record(std::span<const std::byte> record) {
  CoverHeader header;
  if (record.size() < sizeof header || (record.size() - sizeof header) % sizeof(PacketRecord) != 0) return {};
  std::memcpy(&header, record.data(), sizeof header);
  TimedCover made{{header.root, {}, header.level_begin, header.reach}, header.seconds};
  for (record = record.subspan(sizeof header); !record.empty(); record = record.subspan(sizeof(PacketRecord))) {
    PacketRecord packet;
    std::memcpy(&packet, record.data(), sizeof packet);
    made.cover.packets.push_back(packet_of(packet));
  }
  made.cover.packets.shrink_to_fit();
  made.cover.find_spread();
  if (!(made.seconds >= 0) || !std::isfinite(made.seconds) || !is_sound(made.cover)) return {};
  return made;
}

std::optional<TimedCover> read_cover(const Cache& cache, const std::string& name) {
  const std::optional<std::vector<std::byte>> record = cache.read(name);
  return record ? cover_of_record(*record) : std::nullopt;
}

std::optional<TimedCover> make_timed_cover(const Cache& cache, const std::string& name,
                                           std::span<const ConvexPartPtr> parts, const std::atomic<bool>* stopped) {
  const auto begin = std::chrono::steady_clock::now();
  std::optional<Cover> cover = make_cover(parts, stopped);
  if (!cover) return {};
  TimedCover made{std::move(*cover), std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count()};
  if (cache.is_on()) cache.write(name, cover_record(made));
  return made;
}

}  // namespace clearance
