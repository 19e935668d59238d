#include "tests/oracle/certificate/motion.h"

#include <algorithm>
#include <charconv>

namespace clearance::certificate_oracle {
namespace {

// Beyond this size, errors of rounding may approach blur().
const Dyadic& largest() {
  static const Dyadic value = Dyadic::power_of_two(64);
  return value;
}

constexpr std::size_t kLongestChain = 500;

struct FramePlacement {
  Vector origin;
  Quaternion q;
};

FramePlacement placement_of(const Value& pose) {
  require(pose.list().size() == 7, "a pose has not seven numbers");
  std::array<Dyadic, 7> x;
  for (std::size_t k = 0; k < 7; ++k) x[k] = pose.at(k).finite();
  return {{x[0], x[1], x[2]}, {x[3], {x[4], x[5], x[6]}}};
}

Id id_of(std::string_view text) {
  Id id = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, id);
  require(error == std::errc() && stop == end && std::to_string(id) == text, "a name is no number");
  return id;
}

}  // namespace

Frame frame_of(const Value& id) {
  return id.is_null() ? Frame() : Frame(id.integer());
}

Body::Body(const Value& document, const std::vector<ConvexPart>& parts_of_all)
    : name(document["name"].text()),
      on(frame_of(document["on"])),
      has_joint(!document["joint"].is_null()),
      pose(&document["pose"]),
      moves(&document["moves"]),
      inner(document["shape"]["inner"].length()),
      outer(document["shape"]["outer"].length()),
      position(document["uncertainty"]["position"].length()),
      chord(chord_above(document["uncertainty"]["angle"].length())),
      moved(Dyadic(document["max_speed"].length()) * document["age_s"].length()),
      centre(document["centre"].vector()) {
  require(!has_joint || !document["joint"].text().empty(), "a joint has no name");
  require(!has_joint || on, "a joint hangs on nothing");
  for (const Value& place : document["pieces"].list())
    wholes.push_back(&parts_of_all[place.index(parts_of_all.size())]);
  for (const ConvexPart* whole : wholes) {
    if (!whole->has_elements()) parts.push_back(whole);
    for (const ConvexPart& element : whole->elements()) parts.push_back(&element);
    whole_of.resize(parts.size(), whole);
  }
  const Dyadic grown = Dyadic(document["padding"].length()) + position;
  for (const ConvexPart* part : wholes) require(part->radius() + inner >= grown, "a body lacks padding or uncertainty");
}

Dyadic Body::farthest_from(const Vector& point) const {
  Dyadic farthest;
  for (const ConvexPart* part : wholes) farthest = std::max(farthest, part->reach(point));
  return farthest + inner;
}

const Dyadic& Body::reach() const {
  if (!reach_) reach_ = farthest_from({});
  return *reach_;
}

const Dyadic& Body::ball() const {
  if (!ball_) ball_ = farthest_from(centre);
  return *ball_;
}

Motion::Motion(const Bodies& bodies, const Value& configuration, std::size_t ends)
    : bodies_(&bodies),
      poses_(ends_of(configuration["poses"], ends)),
      positions_(ends_of(configuration["positions"], ends)) {}

Motion::Ends Motion::ends_of(const Value& document, std::size_t count) const {
  Ends ends;
  for (std::size_t k = 0; k < document.names().size(); ++k) {
    const std::span<const Value> values = document.values()[k].list();
    require(values.size() == count, "an end is missing");
    ends.emplace(id_of(document.names()[k]), values);
  }
  return ends;
}

const Body& Motion::body(Id id) const {
  const auto found = bodies_->find(id);
  require(found != bodies_->end(), "there is no such body");
  return found->second;
}

std::vector<Motion::Step> Motion::steps_between(Id id, std::span<const Value> ends, double time) const {
  const FramePlacement first = placement_of(ends.front()), last = placement_of(ends.back());
  const Vector way = last.origin - first.origin;
  std::vector<Step> steps{{pose_of(first.origin + Dyadic(time) * way, first.q), way, false}};
  auto turn = turns_.find(id);
  if (turn == turns_.end()) turn = turns_.emplace(id, turn_between(first.q, last.q)).first;
  const auto& [axis, angle] = turn->second;
  if (angle.sign() != 0) steps.push_back({turn_about(axis, Dyadic(time) * angle), angle * axis, true});
  return steps;
}

Motion::Step Motion::step_of_joint(const Value& move, double time) const {
  const Value& column = move["column"];
  double first = 0, last = 0;
  if (const auto found = column.is_null() ? positions_.end() : positions_.find(column.integer());
      found != positions_.end()) {
    first = found->second.front().finite();
    last = found->second.back().finite();
  } else {
    first = last = move["stands"].finite();
  }
  const Vector along = move["axis"].vector();
  require(!is_zero(along), "an axis has no direction");
  const Vector axis = unit(along);
  const Dyadic multiplier = move["multiplier"].finite(), way = multiplier * (Dyadic(last) - first);
  const Dyadic now = multiplier * first + move["offset"].finite() + Dyadic(time) * way;
  Step step{{}, way * axis, move["turns"].boolean()};
  if (step.turns) {
    step.pose = turn_about(axis, now);
  } else {
    step.pose.origin = now * axis;
    step.pose.is_rounded = true;
  }
  return step;
}

std::vector<Motion::Step> Motion::steps(Id id, double time) const {
  if (const auto found = poses_.find(id); found != poses_.end()) return steps_between(id, found->second, time);
  const FramePlacement stands = placement_of(*body(id).pose);
  std::vector<Step> steps{{pose_of(stands.origin, stands.q), {}, false}};
  for (const Value& move : body(id).moves->list()) steps.push_back(step_of_joint(move, time));
  return steps;
}

