// The oracle of certificates: its numbers and rotations, its parser, and documents that are right to the last bit.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <sstream>

#include "tests/oracle/certificate/certificate_oracle.h"
#include "tests/oracle/certificate/convex_part.h"
#include "tests/oracle/certificate/document.h"
#include "tests/oracle/certificate/turns.h"

namespace clearance::certificate_oracle {
namespace {

const Dyadic kTiny = Dyadic::power_of_two(-300);

// Numbers of all sizes, some of which are squares.
Dyadic any_number(std::mt19937_64& random) {
  const double x = std::ldexp(static_cast<double>(random() >> 11), static_cast<int>(random() % 600) - 350);
  const Dyadic sum =
      Dyadic(x) + std::ldexp(static_cast<double>(random() >> 40), static_cast<int>(random() % 600) - 350);
  return random() % 4 == 0 ? sum * sum : sum;
}

TEST(CertificateOracle, RootsAndQuotientsAreRoundedToTheirSide) {
  std::mt19937_64 random(1);
  for (int k = 0; k < 2000; ++k) {
    const Dyadic x = any_number(random), y = any_number(random), more = Dyadic(1.0) + kTiny;
    if (x.sign() == 0 || y.sign() == 0) continue;
    const Dyadic root = root_above(x), above = quotient_above(x, y), below = quotient_below(x, y, 400);
    EXPECT_GT(root * root, x);
    EXPECT_LT(root * root, x * more);
    EXPECT_GE(above * y, x);
    EXPECT_LT(above * y, x * more);
    EXPECT_LE(below * y, x);
    EXPECT_GT((below + Dyadic::power_of_two(-400)) * y, x);
    EXPECT_LE(quotient_above(-x, y) * y, -x * (Dyadic(1.0) - kTiny));
    EXPECT_GE(quotient_above(-x, y) * y, -x);
  }
  EXPECT_EQ(root_above({}).sign(), 0);
}

TEST(CertificateOracle, SumsAndProductsAreExact) {
  std::mt19937_64 random(2);
  for (int k = 0; k < 2000; ++k) {
    const Dyadic x = any_number(random), y = any_number(random), z = any_number(random);
    EXPECT_EQ((x + y) - y, x);
    EXPECT_EQ(x * (y - z), x * y - x * z);
    EXPECT_EQ(x < y, (x - y).sign() < 0);
  }
  EXPECT_EQ(Dyadic(0.1) + Dyadic(0.2) == Dyadic(0.1 + 0.2), false);
}

void expect_near(const Vector& u, const Vector& v) {
  EXPECT_LT(length_above(u - v), kTiny) << u[0].mantissa() << ' ' << v[0].mantissa();
}

TEST(CertificateOracle, TurnsAddUpAndAreFoundAgain) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> number(-1, 1);
  int long_ways = 0;
  for (int k = 0; k < 200; ++k) {
    const Vector axis = unit({number(random), number(random), number(random)});
    const double angle = std::ldexp(number(random), static_cast<int>(random() % 60) - 40);  // up to 2^19 radians
    const Pose once = turn_about(axis, angle), twice = turn_about(axis, 2 * angle);
    for (const Vector& v : Rows{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, axis}})
      expect_near(turned(once.rows, turned(once.rows, v)), turned(twice.rows, v));
    expect_near(turned(once.rows, axis), axis);

    // The angle is computed from quaternions alone, without knowledge of their construction.
    const Quaternion from{number(random), {number(random), number(random), number(random)}};
    const Quaternion to{number(random), {number(random), number(random), number(random)}};
    const Turn turn = turn_between(from, to);
    const Pose start = pose_of({}, from), end = pose_of({}, to), between = turn_about(turn.axis, turn.angle);
    EXPECT_LE(turn.angle, Dyadic(3.1415926535897936));
    long_ways += turn.angle > Dyadic(1.6);
    const Pose there = composed(start, between);
    for (std::size_t row = 0; row < 3; ++row) expect_near(there.rows[row], rounded(end.rows[row], end.divisor));
  }
  EXPECT_GT(long_ways, 50);
}

