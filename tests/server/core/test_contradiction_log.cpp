// The daemon counts contradictory bounds, and logs them once.
#include <map>

#include "engine/hull/hull.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/cases/misleading_table.h"
#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::FrameType;

/// Balls around one whose direction table has a wrong entry.
engine::Scene misled_scene() {
  const ConvexPartPtr ball = make_hull_part(make_uv_sphere(1, 20).vertices, {}, 0);
  PortableRandom random(4);
  engine::Scene scene;
  for (int i = 0; i < 100; ++i) {
    Body body;
    body.name = "ball" + std::to_string(i);
    body.parts = {i == 0 ? exact::with_misleading_table(*ball, {0.6, 0.64, 0.48}) : ball};
    body.pose = random.pose({0, 0, 0});
    const Vec3d towards{0.6 + random.uniform(-0.3, 0.3), 0.64 + random.uniform(-0.3, 0.3),
                        0.48 + random.uniform(-0.3, 0.3)};
    if (i == 0) body.pose = Pose{};
    if (i > 0) body.pose->translation = towards * (3 / norm(towards));
    scene.add_body(std::move(body));
  }
  return scene;
}

class ContradictionLog : public LoopTest {
 protected:
  std::uint64_t contradictions() {
    const auto frame = evaluate(a_, simple_frame(FrameType::kGetStats, 9));
    const auto counters = wire::parse_stats(frame->body());
    for (std::uint64_t i = 0; i < counters.size(); ++i)
      if (wire::name_of(counters[i].name) == "engine.contradictions") return counters[i].value;
    ADD_FAILURE() << "not counted";
    return 0;
  }
};

TEST_F(ContradictionLog, SpeaksOnce) {
  start(misled_scene());
  TestQuery query;
  for (std::uint32_t b = 1; b < 100; ++b) query.pairs.push_back({0, b});
  query.header.fields = kFieldLower | kFieldUpper | kFieldStatus;
  EXPECT_EQ(contradictions(), 0u);
  testing::internal::CaptureStdout();
  evaluate(a_, query);
  const std::uint64_t first = contradictions();
  evaluate(a_, query);
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_GT(first, 0u);
  EXPECT_GT(contradictions(), first);
  const auto line = log.find("event=contradiction ");
  ASSERT_NE(line, std::string::npos) << log;
  EXPECT_EQ(log.find("event=contradiction ", line + 1), std::string::npos) << log;
}

}  // namespace
}  // namespace clearance