Place Motion::placed(Id id, double time) const {
  const Body& body = this->body(id);
  Place place;
  if (body.on) place = at(*body.on, time);
  bool is_world = !body.on;
  for (Step& step : steps(id, time)) {
    const Pose outer = std::move(place.pose);
    place.pose = is_world ? std::move(step.pose) : composed(outer, step.pose);
    is_world = false;
    if (is_zero(step.rate)) continue;
    place.movers.push_back(std::make_shared<Mover>(
        Mover{rounded(turned(outer.rows, step.rate), outer.divisor), place.pose.origin, step.turns}));
  }
  if (place.pose.is_rounded) {
    const auto& [x, y, z] = place.pose.origin;
    require(std::max({abs(x), abs(y), abs(z), body.reach()}) < largest(), "a body is too large, or too far away");
  }
  return place;
}

const Place& Motion::at(Id id, double time) const {
  const auto found = places_.find({id, time});
  if (found != places_.end()) return found->second;
  require(depth_ < kLongestChain, "a body follows itself, or too many others");
  ++depth_;
  try {
    Place place = placed(id, time);
    --depth_;
    return places_.emplace(std::pair(id, time), std::move(place)).first->second;
  } catch (...) {
    --depth_;
    throw;
  }
}

std::vector<Mover> Motion::path(Frame seer, Id id, double time) const {
  static const Place kWorld;
  const auto& mine = at(id, time).movers;
  const auto& his = (seer ? at(*seer, time) : kWorld).movers;
  const auto [on, back] = std::mismatch(mine.begin(), mine.end(), his.begin(), his.end());
  std::vector<Mover> path;
  for (auto mover = his.end(); mover != back;) {
    path.push_back(**--mover);
    path.back().rate = Dyadic(-1.0) * path.back().rate;
  }
  for (auto mover = on; mover != mine.end(); ++mover) path.push_back(**mover);
  return path;
}

Rates Motion::rates(Frame seer, Id id, double time, const Dyadic& half) const {
  const std::vector<Mover> path = this->path(seer, id, time);
  if (path.empty()) return {};
  const Pose& pose = at(id, time).pose;
  // From the axis of each mover there is a chain of lengths to the body's points: across to the next axis (or to the
  // centre of its ball), with the sliding joints between them, and then `beyond`.
  Vector next = rounded(pose.divisor * pose.origin + turned(pose.rows, body(id).centre), pose.divisor), slide;
  const bool is_turned = std::any_of(path.begin(), path.end(), [](const Mover& mover) { return mover.turns; });
  Dyadic beyond = is_turned ? body(id).ball() : Dyadic(), nearer_turns;  // the speed of a slide does not depend on size
  Rates rates;
  std::vector<Dyadic> speeds, turns;
  for (auto mover = path.rbegin(); mover != path.rend(); ++mover) {
    const Dyadic rate = length_above(mover->rate);
    if (!mover->turns) {
      speeds.push_back(rate);
      turns.emplace_back();
      slide = slide + mover->rate;
      continue;
    }
    const Vector before = next - mover->point - half * slide, after = next - mover->point + half * slide;
    const Dyadic across = std::max(length_above(cross(mover->rate, before)), length_above(cross(mover->rate, after)));
    speeds.push_back(rate * beyond + across);
    turns.push_back(rate);
    beyond += std::max(length_above(before), length_above(after));
    next = mover->point;
    slide = {};
  }
  for (std::size_t k = speeds.size(); k-- > 0;) {  // from the observer on: nearer movers rotate farther ones
    rates.speed += speeds[k];
    rates.bend += speeds[k] * (turns[k] + nearer_turns + nearer_turns);
    nearer_turns += turns[k];
  }
  return rates;
}

std::vector<Id> Motion::frames(Id id) const {
  std::vector<Id> frames;
  for (const Body* body = &this->body(id); body->on;) {
    Id on = *body->on;
    for (std::size_t k = 0; body->has_joint && this->body(on).has_joint; ++k) {
      require(k < kLongestChain, "a body follows itself, or too many others");
      on = *this->body(on).on;
    }
    require(frames.size() < kLongestChain, "a body follows itself, or too many others");
    frames.push_back(on);
    body = &this->body(on);
  }
  std::reverse(frames.begin(), frames.end());
  return frames;
}

MotionUncertainty Motion::uncertainty(Id id, const std::vector<Id>& frames, double time, const Dyadic& half) const {
  const Body& body = this->body(id);
  Dyadic shift, turn, along;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const Body& frame = this->body(frames[k]);
    const Dyadic own = frame.position + frame.moved;
    shift += own + turn * (along + own);
    turn += frame.chord;
    if (turn.sign() == 0) continue;  // then `along` has no effect
    const Id next = k + 1 < frames.size() ? frames[k + 1] : id;
    along = length_above(at(next, time).pose.origin - at(frames[k], time).pose.origin);
  }
  MotionUncertainty uncertainty{body.inner + body.moved + shift, {}};
  if (body.chord.sign() != 0) uncertainty.in_the_middle += body.chord * body.reach();
  if (turn.sign() != 0) uncertainty.in_the_middle += turn * (along + body.moved + body.reach());
  uncertainty.all_along = uncertainty.in_the_middle;
  if (turn.sign() != 0 && half.sign() != 0) uncertainty.all_along += turn * half * rates({}, id, time, half).speed;
  return uncertainty;
}

}  // namespace clearance::certificate_oracle
