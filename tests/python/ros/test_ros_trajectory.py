"""The ROS 2 package's check of trajectories, against a daemon."""

import time

import numpy as np
import pytest

from patience import PATIENCE_S
from ros_messages import joints, scene, thing, trajectory
from scenes import at

NAMES = ["joint1", "joint2"]


@pytest.fixture
def check(ros, bridge):
    """check(trajectory, margin) -> its Check, with the arm's joints known."""
    home = {state.name.removeprefix("arm/"): state.position for state in bridge.client.joint_states()}
    bridge.on_joints(joints(time.time_ns(), **home))
    bridge.client.allow("arm", "arm")  # two of its links always overlap
    return lambda message, margin=0.001, age=PATIENCE_S: ros.trajectory.check_trajectory(bridge, message, margin, age)


def add_bead(client):
    """A bead on the arm where joint1 is 0.6, which is free at 0 and at 1.2."""
    middle = client.distances(
        configurations=[[0.6, 0.0]], joints=["arm/joint1", "arm/joint2"], pairs=[("arm", "cup")],
        fields=("lower", "points"),
    )  # fmt: skip
    row = int(middle.lower[0].argmin())
    is_cup = client.bodies[middle.pairs[row, 0]].name == "cup"
    on_arm = (middle.point_b if is_cup else middle.point_a)[0, row]
    client.add_body("bead", sphere=0.002, pose=at(*on_arm))


def test_where_and_why_not(ros, bridge, check):
    """A bead in the way between two free points: time, state and pair of the collision are right."""
    names = NAMES
    ends = np.array([[0.0, 0.0], [1.2, 0.0]])
    free = check(trajectory(names, (0.0, ends[0]), (2.0, ends[1])))
    assert free.result == ros.trajectory.FREE and free.margin == 0.001, free
    assert 0.001 < free.lower <= free.upper
    way = bridge.client.motions(ends[:1], ends[1:], joints=["arm/joint1", "arm/joint2"], abs_tol=1e-3)
    assert free.lower <= way.upper[0] and way.lower[0] <= free.upper, "the least distance of the whole trajectory"

    add_bead(bridge.client)
    hit = check(trajectory(names, (0.0, ends[0]), (2.0, ends[1])))
    assert hit.result == ros.trajectory.COLLISION and "bead" in (hit.body_a, hit.body_b), hit
    assert 0 < hit.time_from_start < 1.01 and hit.segment == 0 and hit.joint_names == tuple(names)
    assert hit.positions == pytest.approx([1.2 * hit.time_from_start / 2, 0.0])
    assert hit.lower <= 0.001 and f"at {hit.time_from_start:.3f} s" in hit.message and "bead" in hit.message
    at_hit = bridge.client.distances(
        configurations=[hit.positions], joints=["arm/joint1", "arm/joint2"], pairs=[(hit.body_a, hit.body_b)]
    )
    assert at_hit.lower[0, 0] <= 0.001

    late = check(trajectory(names, (0.0, [-1.0, 0.0]), (1.0, ends[0]), (3.0, ends[1])))
    assert late.segment == 1 and late.time_from_start == pytest.approx(1 + hit.time_from_start, abs=0.01)


def test_curves_between_points_count(ros, bridge, check):
    """With velocities, the motion between two equal free points leaves them, and collides."""
    add_bead(bridge.client)
    still = trajectory(NAMES, (0.0, [0.0, 0.0], [0.0, 0.0]), (1.0, [0.0, 0.0], [0.0, 0.0]))
    assert check(still).result == ros.trajectory.FREE
    swung = trajectory(NAMES, (0.0, [0.0, 0.0], [2.8, 0.0]), (1.0, [0.0, 0.0], [-2.8, 0.0]))  # joint1 is 2.8 (t - t^2)
    hit = check(swung)
    assert hit.result == ros.trajectory.COLLISION and "bead" in (hit.body_a, hit.body_b), hit
    assert 0 < hit.time_from_start < 1 and 0.3 < hit.positions[0] <= 0.7


def test_curves_between_points_keep_limits(ros, check):
    swung = trajectory(NAMES, (0.0, [0.0, 0.0], [40.0, 0.0]), (1.0, [0.0, 0.0], [40.0, 0.0]))
    limits = check(swung)
    assert limits.result == ros.trajectory.LIMITS and "joint1" in limits.message, limits


