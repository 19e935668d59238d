"""The ROS 2 package's bridge to a daemon, with fakes of the message types; ROS is not needed."""

import math
import os
import shutil
import subprocess
import sys
import time
from types import SimpleNamespace as Message

import numpy as np
import pytest

import clearance
from conftest import BUILD, ROS_PACKAGE, Daemon
from patience import PATIENCE_S, wait_until
from robots import ARM_YAML, arm_scene
from ros_messages import MOVE, header, joints, pose, primitive, scene, thing, transform
from scenes import at


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
        other.add_body("newer", sphere=0.1, pose=at(5, 0.3))
    assert bridge.on_joints(joints(time.time_ns(), joint1=0.4)).applied == 1
    assert {"new", "newer"} in [{pair.a, pair.b} for pair in bridge.report(0.2).pairs]
    with clearance.connect(bridge.daemon.urls["ipc"]) as other:
        other.remove_body("newer")
    assert bridge.recover(clearance.QueryError(clearance.wire.ErrorCode.WRONG_SCENE, "it has changed"))
    assert bridge.client.bodies[-1].name == "new"
    assert not bridge.recover(clearance.TimeoutError("late"))


def test_the_clients_own_wheel_is_enough(bridge, tmp_path):
    """Its package has another name, and no engine."""
    alone = BUILD / "python" / "clearance_client"
    if not (alone / "_client" / "contract.json").exists():
        pytest.skip("the client in Python alone was not built")
    (tmp_path / "clearance_client").symlink_to(alone)
    (tmp_path / "clearance_ros").symlink_to(ROS_PACKAGE / "clearance_ros")
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
    held = thing("mug", primitives=[(primitive(2, 0.05), pose(0, 0, 0.02))], frame="flange")
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
    why = "the daemon was restarted, or a message did not reach it: it lacks objects until a whole scene comes"
    lost = f"planning_scene: {why}"
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
