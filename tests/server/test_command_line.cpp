// The command-line client as a user runs it.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/program_test.h"

namespace clearance {
namespace {

class CommandLine : public Clearanced {
 protected:
  Finished evaluate(std::vector<std::string> options) {
    options.insert(options.end(), {"--connect", daemon_.url()});
    return clearance_cli(options);
  }
  Daemon daemon_{{"--scene", scene_, "--zmq", ipc_}};
};

TEST_F(CommandLine, Bodies) {
  const Finished table = evaluate({"bodies"});
  EXPECT_EQ(table.code, 0) << table.err;
  EXPECT_TRUE(contains(table.out, "id  body   kind     parent  pieces  vertices"));
  EXPECT_TRUE(
      contains(table.out,
               " 0  table  static   -            1         8   1.11915              0              0            0  "
               "pieces          0\n"));
  EXPECT_TRUE(contains(table.out, "group arm: link1 link2\n4 bodies, 6 enabled pairs, backend cpu, scene "));
  EXPECT_TRUE(contains(evaluate({"bodies", "--csv"}).out,
                       "id,body,kind,parent,pieces,vertices,extent_m,model_error_m,hull_excess_m,empty_share,truth,"
                       "triangles\n0,table,static,,1,8,"));
  EXPECT_TRUE(contains(evaluate({"bodies", "--json"}).out,
                       "[{\"id\": 0, \"body\": \"table\", \"kind\": \"static\", \"parent\": null, \"pieces\": 1,"));
}

TEST_F(CommandLine, Query) {
  const Finished table = evaluate({"query"});
  EXPECT_EQ(table.code, 0) << table.err;
  EXPECT_TRUE(contains(
      table.out, "a      b      status   distance_m  lower_m  upper_m  flags\ntable  cup    ok             0.15"));
  EXPECT_TRUE(contains(table.out, "table  link2  no_pose         nan     -inf      inf"));
  EXPECT_TRUE(contains(table.out, "6 rows of 6 pairs, pose revision 0, backend cpu"));
  EXPECT_TRUE(contains(evaluate({"query", "--limit", "2"}).out, "... and 4 rows more (--limit 0 prints them all)"));

  const Finished nearest = evaluate({"query", "--reduce", "nearest", "--csv", "--fields", "status"});
  EXPECT_EQ(nearest.out,
            "body,a,b,status\ntable,table,link2,no_pose\ncup,cup,link2,no_pose\nlink1,link1,link2,no_pose\n"
            "link2,table,link2,no_pose\n");
  const Finished pairs =
      evaluate({"query", "--pairs", "arm,table", "cup,2", "--csv", "--fields", "status", "--max-distance", "0.3"});
  EXPECT_EQ(pairs.out, "a,b,status\ntable,link1,ok\ntable,link2,no_pose\ncup,link1,beyond\n");
  EXPECT_TRUE(contains(evaluate({"query", "--reduce", "min", "--json"}).out,
                       "[{\"a\": \"table\", \"b\": \"link2\", \"status\": \"no_pose\", \"distance_m\": null"));
  EXPECT_TRUE(contains(evaluate({"query", "--reduce", "min", "--pairs", "table,cup", "--json"}).out,
                       "\"status\": \"ok\", \"distance_m\": 0.15"));
  EXPECT_TRUE(contains(evaluate({"query", "--json", "--pairs", "table,link2"}).out,
                       "\"distance_m\": null, \"lower_m\": \"-inf\""));
  const auto verdict = [&](const std::string& margin) {
    return evaluate(
               {"query", "--reduce", "any", "--pairs", "table,cup", "--margin", margin, "--csv", "--fields", "verdict"})
        .out;
  };
  EXPECT_EQ(verdict("0.1"), "a,b,verdict\n,,beyond\n");
  EXPECT_EQ(verdict("0.2"), "a,b,verdict\ntable,cup,ok\n");
}

TEST_F(Clearanced, AQueryPrintsThatUncertaintyLimitsARow) {
  const std::string scene = folder_.write("uncertain.yaml",
                                          "bodies: [{name: post, box: 0.1, static: true, pose: [0, 0, 0, 1, 0, 0, 0]}, "
                                          "{name: cube, box: 0.1, pose: [1, 0.3, 0.2, 1, 0, 0, 0], "
                                          "uncertainty: {angle: 0.02}}]\n");
  Daemon daemon({"--scene", scene, "--zmq", ipc_});
  const Finished rows = clearance_cli({"query", "--csv", "--fields", "flags", "--connect", daemon.url()});
  EXPECT_EQ(rows.out, "a,b,flags\npost,cube,uncertainty_limited\n") << rows.err;
}

TEST_F(CommandLine, PosesAndAttachments) {
  EXPECT_EQ(evaluate({"scene", "move", "link2", "0.5", "0", "1.5"}).out, "pose revision 1\n");
  EXPECT_EQ(evaluate({"scene", "move", "cup", "--parent", "link2"}).code, 0);
  const Finished poses = evaluate({"bodies", "--poses", "--csv"});
  EXPECT_TRUE(contains(poses.out, "3,link2,ok,0.5,0,1.5,1,0,0,0,"));
  EXPECT_TRUE(contains(poses.out, ",link2\n2,link1,ok,")) << "the cup follows link2";
  EXPECT_EQ(evaluate({"scene", "move", "cup", "--free"}).code, 0);
  EXPECT_FALSE(contains(evaluate({"bodies", "--poses", "--csv"}).out, ",link2\n2,link1,ok,"));
}

TEST_F(CommandLine, BodiesComeAndGo) {
  const Finished added =
      evaluate({"scene", "add", "mug", "--cylinder", "0.04", "0.1", "--parent", "link1", "--pose", "0", "0", "0.3"});
  EXPECT_TRUE(contains(added.out, ", 5 bodies, added in ")) << added.out << added.err;
  EXPECT_TRUE(contains(evaluate({"bodies", "--poses", "--csv"}).out, "4,mug,ok,"));
  EXPECT_EQ(evaluate({"scene", "add", "ball", "--sphere", "0.25", "--pose", "0", "0", "2"}).code, 0);
  EXPECT_TRUE(
      contains(evaluate({"query", "--pairs", "table,ball", "--csv", "--fields", "distance"}).out, "table,ball,1.7"));
  EXPECT_EQ(evaluate({"scene", "add", "plate", "--box", "0.1", "0.1", "0.01", "--radius", "0.005", "--static"}).code,
            0);
  EXPECT_EQ(evaluate({"scene", "add", "rod", "--capsule", "0.01", "0.5"}).code, 0);
  const std::string wedge = folder_.write("wedge.txt", "0 0 0\n1, 0, 0\n\n0\t1 0\r\n0 0 1\n");
  const Finished hull =
      evaluate({"scene", "add", "wedge", "--vertices", wedge, "--pose", "0", "0", "5", "0", "1", "0", "0"});
  EXPECT_TRUE(contains(hull.out, ", 9 bodies, added in ")) << hull.out << hull.err;
  EXPECT_TRUE(
      contains(evaluate({"query", "--pairs", "table,wedge", "--csv", "--fields", "distance"}).out, "table,wedge,3.95"));

  EXPECT_TRUE(contains(evaluate({"scene", "remove", "ball"}).out, ", 8 bodies, removed in "));
  const std::string bad = folder_.write("bad.txt", "0 0 0\n1 0\n"), empty = folder_.write("empty.txt", "\n");
  struct Case {
    std::vector<std::string> options;
    int code;
    std::string text;
  };
  const Case cases[] = {
      {{"scene", "remove", "ball"}, 1, "clearance: remove_body: \"ball\" is not in the scene\n"},
      {{"scene", "remove", "cup"},
       1,
       "clearance: remove_body: \"cup\" was loaded with the scene: only added bodies can be removed\n"},
      {{"scene", "add", "mug", "--sphere", "1"}, 1, "clearance: body name \"mug\" is already that of a body\n"},
      {{"scene", "add", "x", "--sphere", "-1"},
       1,
       "clearance: body \"x\": sphere radius: expected a number of metres > 0, got -1\n"},
      {{"scene", "add", "x"}, 2, "clearance: "},
      {{"scene", "add", "x", "--sphere", "1", "--box", "1", "1", "1"}, 2, "clearance: "},
      {{"scene", "add", "x", "--box", "1", "1"}, 2, "clearance: --box: At least 3 required but received 2\n"},
      {{"scene", "add", "x", "--sphere", "1", "--parent", "link9"},
       2,
       "clearance: no body \"link9\" in the scene; did you mean"},
      {{"scene", "add", "x", "--sphere", "1", "--pose", "1", "2", "3", "4"},
       2,
       "clearance: --pose: expected x y z, or x y z qw qx qy qz; got 4 numbers\n"},
      {{"scene", "add", "x", "--vertices", bad},
       2,
       "clearance: --vertices " + bad + ":2: expected three numbers, got \"1 0\"\n"},
      {{"scene", "add", "x", "--vertices", empty}, 2, "clearance: --vertices " + empty + ": there are none\n"},
      {{"scene", "add", "x", "--vertices", folder_ / "nowhere"},
       2,
       "clearance: --vertices " + (folder_ / "nowhere") + ": cannot be read\n"},
  };
  for (const Case& c : cases) {
    const Finished finished = evaluate(c.options);
    EXPECT_EQ(finished.code, c.code) << finished.err;
    EXPECT_EQ(finished.err.rfind(c.text, 0), 0u) << finished.err;
  }
  EXPECT_TRUE(contains(evaluate({"bodies", "--csv"}).out, "wedge")) << "the rest is there still";
}

TEST_F(CommandLine, StatAndPing) {
  EXPECT_TRUE(contains(evaluate({"stat", "--csv"}).out, "queries.waiting,0\n"));
  for (int i = 0; i < 3; ++i) evaluate({"query"});
  const Finished text = evaluate({"stat", "--prometheus"});
  EXPECT_TRUE(contains(text.out, "\nclearance_queries_answered_total 3\n"));
  EXPECT_TRUE(contains(text.out, "\nclearance_latency_seconds_bucket{le=\"+Inf\"} 3\n"));
  EXPECT_TRUE(contains(text.out, "\nclearance_latency_seconds_count 3\n"));
  EXPECT_TRUE(contains(evaluate({"stat"}).out, "latency_us, half at most"));
  const Finished watched = evaluate({"stat", "--watch", "0.05", "--count", "2", "--csv"});
  EXPECT_TRUE(contains(watched.out, "queries.answered,3,\n")) << "none in between";
  const Finished bare = evaluate({"stat", "--watch", "--count", "1", "--csv"});
  EXPECT_EQ(bare.code, 0) << bare.err;
  EXPECT_TRUE(contains(bare.out, "counter,value,per_s\n")) << "every second, if no number is given";
  std::size_t tables = 0;
  for (std::size_t at = 0; (at = watched.out.find("counter,value,per_s\n", at)) != std::string::npos; ++at) ++tables;
  EXPECT_EQ(tables, 2u) << watched.out;
  EXPECT_TRUE(contains(evaluate({"stat", "--ping", "10"}).out, ": 10 echoes of 64 bytes, round trip min "));
}

TEST_F(CommandLine, ErrorsSayWhatIsWrong) {
  struct Case {
    std::vector<std::string> options;
    int code;
    std::string text;
  };
  const Case cases[] = {
      {{"query", "--pairs", "arm,tabel"}, 2, "clearance: no body \"tabel\" in the scene; did you mean \"table\"?\n"},
      {{"query", "--pairs", "arm"}, 2, "clearance: --pairs: expected A,B as in arm,table; got \"arm\"\n"},
      {{"query", "--pairs", "cup,cup"}, 1, "clearance: pairs[0]: body 1 with itself\n"},
      {{"query", "--max-distance", "-1"}, 2, "clearance: --max-distance: expected a number >= 0, got -1\n"},
      {{"query", "--reduce", "most"}, 2, "clearance: --reduce: most not in {"},
      {{"query", "--fields", "colour"}, 2, "clearance: --fields: colour not in {"},
      {{"query", "--json", "--csv"}, 2, "clearance: --json excludes --csv\n"},
      {{"scene", "move", "table", "1", "2", "3"}, 1, "clearance: \"table\" is static: it does not move\n"},
      {{"scene", "move", "cup", "nan", "2", "3"}, 2, "clearance: POSE: expected finite numbers\n"},
      {{"scene", "move", "cup", "1", "2", "3", "4"},
       2,
       "clearance: POSE: expected x y z, or x y z qw qx qy qz; got 4 numbers\n"},
      {{"scene", "move", "cup"}, 2, "clearance: move: expected POSE, --parent or --free\n"},
      {{"scene", "move", "cup", "--free", "--parent", "link2"}, 2, "clearance: --parent excludes --free\n"},
      {{"scene", "move", "cup", "--free", "--allow", "link2"}, 2, "clearance: --allow requires --parent\n"},
      {{"stat", "--ping", "--json"}, 2, "clearance: --json excludes --ping\n"},
      {{"bench", "--pairs", "3", "throughput"}, 2, "clearance: bench: --pairs belongs behind the mode\n"},
      {{"scene", "move", "cup", "--parent", "cup"}, 1, "clearance: attach: 'cup' would follow itself through 'cup'\n"},
      {{"scene", "move", "table", "--parent", "cup"}, 1, "clearance: attach: 'table' is static\n"},
      {{"frobnicate"}, 2, "clearance: there is no command \"frobnicate\"; clearance --help lists them\n"},
  };
  for (const Case& c : cases) {
    const Finished finished = evaluate(c.options);
    EXPECT_EQ(finished.code, c.code) << finished.err;
    EXPECT_EQ(finished.err.rfind(c.text, 0), 0u) << finished.err;
  }
}

TEST_F(CommandLine, FindsTheDaemonByTheEnvironment) {
  EXPECT_EQ(clearance_cli({"bodies"}, {"CLEARANCE_URL=" + daemon_.url()}).code, 0);
  const std::string none = "ipc://" + (folder_ / "none/c.ipc");
  const Finished nowhere = clearance_cli({"bodies"}, {"CLEARANCE_URL=" + none});
  EXPECT_EQ(nowhere.code, 3);
  EXPECT_EQ(nowhere.err, "clearance: " + none + ": no such socket: is clearanced running, with --zmq " + none + "?\n");
  EXPECT_EQ(clearance_cli({"bodies", "--connect", "http://x"}).code, 2);
}

TEST_F(CommandLine, HelpHasAnExample) {
  const Finished help = clearance_cli({"--help"});
  EXPECT_EQ(help.code, 0);
  for (const char* part : {"bodies", "query", "stat", "joints", "scene", "Example\n  clearance query", "CLEARANCE_URL"})
    EXPECT_TRUE(contains(help.out, part));
  EXPECT_FALSE(contains(clearance_cli({"query", "--help"}).out, "Exit codes"));
}

TEST_F(Clearanced, ACheckOfAClientSaysWhichJointsAreBeyondTheirLimits) {
  std::filesystem::copy(CLEARANCE_SOURCE_DIR "/tests/engine/robot/arm.urdf", folder_ / "arm.urdf");
  const std::string scene = folder_.write("arm.yaml",
                                          "bodies: [{name: post, box: 0.1, static: true, pose: [9, 0, 0, 1, 0, 0, 0]}, "
                                          "{name: ball, sphere: 0.1, pose: [9, 3, 0, 1, 0, 0, 0]}]\n"
                                          "robots: [{name: arm, urdf: arm.urdf, home: {joint4: -1.5}}]\n");
  Daemon daemon({"--scene", scene, "--zmq", ipc_});
  Client client = patient(ipc_);
  const std::array<IdPair, 1> pairs{{{client.body("post"), client.body("ball")}}};
  const std::uint32_t joints[] = {0, 7};
  const double positions[] = {0, 0.05, 3, 0.01, -2.9, 0.04, NAN, 0};
  Query query;
  query.pairs = pairs;
  query.joints = joints;
  query.positions = positions;
  const Check check = client.check(query);
  EXPECT_EQ(check.free, (std::vector<bool>{true, true, true, true}));
  EXPECT_EQ(check.verdict, std::vector(4, Status::kBeyond));
  EXPECT_EQ(check.beyond_limits, (std::vector<bool>{true, true, false, false}));
  EXPECT_FALSE(check);
  EXPECT_TRUE(check.ok(2));
  ASSERT_EQ(check.limit_violations.size(), 2u);
  EXPECT_EQ(check.limit_violations[0].joint, 7u);
  EXPECT_EQ(check.limit_violations[0].excess(), 0.05 - 0.04);
  EXPECT_EQ(check.limit_violations[1].configuration, 1u);
  EXPECT_EQ(check.limit_violations[1].excess(), 3 - 2.9);

  query.margin = 9;
  const Check near = client.check(query);
  EXPECT_EQ(near.verdict, std::vector(4, Status::kOk));
  EXPECT_EQ(near.pair[3], pairs[0]);
  EXPECT_TRUE(near.hit(3));

  Query now;
  now.pairs = pairs;
  EXPECT_TRUE(client.check(now));
  const std::pair<std::uint32_t, double> far[] = {{0, -4}};
  client.set_joints(far);
  const Check beyond = client.check(now);
  ASSERT_EQ(beyond.limit_violations.size(), 1u);
  EXPECT_EQ(beyond.limit_violations[0].excess(), 4 - 2.9);
  EXPECT_FALSE(beyond.ok(0));
  const std::uint32_t ball[] = {client.body("ball")};
  const Pose7 pose[] = {{9, 4, 0, 1, 0, 0, 0}};
  now.bodies = ball;
  now.configurations = pose;
  EXPECT_TRUE(client.check(now)) << "of joints that the query does not name nothing is told";
}

}  // namespace
}  // namespace clearance