TEST(CertificateOracle, AQuarterTurnsSineIsOne) {
  // pi to 62 digits in float64 numbers that are added.
  const Dyadic pi = Dyadic(0x1.921fb54442d18p+1) + 0x1.1a62633145c07p-53 + -0x1.f1976b7ed8fbcp-109;
  const Pose quarter = turn_about({0.0, 0.0, 1.0}, Dyadic(0.5) * pi);
  const Vector x = turned(quarter.rows, {1.0, 0.0, 0.0});
  EXPECT_LT(length_above(x - Vector{0.0, 1.0, 0.0}), Dyadic::power_of_two(-155));
  EXPECT_GT(chord_above(1.0), Dyadic(0.9588510772084058));  // 2 sin(1/2) = 0.95885107720840600054...
  EXPECT_LT(chord_above(1.0), Dyadic(0.9588510772084062));
  EXPECT_EQ(chord_above(4.0), Dyadic(2.0));
}

TEST(CertificateOracle, WhatIsNoDocumentIsRejected) {
  for (const char* text : {"", "{", "[1,]", "{\"a\":1,\"a\":2}", "[NaN]", "[1e999]", "{\"a\":1} x", "\"\xff\""})
    EXPECT_THROW(Document{text}, Rejection) << text;
  EXPECT_THROW(Document{std::string(100'000, '[')}, Rejection);
  const Document document(R"({"a": [1, 2.5, "inf", true, null], "b": {"c": -7}})");
  const Value& root = document.root();
  EXPECT_EQ(root["a"].at(1).real(), 2.5);
  EXPECT_EQ(root["a"].at(2).real(), std::numeric_limits<double>::infinity());
  EXPECT_EQ(root["b"]["c"].integer(), -7);
  EXPECT_THROW(root["a"].at(3).real(), Rejection);
  EXPECT_THROW(root["a"].at(1).integer(), Rejection);
  EXPECT_THROW(root["a"].at(2).finite(), Rejection);
  EXPECT_THROW(root["a"].at(5), Rejection);
  EXPECT_THROW(root["c"], Rejection);
}

// |x - y| < 2^-300, and x is at least y.
void expect_just_above(const Dyadic& x, const Dyadic& y) {
  EXPECT_GE(x, y);
  EXPECT_LT(x - y, kTiny);
}

TEST(CertificateOracle, RoundCoresReachAsFarAsTheyAreDeclaredTo) {
  const auto part = [](const std::string& kind) {
    const Document document(R"({"radius":0.5,"core":{"kind":")" + kind +
                            R"(","size":[3,4,4]},"count":1,"vertices":[[0,0,0]]})");
    return ConvexPart(document.root());
  };
  const ConvexPart cylinder = part("cylinder"), cone = part("cone"), egg = part("ellipsoid");
  // Along (3, 4, 12), of length 13: the radius adds 6.5.
  expect_just_above(cylinder.support({3.0, 4.0, 12.0}), 3.0 * 5 + 4 * 12 + 6.5);
  expect_just_above(cone.support({3.0, 4.0, 12.0}), 4.0 * 12 + 6.5);       // the apex
  expect_just_above(cone.support({3.0, 4.0, -12.0}), 3.0 * 5 + 48 + 6.5);  // the rim
  expect_just_above(egg.support({0.0, 3.0, 4.0}), 4.0 * 5 + 2.5);
  expect_just_above(cylinder.reach({0.0, 0.0, 2.0}), 0.5 + 2 + 5);
  expect_just_above(egg.reach({2.0, 0.0, 0.0}), 0.5 + 2 + 4);
  expect_just_above(cylinder.off({3.0, 4.0, 4.0}), 2.0);
  expect_just_above(cone.off({0.75, 0.0, 2.0}), 0.0);  // at a quarter of the radius
  expect_just_above(cone.off({3.0, 4.0, -4.0}), 2.0);
  expect_just_above(egg.off({0.0, 6.0, 8.0}), 15.0);  // (10 / 4 - 1) 10
  EXPECT_LT(egg.off({0.0, 2.0, 0.0}).sign(), 0);
  for (const double z : {4.0000000000000009, -4.0000000000000009})
    for (const ConvexPart* ended : {&cylinder, &cone}) EXPECT_THROW(ended->off({0.0, 0.0, z}), Rejection);
  EXPECT_THROW(part("torus"), Rejection);
}

// Two boxes that are 1 m apart along x (of which all but a bit can be proved, since roots are rounded up). Optionally b
// moves, and may be a single point at x = 1 in its own axes.
struct Boxes {
  std::string lower = "0.9999999999999999", upper = "1", status = "ok", order = "1", slack = "0", inner = "0";
  int direction = 1, part = 0;
  std::string ends;  // of b, if it moves
  std::string margin = "0", free = "null", contact = "null";

  static std::string body(int id, int x, const std::string& inner, int part) {
    std::ostringstream text;
    text << R"({"id":)" << id << R"(,"name":"b","pieces":[)" << part
         << R"(],"centre":[0,0,0],"on":null,"joint":null,"pose":[)" << x
         << R"(,0,0,1,0,0,0],"moves":[],"shape":{"inner":)" << inner
         << R"(,"outer":0},"uncertainty":{"position":0,"angle":0},"padding":0,"max_speed":0,"age_s":0})";
    return text.str();
  }
  std::string text() const {
    std::ostringstream text;
    text << R"({"format":"clearance certificate","version":3,"query":{"reduce":"none","motions":)"
         << (ends.empty() ? "false" : "true") << R"(,"max_distance":"inf","signed_distance":false},
      "pieces":[{"radius":0,"count":8,"vertices":[[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[1,1,1]]},
      {"radius":0,"count":1,"vertices":[[1,0,0]]}],
      "bodies":[)"
         << body(0, 0, inner, 0) << "," << body(1, 2, inner, part)
         << R"(],"configurations":[{"configuration":0,"poses":)" << (ends.empty() ? "{}" : R"({"1":)" + ends + "}")
         << R"(,"positions":{}}],
      "rows":[{"configuration":0,"bodies":[0,1],"status":")"
         << status << R"(","lower":)" << lower << R"(,"upper":)" << upper
         << R"(,"proved":true,"pairs":[{"bodies":[0,1],"margin":)" << margin << R"(,"lower":)" << lower
         << R"(,"spans":[{"begin":0,"end":1,"at":0.5,"slack":{"terms":[{"inner":)" << slack << R"(}]},
      "lower":[{"pieces":null,"order":)"
         << order << R"(,"seer":null,"direction":[[)" << direction << R"(,0],[0,0],[0,0]]}]}],"free":)" << free
         << R"(}],"witness":{"time":1,"pieces":[0,0],"vertices":[[1,0],[7,6]],
      "weights":[[0.75,0],[0.25,0]]},"first_contact":)"
         << contact << "}]}";
    return text.str();
  }
  bool proved() const { return prove_certificate(text()).all_proved(); }
};

// For boxes that come nearer by 1 m.
struct FirstContact {
  std::string free_until = "0.4375", lower = "1.5000000000000002", hit_at = "0.5", time = "0.5", bodies = "[0,1]";
  bool spans = true, witness = true;

  std::string free() const {
    if (!spans) return "null";
    return R"({"lower":)" + lower + R"(,"spans":[{"begin":0,"end":0.4375,"at":0.21875,"slack":{"terms":[]},
      "lower":[{"pieces":null,"order":1,"seer":null,"direction":[[1,0],[0,0],[0,0]]}]}]})";
  }
  std::string contact() const {
    const std::string found =
        R"({"time":)" + time + R"(,"pieces":[0,0],"vertices":[[1,0],[7,6]],"weights":[[0.75,0],[0.25,0]]})";
    return R"({"free_until":)" + free_until + R"(,"hit_at":)" + hit_at + R"(,"bodies":)" + bodies + R"(,"witness":)" +
           (witness ? found : "null") + "}";
  }
};

