"""The ROS 2 package's logic with a daemon and fakes of the message types; ROS is not needed."""

import ast
import importlib
import math
import os
import shutil
import subprocess
import sys
import time
from types import ModuleType
from types import SimpleNamespace as Message

import numpy as np
import pytest

import clearance
from conftest import BUILD, ROOT, Daemon
from patience import PATIENCE_S, wait_until
from robots import ARM_YAML, arm_scene
from scenes import at

PACKAGE = ROOT / "ros" / "clearance_ros"
ADD, REMOVE, APPEND, MOVE = 0, 1, 2, 3
SCAN = "  - {name: scan, points: [], radius: 0.01, pose: [0, 0, 0, 1, 0, 0, 0]}\n"


@pytest.fixture
def ros(monkeypatch):
    """The package's modules that need no ROS."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    names = ["bridge", "planning_scene"]
    yield Message(**{name: importlib.import_module(f"clearance_ros.{name}") for name in names})
    for name in [name for name in sys.modules if name.partition(".")[0] == "clearance_ros"]:
        del sys.modules[name]


@pytest.fixture
def bridge(ros, start_daemon, urdf, tmp_path):
    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML.replace("robots:", SCAN + "robots:"))
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    bridge = ros.bridge.Bridge(clearance.connect(daemon.urls["ipc"]), "arm")
    bridge.daemon = daemon
    yield bridge
    bridge.client.close()


def header(ns):
    return Message(stamp=Message(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")


def pose(x=0.0, y=0.0, z=0.0, q=(0.0, 0.0, 0.0, 1.0)):
    """geometry_msgs/Pose; the quaternion as in ROS, w last."""
    return Message(position=Message(x=x, y=y, z=z), orientation=Message(**dict(zip("xyzw", map(float, q)))))


def transform(name, ns, x, y, z):
    t = Message(translation=Message(x=x, y=y, z=z), rotation=Message(x=0.0, y=0.0, z=0.0, w=1.0))
    return Message(header=header(ns), child_frame_id=name, transform=t)


def primitive(kind, *dimensions):
    return Message(type=kind, dimensions=list(dimensions))


def thing(name, operation=ADD, primitives=(), meshes=(), where=None, planes=()):
    """moveit_msgs/CollisionObject, whose operation is a byte."""
    return Message(
        id=name, operation=bytes([operation]), pose=where or pose(), planes=list(planes),
        primitives=[p for p, _ in primitives], primitive_poses=[where for _, where in primitives],
        meshes=[m for m, _ in meshes], mesh_poses=[where for _, where in meshes],
    )  # fmt: skip


def scene(objects=(), attached=(), is_diff=True, names=(), allowed=()):
    """moveit_msgs/PlanningScene."""
    rows = [Message(enabled=[tuple(sorted((a, b))) in allowed for b in names]) for a in names]
    return Message(
        is_diff=is_diff,
        world=Message(collision_objects=list(objects)),
        robot_state=Message(attached_collision_objects=list(attached)),
        allowed_collision_matrix=Message(entry_names=list(names), entry_values=rows),
    )


def distance(client, a, b):
    r = client.distances([(a, b)])
    return float(r.lower[0, 0]), float(r.upper[0, 0])


def test_joint_states_move_the_robot(bridge, urdf):
    now = time.time_ns()
    done = bridge.on_joints(Message(header=header(now), name=["joint1", "joint4", "wheel"], position=[0.4, -1.2, 3.0]))
    assert done.applied == 2 and bridge.unknown == {"arm/wheel"}
    engine = clearance.Engine(arm_scene(urdf), threads=1)
    engine.set_joints({"arm/joint1": 0.4, "arm/joint4": -1.2})
    expected, have = (each.distances(reduce="min") for each in (engine, bridge.client))
    assert (have.lower[0], have.upper[0]) == (expected.lower[0], expected.upper[0])
    assert have.snapshot_stamp_ns == now and have.snapshot_sequence == 1
    assert bridge.on_joints(Message(header=header(now), name=["wheel"], position=[1.0])) is None


def test_joint_states_that_do_not_fit_are_refused(bridge):
    joints = lambda names, positions: Message(header=header(time.time_ns()), name=names, position=positions)  # noqa: E731
    bridge.on_joints(joints(["joint1"], [0.4]))
    with pytest.raises(ValueError, match="joint_states: 2 names come with 1 positions"):
        bridge.on_joints(joints(["joint1", "joint4"], [0.7]))
    with pytest.raises(ValueError, match="arm/joint1 is named twice"):
        bridge.on_joints(joints(["joint1", "joint4", "joint1"], [0.7, 0.1, 0.2]))
    assert bridge.on_joints(joints(["joint1"], [])) is None, "velocities alone"
    state = next(state for state in bridge.client.joint_states() if state.name == "arm/joint1")
    assert state.position == 0.4, "nothing of them was taken"
    bridge.on_joints(joints(["joint1"], [math.nan]))
    report = bridge.report(0.1)
    assert "bad_pose" in {pair.status for pair in report.pairs}, "what is no position is never a distance"
    assert report.least == -math.inf, "nor is the least distance of the others that of all"


def test_transforms_move_bodies(bridge):
    now = time.time_ns()
    assert bridge.on_poses([transform("cup", now, 0.4, 0.3, 0.9), transform("moon", now, 0, 0, 0)]).applied == 1
    state = bridge.client.body_states()[bridge.client.body_id("cup")]
    assert state.pose.tolist() == at(0.4, 0.3, 0.9) and state.stamp_ns == now and bridge.unknown == {"moon"}
    assert bridge.on_poses([]) is None


def test_quaternions_are_turned_round(ros):
    assert ros.planning_scene.pose_of(pose(1, 2, 3, (0.1, 0.2, 0.3, 0.9))) == [1, 2, 3, 0.9, 0.1, 0.2, 0.3]
    assert ros.planning_scene.pose_of(pose(q=(0, 0, 0, 0))) == at(0)


def test_objects_come_move_and_go(bridge):
    client, follower = bridge.client, bridge.scene
    crate = thing("crate", primitives=[(primitive(1, 0.2, 0.2, 0.2), pose(0, 0, 0.1))], where=pose(1, 0, 1))
    pair = thing("pair", primitives=[(primitive(2, 0.1), pose(2)), (primitive(3, 0.4, 0.1), pose(2, 1))])
    cone = thing("cone", primitives=[(primitive(4, 0.4, 0.1), pose(3, 0, 2))])
    follower.on_scene(scene([crate, pair, cone]))
    assert not follower.left_out
    assert [body.name for body in client.bodies][-4:] == ["crate", "pair.0", "pair.1", "cone"]
    low, high = distance(client, "crate", "pair.0")
    exact = math.hypot(0.9, 1.0) - 0.1  # from the sphere's centre to the crate's lower edge
    assert low <= exact <= high and high - low < 1e-5
    state = client.body_states()[client.body_id("cone")]
    assert state.pose.tolist() == at(3, 0, 2)
    low, high = distance(client, "pair.1", "crate")  # about (2, 1) up to z = 0.2; corner (1.1, 0.1, 1)
    assert low <= math.hypot(math.hypot(0.9, 0.9) - 0.1, 0.8) <= high and high - low < 1e-3

    follower.on_scene(scene([thing("crate", MOVE, where=pose(1, 0, 3)), thing("pair", REMOVE)]))
    assert not follower.left_out
    state = client.body_states()[client.body_id("crate")]
    np.testing.assert_allclose(state.pose, at(1, 0, 3.1), atol=1e-12)
    assert "pair.0" not in {body.name for body in client.bodies}
    follower.on_scene(scene([thing("crate", APPEND, primitives=[(primitive(2, 0.1), pose())])]))
    assert client.bodies[-1].name == "crate.1"
    follower.on_scene(scene([cone], is_diff=False))  # a whole scene removes objects that it does not name
    assert {body.name for body in client.bodies if "crate" in body.name or "pair" in body.name} == set()
    assert "table" in {body.name for body in client.bodies}


def test_a_mesh_is_its_triangles(bridge):
    corners = [Message(x=x, y=y, z=0.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))]
    triangles = [Message(vertex_indices=np.array(t, dtype=np.uint32)) for t in ((0, 1, 2), (0, 2, 3))]
    sheet = thing("sheet", meshes=[(Message(vertices=corners, triangles=triangles), pose(0, 0, 2))])
    probe = thing("probe", primitives=[(primitive(2, 0.1), pose(0.5, 0.5, 2.5))])
    bridge.scene.on_scene(scene([sheet, probe]))
    low, high = distance(bridge.client, "sheet", "probe")
    assert low <= 0.4 <= high and high - low < 1e-5


def test_an_attached_object_follows_its_link_and_may_touch_its_fingers(bridge):
    client, follower = bridge.client, bridge.scene
    link = next(body.name for body in reversed(client.bodies) if body.name.startswith("arm/") and body.piece_count)
    held = thing("mug", primitives=[(primitive(2, 0.05), pose(0, 0, 0.02))])
    attached = Message(
        link_name=link.removeprefix("arm/"), object=held, touch_links=[link.removeprefix("arm/"), "nail"]
    )
    follower.on_scene(scene(attached=[attached]))
    assert not follower.left_out
    mug, at_link = client.body_id("mug"), client.body_id(link)
    states = client.body_states()
    assert states[mug].parent == at_link
    before = states[mug].pose
    bridge.on_joints(Message(header=header(time.time_ns()), name=["joint1"], position=[1.0]))
    states = client.body_states()
    assert np.abs(states[mug].pose - before).max() > 0.05
    pairs = {tuple(pair) for pair in np.sort(client.pairs, axis=1).tolist()}
    assert tuple(sorted((mug, at_link))) not in pairs and len(pairs) > 5
    gone = Message(link_name=attached.link_name, object=thing("mug", REMOVE), touch_links=[])
    follower.on_scene(scene(attached=[gone]))
    state = client.body_states()[client.body_id("mug")]
    assert state.parent is None
    np.testing.assert_allclose(state.pose, states[mug].pose, atol=1e-12)


def test_pairs_that_may_touch_are_not_asked_about(bridge):
    ball = thing("ball", primitives=[(primitive(2, 0.05), pose(0.4, 0.3, 0.5))])  # at the cup's place
    bridge.scene.on_scene(scene([ball]))
    ids = sorted((bridge.client.body_id("ball"), bridge.client.body_id("cup")))
    assert ids in np.sort(bridge.client.pairs, axis=1).tolist()
    assert bridge.report(0.2).pairs[0].status == "overlap"
    bridge.scene.on_scene(scene(names=["ball", "cup", "unheard of"], allowed={("ball", "cup")}))
    assert ids not in np.sort(bridge.client.pairs, axis=1).tolist()
    assert not [pair for pair in bridge.report(0.2).pairs if {pair.a, pair.b} == {"ball", "cup"}]


def test_what_cannot_be_taken_is_said_and_the_rest_is_taken(bridge):
    objects = [
        thing("plane", planes=[Message(coef=[0, 0, 1, 0])]),
        thing("prism", primitives=[(primitive(5, 1.0, 1.0), pose())]),
        thing("short", primitives=[(primitive(1, 1.0), pose())]),
        thing("table", primitives=[(primitive(2, 1.0), pose())]),
        thing("lost", MOVE),
        thing("good", primitives=[(primitive(2, 0.1), pose(3))]),
    ]
    bridge.scene.on_scene(scene(objects))
    why = bridge.scene.left_out
    assert sorted(why) == ["lost", "plane", "prism", "short", "table"]
    assert "planes are not supported" in why["plane"] and "a box has 3 dimensions, not 1" in why["short"]
    assert "type 5" in why["prism"] and "no such object" in why["lost"] and "table" in why["table"]
    assert "good" in {body.name for body in bridge.client.bodies}
    bridge.scene.on_scene(scene([thing("short", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(5))])]))
    assert "short" not in bridge.scene.left_out


def test_a_new_version_that_cannot_be_taken_leaves_the_old_one(bridge):
    follower = bridge.scene
    follower.on_scene(scene([thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(3))])]))
    for bad in (
        thing("crate", primitives=[(primitive(1, 1.0), pose(3))]),
        thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4)), (primitive(2, -1.0, 0.0), pose())]),
        thing("crate", planes=[Message(coef=[0, 0, 1, 0])]),
        thing("crate", operation=7, primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4))]),
    ):
        follower.on_scene(scene([bad]))
        assert list(follower.left_out) == ["crate"]
        assert bridge.client.body_states()[bridge.client.body_id("crate")].pose.tolist() == at(3)
    follower.on_scene(scene([thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4))])]))
    assert not follower.left_out


def test_without_a_name_all_are_meant(bridge):
    """As in MoveIt: a removal without a name removes all objects, attached or not."""
    client, follower = bridge.client, bridge.scene
    link = next(body.name for body in reversed(client.bodies) if body.name.startswith("arm/") and body.piece_count)
    balls = [thing(name, primitives=[(primitive(2, 0.05), pose(k))]) for k, name in enumerate("abc", 3)]
    held = [Message(link_name=link.removeprefix("arm/"), object=ball, touch_links=[]) for ball in balls[:2]]
    follower.on_scene(scene(balls[2:], attached=held))
    parent = lambda name: client.body_states()[client.body_id(name)].parent  # noqa: E731
    assert [parent(name) for name in "abc"] == [client.body_id(link)] * 2 + [None]
    for where in ("joint1", ""):  # of another link, then of any
        follower.on_scene(scene(attached=[Message(link_name=where, object=thing("", REMOVE), touch_links=[])]))
        assert (parent("a") is None) == (not where)
    assert [parent(name) for name in "abc"] == [None] * 3
    follower.on_scene(scene([thing("", REMOVE)]))
    assert not {"a", "b", "c"} & {body.name for body in client.bodies}
    assert not follower.left_out and "table" in {body.name for body in client.bodies}


def test_a_matrix_that_is_not_square_is_left_out(bridge):
    follower = bridge.scene
    message = scene(names=["table", "cup"], allowed={("cup", "table")})
    message.allowed_collision_matrix.entry_values.pop()
    before = len(bridge.client.pairs)
    follower.on_scene(message)
    assert "2 names need 2 rows of 2 values" in follower.left_out["allowed_collision_matrix"]
    assert len(bridge.client.pairs) == before
    follower.on_scene(scene(names=["table", "cup"], allowed={("cup", "table")}))
    assert not follower.left_out and len(bridge.client.pairs) == before - 1


def test_the_report_is_the_answer(bridge, ros):
    bridge.scene.on_scene(scene([thing("near", primitives=[(primitive(2, 0.05), pose(0.4, 0.3, 0.615))])]))
    report = bridge.report(0.5)
    r = bridge.client.distances(reduce="within", max_distance=0.5, fields=("default", "pair"))
    names = [body.name for body in bridge.client.bodies]
    expected = {(names[a], names[b]): (lo, up) for (a, b), lo, up in zip(r.pairs.tolist(), r.lower, r.upper)}
    assert {(p.a, p.b): (p.lower, p.upper) for p in report.pairs} == expected and len(expected) > 2
    assert [p.lower for p in report.pairs] == sorted(p.lower for p in report.pairs)
    assert report.least == bridge.client.distances(reduce="min").lower[0]
    near = next(p for p in report.pairs if {p.a, p.b} == {"near", "cup"})
    level_of = ros.bridge.level_of
    assert near.lower < 0.015 < near.upper + 1e-6
    assert (level_of(near, 0.01), level_of(near, 0.02)) == (ros.bridge.OK, ros.bridge.WARN)
    stale = bridge.report(0.5, max_age_s=1e-9)
    bridge.on_poses([transform("cup", time.time_ns(), 0.4, 0.3, 0.5)])
    stale = bridge.report(0.5, max_age_s=1e-9)
    assert {level_of(p, 0.0) for p in stale.pairs if "cup" in (p.a, p.b)} == {ros.bridge.ERROR}


def test_it_goes_on_after_another_client_changed_the_scene(bridge):
    bridge.report(0.1)
    with clearance.connect(bridge.daemon.urls["ipc"]) as other:
        other.add_body("new", sphere=0.1, pose=at(5))
    with pytest.raises(clearance.QueryError) as raised:
        bridge.report(0.1)
    assert bridge.recover(raised.value) and bridge.report(0.1) is not None
    assert not bridge.recover(clearance.TimeoutError("late"))


def test_the_clients_own_wheel_is_enough(bridge, tmp_path):
    """Its package has another name, and no engine."""
    alone = BUILD / "python" / "clearance_client"
    if not (alone / "_client" / "contract.json").exists():
        pytest.skip("the client in Python alone was not built")
    (tmp_path / "clearance_client").symlink_to(alone)
    (tmp_path / "clearance_ros").symlink_to(PACKAGE / "clearance_ros")
    code = """
