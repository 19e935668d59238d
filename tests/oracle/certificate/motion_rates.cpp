// Bounds on the motion of bodies and their growth in a span.
#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "tests/oracle/certificate/motion.h"

namespace clearance::certificate_oracle {
namespace {

// Control points along an axis, of one side of a span.
using Way = std::vector<Vector>;
using Ways = std::array<Way, 2>;

Ways ways_of(const Mover& mover, const Span& span) {
  Ways ways;
  for (std::size_t side = 0; side < 2; ++side)
    for (const Dyadic& place : mover.curve.way(span.at, span.end_of(side))) ways[side].push_back(place * mover.axis);
  return ways;
}

// Places at both ends of the range of a sliding joint in a span.
std::vector<Vector> slid(const std::vector<Vector>& places, const Mover& mover, const Span& span) {
  std::vector<Dyadic> range = mover.curve.way(span.at, span.begin);
  const std::vector<Dyadic> after = mover.curve.way(span.at, span.end);
  range.insert(range.end(), after.begin(), after.end());
  const auto [least, greatest] = std::minmax_element(range.begin(), range.end());
  std::vector<Vector> all;
  for (const Vector& place : places)
    for (const Dyadic& by : {*least, *greatest}) all.push_back(place + by * mover.axis);
  return all;
}

// Part of a body's motion that moves its points no more than `reach` times its own way.
struct Part {
  Dyadic reach, turn;  // turn: radians for each unit of its way
  Ways ways;
};

Dyadic longest(const Way& way) {
  Dyadic most;
  for (const Vector& control : way) most = std::max(most, length_above(control));
  return most;
}

// Control points without a share of the last one.
Way rest_of(const Way& way, const std::vector<Dyadic>& progress) {
  require(way.size() == progress.size(), "a progress has another degree than a curve");
  Way rest;
  for (std::size_t i = 0; i < way.size(); ++i) rest.push_back(way[i] - progress[i] * way.back());
  return rest;
}

Rates rates_of(const std::vector<Part>& parts, const Span& span) {
  Rates rates;
  for (std::size_t side = 0; side < 2; ++side) {
    Dyadic way;
    for (const Part& part : parts) way += part.reach * longest(part.ways[side]);
    rates.way = std::max(rates.way, way);
    for (const int share : {0, 1}) {
      Dyadic turned, &rest = rates.rest[side][share];
      for (auto part = parts.rbegin(); part != parts.rend(); ++part) {  // nearer movers rotate farther ones
        const Dyadic more = longest(rest_of(part->ways[side], span.progress[side]));
        const Dyadic by = share == 0 ? more : more + length_above(part->ways[side].back());
        rest += part->reach * (more + by * (Dyadic(0.5) * part->turn * by + turned));
        turned += part->turn * by;
      }
    }
  }
  return rates;
}

}  // namespace

Rates Motion::rates(Frame seer, Id id, const Span& span) const {
  const std::vector<Mover> path = this->path(seer, id, span.at);
  if (path.empty()) return {};
  const Pose& pose = at(id, span.at).pose;
  // From the axis of each mover there is a chain of lengths to the body's points: across to the next axis (or to the
  // centre of its ball), wherever the sliding joints between them lead, and then `beyond`.
  std::vector<Vector> nexts{rounded(pose.divisor * pose.origin + turned(pose.rows, body(id).centre), pose.divisor)};
  const bool is_turned = std::any_of(path.begin(), path.end(), [](const Mover& mover) { return mover.turns; });
  Dyadic beyond = is_turned ? body(id).ball() : Dyadic();  // the speed of a slide does not depend on size
  std::vector<Part> parts;
  bool slides = false;  // the last part consists of sliding joints, which may go on
  for (auto mover = path.rbegin(); mover != path.rend(); ++mover) {
    Ways ways = ways_of(*mover, span);
    if (!mover->turns) {
      nexts = slid(nexts, *mover, span);
      if (!slides) parts.push_back({1.0, {}, {Way(ways[0].size()), Way(ways[1].size())}});
      slides = true;
      for (std::size_t side = 0; side < 2; ++side) {
        Way& sum = parts.back().ways[side];
        require(sum.size() == ways[side].size(), "curves have different degrees");
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] = sum[i] + ways[side][i];
      }
      continue;
    }
    slides = false;
    Dyadic across, farthest;
    for (const Vector& next : nexts) {
      across = std::max(across, length_above(cross(mover->axis, next - mover->point)));
      farthest = std::max(farthest, length_above(next - mover->point));
    }
    const Dyadic length = length_above(mover->axis);
    parts.push_back({length * beyond + across, length, std::move(ways)});
    beyond += farthest;
    nexts = {mover->point};
  }
  return rates_of(parts, span);
}

std::optional<Curve> Motion::curve_of_growth(Id id) const {
  const auto found = poses_.find(id);
  if (found == poses_.end()) return {};
  const auto grows = [](const Value& pose) { return pose.list().size() == 8; };
  const auto count = static_cast<std::size_t>(std::count_if(found->second.begin(), found->second.end(), grows));
  if (count == 0) return {};
  require(count == found->second.size(), "a growth is missing");
  std::vector<Dyadic> points;
  for (const Value& pose : found->second) points.emplace_back(pose.at(7).length());
  return Curve(std::move(points));
}

Dyadic Motion::growth(Id id, double time) const {
  const std::optional<Curve> curve = curve_of_growth(id);
  return curve ? curve->at(time) : Dyadic();
}

Growth Motion::growth(Id id, const Span& span) const {
  const std::optional<Curve> curve = curve_of_growth(id);
  if (!curve) return {};
  Growth growth;
  growth.size = curve->at(span.at);
  for (std::size_t side = 0; side < 2; ++side) {
    const std::vector<Dyadic> way = curve->way(span.at, span.end_of(side));
    growth.more[side] = way.back();
    Dyadic& rest = growth.most.rest[side][0];
    for (std::size_t i = 0; i < way.size(); ++i) {
      growth.most.way = std::max(growth.most.way, way[i]);
      rest = std::max(rest, way[i] - span.progress[side].at(i) * way.back());
    }
    growth.most.rest[side][1] = rest;
  }
  return growth;
}

std::vector<Dyadic> Motion::progress(const Value* given) const {
  std::vector<Dyadic> progress;
  if (!given || given->is_null()) {  // any is valid: this one leaves the most, and nothing of a straight motion
    progress.resize(degree_ + 1);
    progress.back() = 1.0;
    return progress;
  }
  require(given->list().size() == degree_ + 1, "a progress has another degree than its curves");
  for (std::size_t i = 0; i <= degree_; ++i) {
    progress.emplace_back(given->at(i).length());
    require(progress.back() <= Dyadic(1.0), "a progress leads too far");
  }
  return progress;
}

}  // namespace clearance::certificate_oracle