TEST(CertificateOracle, ABitTooMuchIsFound) {
  const auto with = [](auto change) {
    Boxes boxes;
    change(boxes);
    return boxes.proved();
  };
  EXPECT_TRUE(Boxes().proved());
  EXPECT_TRUE(with([](Boxes& b) { b.upper = "1.0000000000000002"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.lower = b.upper = "1.0000000000000002"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.upper = "0.9999999999999999"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.direction = -1; }));
  EXPECT_FALSE(with([](Boxes& b) { b.direction = 0; }));
  EXPECT_FALSE(with([](Boxes& b) { b.status = "overlap"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.order = "3"; }));
  // Both bodies extend by 1/4.
  EXPECT_TRUE(with([](Boxes& b) { b.inner = "0.25", b.slack = "0.5", b.lower = "0.49999999999999994"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.inner = "0.25", b.slack = "0.5", b.lower = "0.5000000000000001"; }));
  EXPECT_FALSE(with([](Boxes& b) { b.inner = "0.25", b.slack = "0.4999999999999999", b.lower = "0.4"; }));
}

TEST(CertificateOracle, SpeedCountsToTheLastBit) {
  Boxes boxes;
  boxes.ends = "[[3,0,0,1,0,0,0],[2,0,0,1,0,0,0]]";
  for (const char* order : {"1", "2"}) {
    boxes.order = order;
    boxes.lower = "0.9999999999999999";  // at 0.5 they are 1.5 m apart, and come nearer by 0.5 m
    EXPECT_TRUE(boxes.proved());
    boxes.lower = boxes.upper = "1.0000000000000002";
    EXPECT_FALSE(boxes.proved());
    boxes.upper = "1";
  }
  boxes.lower = "0.5";
  EXPECT_TRUE(boxes.proved());
  for (const char* ends : {"[]", "[[3,0,0,1,0,0,0]]", "[[3,0,0,1,0,0,0],[3,0,0,1,0,0,0],[2,0,0,1,0,0,0]]"}) {
    boxes.ends = ends;
    EXPECT_FALSE(boxes.proved()) << "a motion has two ends";
  }
}