def test_the_way_to_the_first_point_counts(ros, bridge, check):
    """The arm is at 0, and a controller goes from there to a first point at 1 s."""
    there, after = [1.2, 0.0], [1.3, 0.0]
    assert check(trajectory(NAMES, (1.0, there), (2.0, after))).result == ros.trajectory.FREE
    add_bead(bridge.client)
    rest = [0.0, 0.0]
    for way in (
        trajectory(NAMES, (1.0, there), (2.0, after)),
        trajectory(NAMES, (1.0, there, rest), (2.0, after, rest)),
    ):
        hit = check(way)
        assert hit.result == ros.trajectory.COLLISION and "bead" in (hit.body_a, hit.body_b), hit
        assert 0 < hit.time_from_start < 0.6 and hit.segment == 0 and hit.message.endswith("s, before point 0")
        assert hit.positions[0] == pytest.approx(1.2 * hit.time_from_start)
    jump = check(trajectory(NAMES, (0.0, there), (2.0, after)))
    assert jump.result == ros.trajectory.UNPROVED and jump.lower == -np.inf, jump
    assert jump.message == "points[0]: arm/joint1 begins at 1.2 and is at 0, more than 0.01 away"
    assert check(trajectory(NAMES, (0.0, [0.009, 0.0]), (2.0, rest))).result == ros.trajectory.FREE
    hit = check(trajectory(NAMES, (0.0, there), (2.0, rest)))
    assert hit.result == ros.trajectory.COLLISION, "wherever it is now"
    moving = check(trajectory(NAMES, (0.5, [0.1, 0.0], [0.2, 0.0]), (1.0, [0.2, 0.0], rest)))
    assert moving.result == ros.trajectory.UNPROVED and "does not come to rest" in moving.message, moving
    early = check(trajectory(NAMES, (-1.0, rest), (1.0, rest)))
    assert early.result == ros.trajectory.INVALID and "time_from_start" in early.message, early


def test_segments_are_counted_from_the_first_point(ros, bridge, check):
    add_bead(bridge.client)
    late = check(trajectory(NAMES, (1.0, [-0.5, 0.0]), (2.0, [0.0, 0.0]), (3.0, [1.2, 0.0])))
    assert late.result == ros.trajectory.COLLISION and late.segment == 1, late
    assert 2 < late.time_from_start < 2.6 and late.message.endswith("s, after point 1")


def test_a_joint_without_a_position_leaves_no_verdict(ros, bridge):
    bridge.on_joints(joints(time.time_ns(), joint1=0.0))
    message = trajectory(NAMES, (0.0, [0.0, 0.0]), (1.0, [0.1, 0.0]))
    found = ros.trajectory.check_trajectory(bridge, message, 0.001, PATIENCE_S)
    assert (found.result, found.message) == (ros.trajectory.STALE, "joint_states: no position of arm/joint2 has come")


def test_limits(ros, check):
    beyond = check(trajectory(NAMES, (0.0, [0.0, 0.0]), (1.0, [9.0, 0.0])), 0.0)
    assert beyond.result == ros.trajectory.LIMITS and "arm/joint1" in beyond.message, beyond


def test_stale_inputs_leave_no_verdict(ros, bridge, check):
    """Publishers that stopped, and objects that the daemon cannot have, are named."""
    message = trajectory(NAMES, (0.0, [0.0, 0.0]), (1.0, [0.1, 0.0]))
    assert check(message).result == ros.trajectory.FREE
    time.sleep(0.05)
    old = check(message, age=0.04)
    assert old.result == ros.trajectory.STALE and "arm/joint1: older than 0.04 s" in old.message, old
    bridge.scene.on_scene(scene([thing("ground", planes=[object()])]))
    unknown = check(message)
    assert unknown.result == ros.trajectory.STALE and unknown.message.startswith("ground: "), unknown


@pytest.mark.parametrize("message, why", [
    (trajectory(["joint1"], (0.0, [0.0])), "points: expected two or more"),
    (trajectory(["elbow"], (0.0, [0.0]), (1.0, [0.1])), "arm/elbow"),
    (trajectory([], (0.0, [0.0]), (1.0, [0.1])), "joint_names"),
    (trajectory(["joint1"], (0.0, [0.0]), (0.0, [0.1])), "times"),
    (trajectory(["joint1"], (0.0, [0.0]), (1.0, [float("nan")])), ""),
])  # fmt: skip
def test_invalid_trajectories(ros, check, message, why):
    found = check(message)
    assert found.result in (ros.trajectory.INVALID, ros.trajectory.UNPROVED) and why in found.message, found
    assert not found.lower > 0


def test_without_a_proof(ros, bridge, check):
    """Where an end touches its margin, nothing is proved, or a collision is."""
    r = bridge.client.distances(reduce="min", pairs=[("arm", "table")])
    margin = float(r.lower[0])
    found = check(trajectory(NAMES, (0.0, [0.0, 0.0]), (1.0, [0.0, 0.0])), margin + 1.0)
    assert found.result == ros.trajectory.COLLISION and found.time_from_start == 0.0
