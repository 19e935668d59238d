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

// \param may_grow whether an eighth number may follow, the body's growth
FramePlacement placement_of(const Value& pose, bool may_grow = false) {
  const std::size_t count = pose.list().size();
  require(count == 7 || (may_grow && count == 8), "a pose has not seven numbers");
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

Motion::Motion(const Bodies& bodies, const Value& configuration, bool moves)
    : bodies_(&bodies), poses_(ends_of(configuration["poses"])), positions_(ends_of(configuration["positions"])) {
  const std::size_t ends = moves ? 2 : 1, most = moves ? kMostPoints : 1;
  const Ends& any = positions_.empty() ? poses_ : positions_;
  for (const Ends* given : {&poses_, &positions_})
    for (const auto& [name, values] : *given) {
      require(values.size() == any.begin()->second.size(), "a control point is missing");
      require(ends <= values.size() && values.size() <= most, "a curve has too few control points, or too many");
      degree_ = values.size() - 1;
    }
}

Motion::Ends Motion::ends_of(const Value& document) const {
  Ends ends;
  for (std::size_t k = 0; k < document.names().size(); ++k)
    ends.emplace(id_of(document.names()[k]), document.values()[k].list());
  return ends;
}

const Body& Motion::body(Id id) const {
  const auto found = bodies_->find(id);
  require(found != bodies_->end(), "there is no such body");
  return found->second;
}

std::vector<Motion::Step> Motion::steps_between(Id id, std::span<const Value> ends, double time) const {
  const FramePlacement first = placement_of(ends.front(), true), last = placement_of(ends.back(), true);
  const Vector way = last.origin - first.origin;
  std::vector<Step> steps{{pose_of(first.origin + Dyadic(time) * way, first.q), way, false, Curve({0.0, 1.0})}};
  auto turn = turns_.find(id);
  if (turn == turns_.end()) turn = turns_.emplace(id, turn_between(first.q, last.q)).first;
  const auto& [axis, angle] = turn->second;
  if (angle.sign() != 0)
    steps.push_back({turn_about(axis, Dyadic(time) * angle), axis, true, Curve({Dyadic(), angle})});
  return steps;
}

// A body along a curve slides along three axes and does not turn.
std::vector<Motion::Step> Motion::steps_along(std::span<const Value> controls, double time) const {
  constexpr double kAxes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Quaternion q = placement_of(controls.front(), true).q;
  std::vector<Dyadic> coordinates[3];
  for (const Value& control : controls) {
    const FramePlacement placed = placement_of(control, true);
    require(placed.q.w == q.w && placed.q.v == q.v, "a body turns along a curve");
    for (std::size_t k = 0; k < 3; ++k) coordinates[k].push_back(placed.origin[k]);
  }
  std::vector<Step> steps;
  for (std::size_t k = 0; k < 3; ++k) {
    Step& step =
        steps.emplace_back(Step{{}, {kAxes[k][0], kAxes[k][1], kAxes[k][2]}, false, Curve(std::move(coordinates[k]))});
    step.pose.origin = step.curve.at(time) * step.axis;
  }
  steps.push_back({pose_of({}, q), {}});
  return steps;
}

Motion::Step Motion::step_of_joint(const Value& move, double time) const {
  const Value& column = move["column"];
  const Dyadic multiplier = move["multiplier"].finite(), offset = move["offset"].finite();
  std::vector<Dyadic> points;
  const auto add = [&](const Value& position) { points.push_back(multiplier * position.finite() + offset); };
  const auto found = column.is_null() ? positions_.end() : positions_.find(column.integer());
  if (found == positions_.end())
    add(move["stands"]);
  else
    for (const Value& position : found->second) add(position);
  const Vector along = move["axis"].vector();
  require(!is_zero(along), "an axis has no direction");
  Step step{{}, unit(along), move["turns"].boolean(), Curve(std::move(points))};
  const Dyadic now = step.curve.at(time);
  if (step.turns) {
    step.pose = turn_about(step.axis, now);
  } else {
    step.pose.origin = now * step.axis;
    step.pose.is_rounded = true;
  }
  return step;
}

std::vector<Motion::Step> Motion::steps(Id id, double time) const {
  if (const auto found = poses_.find(id); found != poses_.end())
    return found->second.size() > 2 ? steps_along(found->second, time) : steps_between(id, found->second, time);
  const FramePlacement stands = placement_of(*body(id).pose);
  std::vector<Step> steps{{pose_of(stands.origin, stands.q), {}}};
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
    if (is_zero(step.axis) || step.curve.is_still()) continue;
    place.movers.push_back(std::make_shared<Mover>(Mover{rounded(turned(outer.rows, step.axis), outer.divisor),
                                                         place.pose.origin, step.turns, std::move(step.curve)}));
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
    path.back().axis = Dyadic(-1.0) * path.back().axis;
  }
  for (auto mover = on; mover != mine.end(); ++mover) path.push_back(**mover);
  return path;
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

MotionUncertainty Motion::uncertainty(Id id, const std::vector<Id>& frames, const Span& span) const {
  const Body& body = this->body(id);
  Dyadic shift, turn, along;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const Body& frame = this->body(frames[k]);
    const Dyadic own = frame.position + frame.moved;
    shift += own + turn * (along + own);
    turn += frame.chord;
    if (turn.sign() == 0) continue;  // then `along` has no effect
    const Id next = k + 1 < frames.size() ? frames[k + 1] : id;
    along = length_above(at(next, span.at).pose.origin - at(frames[k], span.at).pose.origin);
  }
  MotionUncertainty uncertainty{body.inner + body.moved + shift, {}};
  if (body.chord.sign() != 0) uncertainty.in_the_middle += body.chord * body.reach();
  if (turn.sign() != 0) uncertainty.in_the_middle += turn * (along + body.moved + body.reach());
  uncertainty.all_along = uncertainty.in_the_middle;
  if (turn.sign() != 0) uncertainty.all_along += turn * rates({}, id, span).way;
  return uncertainty;
}

}  // namespace clearance::certificate_oracle