import sys
sys.modules["clearance"] = None  # as where it is not installed
from clearance_ros import bridge, clearance
print(bridge.Bridge(clearance.connect(sys.argv[1]), "arm").report(0.5).least)
"""
    done = subprocess.run(
        [sys.executable, "-c", code, bridge.daemon.urls["ipc"]],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == bridge.report(0.5).least


def test_the_package_is_whole():
    """The files that ROS needs exist, and the node imports no other ROS package than those of package.xml."""
    text = (PACKAGE / "package.xml").read_text()
    tree = ast.parse((PACKAGE / "clearance_ros" / "node.py").read_text())
    modules = {
        node.module.partition(".")[0] for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level
    }
    for name in modules:
        assert f"<exec_depend>{name}</exec_depend>" in text, name
    assert {"rclpy", "moveit_msgs", "sensor_msgs"} <= modules
    for name in ("setup.py", "setup.cfg", "resource/clearance_ros", "launch/clearance.launch.py"):
        assert (PACKAGE / name).exists()


# ---- freshness -------------------------------------------------------------------------------------------------------


def joints(ns, **positions):
    return Message(header=header(ns), name=list(positions), position=list(positions.values()))


def test_joint_states_that_never_came_leave_no_distance(bridge):
    report = bridge.report(0.5, max_age_s=PATIENCE_S)
    assert report.stale == ["joint_states: no position of arm has come"] and report.least == -math.inf
    assert bridge.report(0.5).stale == [] and bridge.report(0.5).least > -math.inf, "age does not count"
    bridge.on_joints(joints(time.time_ns(), joint1=0.2))
    report = bridge.report(0.5, max_age_s=PATIENCE_S)
    assert report.stale == [] and report.least == bridge.client.distances(reduce="min").lower[0]


@pytest.mark.parametrize("source", ["joints", "tf", "cloud"])
def test_a_source_that_died_leaves_no_distance(bridge, ros, source):
    bridge.on_joints(joints(time.time_ns(), joint1=0.2))
    name, body = {"joints": ("arm/joint1", "arm/flange"), "tf": ("cup", "cup"), "cloud": ("scan", "scan")}[source]
    with clearance.connect(bridge.daemon.urls["ipc"]) as camera:
        if source == "tf":
            bridge.on_poses([transform("cup", time.time_ns(), 0.4, 0.3, 0.5)])
        if source == "cloud":
            camera.set_points("scan", np.array([[0.4, 0.3, 0.7]], dtype=np.float32))
    assert bridge.report(0.5, max_age_s=PATIENCE_S).stale == []
    sentence = f"{name}: older than 0.02 s"
    wait_until(lambda: sentence in bridge.stale(0.02))
    report = bridge.report(0.5, max_age_s=0.02)
    assert sentence in report.stale and report.least == -math.inf
    pairs = [pair for pair in report.pairs if body in (pair.a, pair.b)]
    assert pairs and {pair.status for pair in pairs} == {"stale_pose"}
    assert {ros.bridge.level_of(pair, 0.0) for pair in pairs} == {ros.bridge.ERROR}


def test_a_message_sent_again_is_no_sign_of_life(bridge):
    now = time.time_ns()
    assert bridge.on_joints(joints(now, joint1=0.2, joint4=-1.0)).applied == 2
    assert bridge.on_joints(joints(now, joint1=0.2, joint4=-1.0)) is None
    assert bridge.on_joints(joints(now, joint4=-1.0)).applied == 1, "another publisher"
    assert bridge.on_joints(joints(now, joint1=0.3, joint4=-1.0)).applied == 2, "a clock that ticks slowly"
    assert bridge.on_joints(joints(now + 1, joint1=0.3, joint4=-1.0)).applied == 2
    assert bridge.on_poses([transform("cup", now, 0.4, 0.3, 0.9)]).applied == 1
    assert bridge.on_poses([transform("cup", now, 0.4, 0.3, 0.9)]) is None
    for _ in range(2):
        assert bridge.on_joints(joints(0, joint1=0.3)).applied == 1, "without a stamp nothing tells them apart"


def test_a_clock_that_was_set_back_is_followed(bridge):
    """As when a simulation restarts, or use_sim_time is switched on."""
    position = lambda: next(j.position for j in bridge.client.joint_states() if j.name == "arm/joint1")  # noqa: E731
    now, second = time.time_ns(), 10**9
    bridge.on_joints(joints(now, joint1=0.1, joint4=-1.0))
    for stamp, q in ((7 * second, 0.2), (8 * second, 0.3), (0, 0.4), (2 * second, 0.5)):
        assert bridge.on_joints(joints(stamp, joint1=q)).applied == 1
        assert position() == q
    assert bridge.on_joints(joints(3 * second, joint1=0.6, joint4=-1.1)).applied == 2, "one of them had the old clock"
    assert bridge.client.distances().snapshot_stamp_ns == 0, "which the update leaves out"
    bridge.on_joints(joints(4 * second, joint1=0.7))
    with pytest.raises(clearance.QueryError, match="stamp"):
        bridge.on_joints(joints(4 * second - 1, joint1=0.8))  # late, and no jump
    with pytest.raises(clearance.QueryError, match="ahead"):
        bridge.on_joints(joints(now + 3600 * second, joint1=0.8))
    assert position() == 0.7
    bridge.on_poses([transform("cup", now, 0.4, 0.3, 0.9)])
    assert bridge.on_poses([transform("cup", second, 0.4, 0.3, 0.8)]).applied == 1


def test_objects_of_planning_scenes_do_not_age_and_those_that_are_lost_are_missed(ros, urdf, tmp_path):
    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML)
    daemon = Daemon(tmp_path, tmp_path / "scene.yaml", ["ipc"])
    bridge = ros.bridge.Bridge(clearance.connect(daemon.urls["ipc"]), "arm")
    crate = thing("crate", primitives=[(primitive(1, 0.2, 0.2, 0.2), pose())], where=pose(1, 0, 1))
    held = thing("mug", primitives=[(primitive(2, 0.05), pose(0, 0, 0.02))])
    attached = Message(link_name="flange", object=held, touch_links=["flange"])
    bridge.scene.on_scene(scene([crate], attached=[attached]))
    bridge.scene.on_scene(scene([thing("crate", MOVE, where=pose(1, 0, 3))]))
    assert not bridge.scene.left_out
    wait_until(lambda: min(s.age_ns for s in bridge.client.body_states()[-2:]) > 2e7)
    bridge.on_joints(joints(time.time_ns(), joint1=0.2))
    assert not [sentence for sentence in bridge.stale(0.02) if "crate" in sentence or "mug" in sentence]

    daemon.stop()
    with pytest.raises(clearance.ConnectionError):
        bridge.report(0.5)
    daemon = Daemon(tmp_path, tmp_path / "scene.yaml", ["ipc"])
    with pytest.raises(clearance.NewEpoch) as raised:
        wait_until(lambda: answers(bridge))
    assert bridge.recover(raised.value)
    lost = "planning_scene: the daemon was restarted and has no objects"
    never = "joint_states: no position of arm has come"
    report = bridge.report(0.5, max_age_s=PATIENCE_S)
    assert report.stale == [lost, never] and report.least == -math.inf
    assert bridge.on_joints(joints(1, joint1=0.2)).applied == 1, "the new daemon knows no older stamps"
    bridge.scene.on_scene(scene([crate]))
    assert bridge.report(0.5).stale == [lost] and bridge.report(0.5).least == -math.inf, "a difference is not all of it"
    bridge.scene.on_scene(scene([crate], is_diff=False))
    report = bridge.report(0.5, max_age_s=PATIENCE_S)
    assert report.stale == [] and report.least > -math.inf
    daemon.stop()


def answers(bridge):
    """Returns whether a daemon is running again; raises its rejection."""
    try:
        return bridge.report(0.5) is not None
    except clearance.ConnectionError:
        return False


# ---- the node --------------------------------------------------------------------------------------------------------


@pytest.fixture
def make_node(ros, bridge, monkeypatch):
    """make_node(parameter=value, ...) -> the node itself, on a fake rclpy, and its publications by topic."""
    published = {}

    given = {"url": bridge.daemon.urls["ipc"], "robot": "arm", "within": 0.5}

    class Node:
        def __init__(self, name):
            self.calls = {}

        def declare_parameter(self, name, value):
            return Message(value=given.get(name, value))

        def create_publisher(self, kind, topic, depth):
            return Message(publish=lambda message: published.setdefault(topic, []).append(message))

        def create_subscription(self, kind, topic, call, depth):
            self.calls[topic] = call

        def create_timer(self, period, call):
            self.calls["timer"] = call

        def get_logger(self):
            return Message(
                info=lambda text: None, warning=lambda text, **options: published.setdefault("log", []).append(text)
            )

        def get_clock(self):
            return Message(now=lambda: Message(to_msg=lambda: "now"))

    def module(name, **members):
        made = ModuleType(name)
        made.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, made)

    array = lambda: Message(header=Message(stamp=None), status=[])  # noqa: E731
    module("rclpy")
    module("rclpy.node", Node=Node)
    module("diagnostic_msgs")
    module("diagnostic_msgs.msg", DiagnosticArray=array, DiagnosticStatus=Message, KeyValue=Message)
    module("sensor_msgs")
    module("sensor_msgs.msg", JointState=Message)
    module("std_msgs")
    module("std_msgs.msg", Float64=Message)
    module("moveit_msgs")
    module("moveit_msgs.msg", PlanningScene=Message)

    def make(**parameters):
        given.update(parameters)
        return importlib.import_module("clearance_ros.node").ClearanceNode(), published

    return make


def test_the_node_publishes_what_the_bridge_reports(bridge, make_node):
    node, published = make_node(max_age=PATIENCE_S)
    node.calls["timer"]()
    assert [m.data for m in published.pop("~/clearance")] == [-math.inf], "nothing is known of the robot"
    assert published.pop("~/distances")
    node.calls["joint_states"](Message(header=header(time.time_ns()), name=["joint1"], position=[0.2]))
    node.calls["joint_states"](Message(header=header(time.time_ns()), name=["joint1"], position=[0.2, 0.3]))
    assert published.pop("log") == ["joint_states: 1 names come with 2 positions"], "said, and the node goes on"
    node.calls["planning_scene"](scene([thing("plane", planes=[Message(coef=[0, 0, 1, 0])])]))
    node.calls["timer"]()
    report = bridge.report(0.5)
    assert [m.data for m in published["~/clearance"]] == [report.least]
    (message,) = published["~/distances"]
    assert [(s.name, s.message, s.values[0].value) for s in message.status] == [
        (f"{p.a} - {p.b}", p.status, repr(p.lower)) for p in report.pairs
    ]
    assert message.header.stamp == "now" and all(len(s.level) == 1 for s in message.status)
    assert ["planes are not supported" in text for text in published["log"]] == [True]
    with clearance.connect(bridge.daemon.urls["ipc"]) as other:
        other.add_body("new", sphere=0.1, pose=at(5))
    node.calls["timer"]()  # is rejected, and fetches the scene
    node.calls["timer"]()
    assert len(published["~/clearance"]) == 2 and len(published["log"]) == 2
    states = [message.status[0] for message in published["/diagnostics"]]
    assert [s.level for s in states] == [b"\3", b"\0"], "when it changes"
    assert [s.message for s in states] == ["joint_states: no position of arm has come", ""]


def test_age_counts_unless_it_is_said_not_to(make_node):
    node, published = make_node()
    node.calls["timer"]()
    assert published["/diagnostics"][0].status[0].level == b"\3", "nothing has come"
    node, published = make_node(max_age=0.0)
    published.clear()
    node.calls["timer"]()
    assert published["~/clearance"][0].data > -math.inf and published["/diagnostics"][0].status[0].level == b"\0"


def test_the_node_shows_that_its_publisher_died(make_node):
    node, published = make_node(max_age=0.02, rate=3)
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    wait_until(lambda: node.calls["timer"]() or published["~/clearance"][-1].data == -math.inf)
    for _ in range(4):
        node.calls["timer"]()
    assert published["~/clearance"][-1].data == -math.inf
    last = published["~/distances"][-1]
    assert last.header.stamp == "now" and any(s.message == "stale_pose" for s in last.status)
    for message in published["/diagnostics"][-2:]:
        (state,) = message.status
        assert message.header.stamp == "now" and state.level == b"\3", "again, though nothing has changed"
        assert state.name == "clearance: inputs and daemon" and state.message == "arm/joint1: older than 0.02 s"
        assert {v.key: v.value for v in state.values}["clearance"] == "-inf"
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    node.calls["timer"]()


def test_the_node_shows_that_its_daemon_died(bridge, make_node):
    node, published = make_node(max_age=PATIENCE_S)
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    node.calls["timer"]()
    assert published["~/clearance"].pop().data > -math.inf
    bridge.daemon.stop()
    shown = len(published["~/distances"])
    for _ in range(2):
        node.calls["timer"]()
    assert [m.data for m in published["~/clearance"]] == [-math.inf] * 2
    assert len(published["~/distances"]) == shown, "no pairs are no answer"
    state = published["/diagnostics"][-1].status[0]
    assert state.level == b"\2" and bridge.daemon.urls["ipc"] in state.message
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))  # is reported, and the node continues
    assert len(published["log"]) == 3


def test_transforms_are_taken_whole_or_not(bridge):
    client, now = bridge.client, time.time_ns()
    bridge.on_poses([transform("cup", now, 0.4, 0.3, 0.9)])
    before = [(*s.pose, s.status, s.stamp_ns) for s in client.body_states()]
    twice = [transform("cup", now, 1, 0, 0), transform("moon", now, 0, 0, 0), transform("cup", now, 2, 0, 0)]
    with pytest.raises(ValueError, match="tf: cup comes twice"):
        bridge.on_poses(twice)
    with pytest.raises(clearance.QueryError, match="is a link placed by joints"):
        bridge.on_poses([transform("cup", now, 1, 0, 0), transform("arm/fore", now, 0, 0, 0)])
    with pytest.raises(clearance.QueryError, match="is older than"):
        bridge.on_poses([transform("cup", now - 10**9, 1, 0, 0)])
    assert [(*s.pose, s.status, s.stamp_ns) for s in client.body_states()] == before
    empty = transform("cup", now, 1, 0, 0)
    empty.transform.rotation = Message(x=0.0, y=0.0, z=0.0, w=0.0)
    assert bridge.on_poses([empty]).bad == 1, "a quaternion of zeros is no rotation"
    assert client.body_states()[client.body_id("cup")].status == clearance.Status.BAD_POSE


def test_an_object_is_added_whole_or_not(bridge):
    client, follower = bridge.client, bridge.scene
    good, bad = (primitive(1, 1.0, 1.0, 1.0), pose(3)), (primitive(2, -1.0), pose(4))
    names = [body.name for body in client.bodies]
    follower.on_scene(scene([thing("crate", primitives=[good, bad])]))
    assert list(follower.left_out) == ["crate"] and [body.name for body in client.bodies] == names
    follower.on_scene(scene([thing("crate", primitives=[good])]))
    for operation in (ADD, APPEND):
        follower.on_scene(scene([thing("crate", operation, primitives=[(good[0], pose(5)), bad])]))
        assert list(follower.left_out) == ["crate"], "what the daemon rejects leaves the old one"
        assert [body.name for body in client.bodies] == [*names, "crate"]
        assert client.body_states()[client.body_id("crate")].pose.tolist() == at(3)
    follower.on_scene(scene([thing("crate", primitives=[(good[0], pose(5)), (primitive(2, 1.0), pose(6))])]))
    assert not follower.left_out and [body.name for body in client.bodies] == [*names, "crate.0", "crate.1"]