// A box in [0, 1]^3 next to the half-space x >= 2, rotated there by a quaternion of length sqrt(2).
struct BoxAndPlane {
  std::string x = "0", lower = "0.9999999999999999", upper = "1", status = "ok";
  std::string direction = "null", quaternion = "1,0,-1,0", radius = "0", angle = "0", on = "null", point = "0", ends;

  std::string text() const {
    return R"({"format":"clearance certificate","version":3,"query":{"reduce":"none","motions":)" +
           std::string(ends.empty() ? "false" : "true") + R"(,"max_distance":"inf","signed_distance":true},
      "pieces":[{"radius":0,"count":8,"vertices":[[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[1,1,1]]},
      {"radius":)" +
           radius + R"(,"count":1,"vertices":[[0,0,0]],"core":{"kind":"half_space","size":[0,0,0]}}],
      "bodies":[)" +
           body("0", x + ",0,0,1,0,0,0", "0", "null") + "," + body("1", "2,0,0," + quaternion, angle, on) +
           R"(],"configurations":[{"configuration":0,"poses":)" + (ends.empty() ? "{}" : R"({"1":)" + ends + "}") +
           R"(,"positions":{}}],
      "rows":[{"configuration":0,"bodies":[0,1],"status":")" +
           status + R"(","lower":)" + lower + R"(,"upper":)" + upper +
           R"(,"proved":true,"pairs":[{"bodies":[0,1],"margin":0,"lower":)" + lower +
           R"(,"spans":[{"begin":0,"end":1,"at":0.5,"slack":{"terms":[]},
      "lower":[{"pieces":null,"order":1,"seer":null,"direction":)" +
           direction + R"(}]}],"free":null}],"witness":{"time":0,"pieces":[0,0],"vertices":[[5,0]],
      "points":[null,[[[0,0],[0.5,0],[)" +
           point + R"(,0]]]],"weights":[[0.75,0]]},"first_contact":null}]})";
  }
  static std::string body(const std::string& id, const std::string& pose, const std::string& angle,
                          const std::string& on) {
    return R"({"id":)" + id + R"(,"name":"b","pieces":[)" + id + R"(],"centre":[0,0,0],"on":)" + on +
           R"(,"joint":null,"pose":[)" + pose +
           R"(],"moves":[],"shape":{"inner":0,"outer":0},"uncertainty":{"position":0,"angle":)" + angle +
           R"(},"padding":0,"max_speed":0,"age_s":0})";
  }
};

TEST(CertificateOracle, HalfSpacesCountToTheLastBit) {
  const auto with = [](auto change) {
    BoxAndPlane bodies;
    change(bodies);
    return prove_certificate(bodies.text()).all_proved();
  };
  EXPECT_TRUE(with([](BoxAndPlane&) {}));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.lower = b.upper = "1.0000000000000002"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.lower = "0.9", b.upper = "0.9999999999999999"; }));
  EXPECT_TRUE(with([](BoxAndPlane& b) { b.radius = "0.25", b.lower = "0.7499999999999999", b.upper = "0.75"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.radius = "0.25", b.lower = "0.7500000000000001", b.upper = "0.8"; }));
  // In it by 1/2, for any common point of both.
  const auto deep = [&](const char* lower, const char* upper) {
    return with([&](BoxAndPlane& b) { b.x = "1.5", b.status = "overlap", b.lower = lower, b.upper = upper; });
  };
  EXPECT_TRUE(deep("-0.5000000000000001", "-0.5"));
  EXPECT_FALSE(deep("-0.6", "-0.5000000000000001"));
  EXPECT_FALSE(deep("-0.4999999999999999", "-0.4"));
  // Only its own normal is a proof, and only if the half-space cannot rotate.
  EXPECT_TRUE(with([](BoxAndPlane& b) { b.direction = "[[1,0],[0,0],[0,0]]"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.direction = "[[1,0],[0,0],[0,1e-300]]", b.lower = "0.1"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.direction = "[[-1,0],[0,0],[0,0]]", b.lower = "0.1"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.quaternion = "1,0,1,0", b.lower = "0.1"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.angle = "1e-300", b.lower = "0.1"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.on = "0", b.lower = "0.1"; }));
  // The height of a witness point over the plane is subtracted; a point below it weakens the bound.
  EXPECT_TRUE(with([](BoxAndPlane& b) { b.point = "0.25"; }));
  EXPECT_FALSE(with([](BoxAndPlane& b) { b.point = "-0.25"; }));
  // It comes nearer by 1/2 until either end, and must not rotate.
  const auto moves = [&](const char* lower, const char* ends) {
    return with([&](BoxAndPlane& b) { b.lower = lower, b.ends = ends, b.upper = "2"; });
  };
  EXPECT_TRUE(moves("0.9999999999999999", "[[3,0,0,1,0,-1,0],[2,0,0,1,0,-1,0]]"));
  EXPECT_FALSE(moves("1.0000000000000002", "[[3,0,0,1,0,-1,0],[2,0,0,1,0,-1,0]]"));
  EXPECT_FALSE(moves("0.1", "[[3,0,0,1,0,-1,0],[3,0,0,1,0,-1.0001,0]]"));
}

// 2 - t apart at t, so that they are within 1.5 m at 1/2, and until 7/16 beyond 1.5625 m.
TEST(CertificateOracle, FirstContactCountsToTheLastBit) {
  const auto with = [](auto change) {
    Boxes boxes;
    boxes.ends = "[[3,0,0,1,0,0,0],[2,0,0,1,0,0,0]]";
    boxes.margin = "1.5";
    FirstContact first;
    change(boxes, first);
    boxes.free = first.free();
    boxes.contact = first.contact();
    return boxes.proved();
  };
  using F = FirstContact;
  EXPECT_TRUE(with([](Boxes&, F&) {}));
  // Free by a margin means beyond it.
  EXPECT_TRUE(with([](Boxes& b, F& f) {
    b.margin = "1.5624999999999996", f.lower = "1.5624999999999998", f.hit_at = f.time = "0.4375000000000005";
  }));
  EXPECT_FALSE(with([](Boxes& b, F&) { b.margin = "1.5625"; }));
  EXPECT_TRUE(with([](Boxes&, F& f) { f.lower = "1.5624999999999998"; }));
  EXPECT_FALSE(with([](Boxes&, F& f) { f.lower = "1.5625000000000002"; }));
  EXPECT_FALSE(with([](Boxes&, F& f) { f.lower = "1.5"; }));
  // Spans end where the free time ends, which is not after the end of the motion.
  for (const char* until : {"0.43750000000000006", "0.4375000000000001", "0.25", "0", "1", "\"inf\"", "-0.4375"})
    EXPECT_FALSE(with([=](Boxes&, F& f) { f.free_until = until; })) << until;
  EXPECT_FALSE(with([](Boxes&, F& f) { f.spans = false; }));
  EXPECT_TRUE(with([](Boxes&, F& f) { f.spans = false, f.free_until = "0"; }));
  // It is within its margin at the time of the hit.
  EXPECT_FALSE(with([](Boxes& b, F&) { b.margin = "1.4999999999999998"; }));
  EXPECT_FALSE(with([](Boxes&, F& f) { f.hit_at = f.time = "0.49999999999999994"; }));
  EXPECT_TRUE(with([](Boxes&, F& f) { f.hit_at = f.time = "0.5000000000000001"; }));
  EXPECT_TRUE(with([](Boxes&, F& f) { f.hit_at = f.time = "1"; }));
  for (const char* time : {"0.75", "\"inf\"", "-0.5", "1.5"})
    EXPECT_FALSE(with([=](Boxes&, F& f) { f.hit_at = time; }));
  EXPECT_FALSE(with([](Boxes&, F& f) { f.hit_at = f.time = "1.5"; }));
  EXPECT_FALSE(with([](Boxes&, F& f) { f.bodies = "[1,0]"; })) << "a witness of a pair that the row has not";
  EXPECT_FALSE(with([](Boxes&, F& f) { f.witness = false; }));
  EXPECT_TRUE(with([](Boxes&, F& f) { f.witness = false, f.hit_at = "\"inf\""; })) << "it says nothing of a hit";
}

TEST(CertificateOracle, WhatIsProvedAllAlongIsFreeUntilTheEnd) {
  Boxes boxes;
  boxes.ends = "[[3,0,0,1,0,0,0],[2,0,0,1,0,0,0]]";
  boxes.contact = R"({"free_until":"inf","hit_at":"inf","bodies":[null,null],"witness":null})";
  boxes.margin = "0.9999999999999998";
  EXPECT_TRUE(boxes.proved());
  boxes.margin = boxes.lower;
  EXPECT_FALSE(boxes.proved()) << "no nearer than the margin is not beyond it";
  boxes.margin = "0.5";
  boxes.contact = R"({"free_until":1.5,"hit_at":"inf","bodies":[null,null],"witness":null})";
  EXPECT_FALSE(boxes.proved());
  boxes.lower = "0", boxes.status = "unconverged";  // nothing is proved for the whole motion
  boxes.contact = R"({"free_until":"inf","hit_at":"inf","bodies":[null,null],"witness":null})";
  EXPECT_FALSE(boxes.proved());
}

TEST(CertificateOracle, TurnsBendWays) {
  Boxes boxes;
  boxes.part = 1;
  boxes.ends = "[[3,0,0,1,0,0,0],[3,0,0,0.8775825618903728,0,0,0.479425538604203]]";  // a rotation by 1 about z
  boxes.upper = "\"inf\"";
  const auto proved = [&](const char* order, const char* lower) {
    boxes.order = order, boxes.lower = lower;
    return boxes.proved();
  };
  // In the middle 2 + cos(1/2) = 2.87758 apart. By speed that may become less by 1/2; along the normal by sin(1/2) / 2
  // = 0.23971 and the bend, 1/8. It becomes 2 + cos(1) = 2.54030.
  EXPECT_TRUE(proved("1", "2.3775"));
  EXPECT_FALSE(proved("1", "2.3776"));
  EXPECT_TRUE(proved("2", "2.5128"));
  EXPECT_FALSE(proved("2", "2.5129"));
}

}  // namespace
}  // namespace clearance::certificate_oracle
