// Bodies of a certificate, their poses in one of its configurations, and bounds on their speeds.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/oracle/certificate/convex_part.h"
#include "tests/oracle/certificate/curve.h"
#include "tests/oracle/certificate/turns.h"

namespace clearance::certificate_oracle {

using Id = std::int64_t;
/// A body, or none for the world.
using Frame = std::optional<Id>;
Frame frame_of(const Value& id);

/// A body in a document, which must outlive it. Poses and joints are read when a row needs them, since those of a body
/// without a usable pose are not numbers.
class Body {
 public:
  Body(const Value& document, const std::vector<ConvexPart>& parts);

  /// Bound on the distance of the true body's points from its origin, or from `centre`.
  const Dyadic& reach() const;
  const Dyadic& ball() const;

  std::string name;
  Frame on;
  bool has_joint;
  std::vector<const ConvexPart*> parts;     ///< elements of surfaces and clouds count as parts
  std::vector<const ConvexPart*> whole_of;  ///< for each, the part that it is an element of, or itself
  std::vector<const ConvexPart*> wholes;    ///< each once
  const Value *pose, *moves;
  Dyadic inner, outer, position;
  Dyadic chord;  ///< of the angle by which it may be rotated: bound on the motion of a point 1 m away
  Dyadic moved;  ///< since the time of its pose
  Vector centre;

 private:
  Dyadic farthest_from(const Vector& point) const;
  mutable std::optional<Dyadic> reach_, ball_;
};

using Bodies = std::map<Id, Body>;

/// Motion of a body in the world at some time: points move along `axis`, or rotate about it through `point`, by the
/// positions of a curve.
struct Mover {
  Vector axis, point;
  bool turns;
  Curve curve;
};

/// A body at a time. Bodies with the same carriers share their first movers.
struct Place {
  Pose pose;
  std::vector<std::shared_ptr<const Mover>> movers;  ///< from the world on
};

/// A part of a motion, and the time in it at which bodies are placed. It has two sides, until either end.
struct Span {
  double begin, at, end;
  /// For each side, control points of a progress from 0 to 1.
  std::array<std::vector<Dyadic>, 2> progress;
  double end_of(std::size_t side) const { return side == 0 ? begin : end; }
};

/// Bounds in a span, in metres: on the way of a body's points from their places at its time `at` and, for each side, on
/// their distance from a uniform motion to its end, at a progress of 0 and 1.
struct Rates {
  Dyadic way;
  Dyadic rest[2][2];
};

/// How much a body is grown at a span's time `at`, in metres, how much more at either end, and as Rates.
struct Growth {
  Dyadic size, more[2];
  Rates most;
};

/// Uncertainty of a body, in metres, in the middle of a span, and throughout it.
struct MotionUncertainty {
  Dyadic in_the_middle, all_along;
};

/// Bodies in one configuration: between its two ends at times in [0, 1], or at its only one.
class Motion {
 public:
  /// The bodies and the document must outlive this.
  Motion(const Bodies& bodies, const Value& configuration, bool moves);

  const Body& body(Id id) const;
  const Place& at(Id id, double time) const;
  /// Motion of a body as observed by `seer`.
  std::vector<Mover> path(Frame seer, Id id, double time) const;
  Rates rates(Frame seer, Id id, const Span& span) const;
  Growth growth(Id id, const Span& span) const;
  /// At one time, in metres.
  Dyadic growth(Id id, double time) const;
  /// The progress that a span's document has for a side.
  std::vector<Dyadic> progress(const Value* given) const;
  /// The bodies that it follows, the farthest first, without links of its own robot that carry it.
  std::vector<Id> frames(Id id) const;
  /// \param frames those of them that count
  MotionUncertainty uncertainty(Id id, const std::vector<Id>& frames, const Span& span) const;

 private:
  // One of the steps from the carrier of a body to the body: a pose in the step before, and what changes it.
  struct Step {
    Pose pose;
    Vector axis;
    bool turns = false;
    Curve curve = Curve({Dyadic()});
  };
  using Ends = std::map<Id, std::span<const Value>>;

  Ends ends_of(const Value& document) const;
  std::optional<Curve> curve_of_growth(Id id) const;
  std::vector<Step> steps(Id id, double time) const;
  std::vector<Step> steps_between(Id id, std::span<const Value> ends, double time) const;
  std::vector<Step> steps_along(std::span<const Value> controls, double time) const;
  Step step_of_joint(const Value& move, double time) const;
  Place placed(Id id, double time) const;

  const Bodies* bodies_;
  Ends poses_, positions_;
  std::size_t degree_ = 1;  // of curves
  mutable std::map<std::pair<Id, double>, Place> places_;
  mutable std::map<Id, Turn> turns_;
  mutable std::size_t depth_ = 0;
};

}  // namespace clearance::certificate_oracle
