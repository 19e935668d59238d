"""try_placo.py: placo's solver with Clearance's rows. Needs placo. The oracle of distances is a closed form."""

import pathlib
import tempfile

import numpy as np
import placo
from try_pinocchio import LIMIT, MASS, fails

import clearance
import clearance.placo

POST, RADIUS = np.array([0.42, 0.25]), 0.05
BOXES = {"upper": (0.0, 0.24), "fore": (0.05, 0.33)}  # the extent of each link's box along x; 5 cm wide and high

# Two links in the plane, whose boxes are apart in every position.
URDF = """<robot name="arm"><link name="base">{mass}</link>
<link name="upper"><collision><origin xyz=".12 0 0"/><geometry><box size=".24 .05 .05"/></geometry></collision>
{mass}</link>
<link name="fore"><collision><origin xyz=".19 0 0"/><geometry><box size=".28 .05 .05"/></geometry></collision>
{mass}</link>
<link name="hand">{mass}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>{limit}</joint>
<joint name="k" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz=".3 0 0"/><axis xyz="0 0 1"/>
{limit}</joint>
<joint name="tip" type="fixed"><parent link="fore"/><child link="hand"/><origin xyz=".33 0 0"/></joint></robot>"""


def robot_of(urdf=URDF):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "robot.urdf"
        path.write_text(urdf.format(mass=MASS, limit=LIMIT))
        robot = placo.RobotWrapper(str(path))
    robot.update_kinematics()
    return robot


def gap(robot):
    """Distance of the links from the post, a cylinder along z, in metres; below 0 if one of its points is in a link."""
    gaps = []
    for link, (begin, end) in BOXES.items():
        X = robot.get_T_world_frame(link)
        x, y = (X[:2, :2].T @ (POST - X[:2, 3])).tolist()
        outside = np.array([max(begin - x, x - end), abs(y) - 0.025])
        gaps.append(np.linalg.norm(np.maximum(outside, 0)) + min(outside.max(), 0) - RADIUS)
    return min(gaps)


def drive(robot, guarded, moves=None):
    """Towards a point behind the post. Returns the least true distance and the last distance of the hand from it."""
    solver = placo.KinematicsSolver(robot)
    solver.dt = 0.02
    solver.enable_velocity_limits(True)
    target = np.array([0.36, 0.36, 0.0])
    solver.add_position_task("hand", target).configure("hand", "soft", 1.0)
    solver.add_regularization_task(1e-4)
    solver.mask_fbase(True)
    avoidance = None
    if guarded:
        avoidance = clearance.placo.CollisionAvoidance(solver, minimum_distance=0.01)
        pose = [*POST, 0, 1, 0, 0, 0]
        avoidance.engine.add_body("post", cylinder=(RADIUS, 1), pose=pose)
    least = np.inf
    for _ in range(200):
        if avoidance:
            lower = avoidance.update()
            assert lower <= gap(robot) + 1e-12, (lower, gap(robot))
        solver.solve(True)
        robot.update_kinematics()
        least = min(least, gap(robot))
    return least, np.linalg.norm(robot.get_T_world_frame("hand")[:3, 3] - target)


def test_it_keeps_the_robot_from_a_post():
    guarded, _ = drive(robot_of(), True)
    free, miss = drive(robot_of(), False)
    assert guarded > 0.009 and free < -0.005 and miss < 0.02, (guarded, free, miss)
    print(f"placo: nearest {1e3 * guarded:.1f} mm with our rows, {1e3 * free:.1f} mm without")


def test_rows():
    """Each row is the certified bound and its slope, in placo's columns; far from everything, none binds."""
    robot = robot_of()
    solver = placo.KinematicsSolver(robot)
    avoidance = clearance.placo.CollisionAvoidance(solver, detection_distance=0.1, gain=0.5, minimum_distance=0.02)
    assert avoidance.update() == 0.1 and avoidance.constraint.A.size == 9
    assert (avoidance.constraint.A == 0).all() and avoidance.constraint.b[0] > 0
    avoidance.engine.add_body("ball", sphere=0.05, pose=[0.5, 0.15, 0, 1, 0, 0, 0])
    avoidance.engine.add_body("other", sphere=0.05, pose=[0.12, -0.12, 0, 1, 0, 0, 0])
    for joint, angle in (("j", 0.1), ("k", -0.2)):
        robot.set_joint(joint, angle)
    robot.update_kinematics()
    avoidance.update()
    rows, bounds, q = avoidance.constraint.A.copy(), avoidance.constraint.b.copy(), robot.state.q.copy()
    assert rows.shape == (2, 9) and (rows[:, :7] == 0).all()
    h = 1e-6
    for joint in ("j", "k"):
        column = robot.get_joint_offset(joint)
        ends = []
        for step in (-h, h):
            robot.state.q = q + step * np.eye(9)[column]
            avoidance.world.set_state(robot.state.q)
            r = avoidance.engine.distances(reduce="within", max_distance=0.1, rel_tol=1e-12)
            ends.append(np.sort(r.upper))
        slopes = np.sort(rows[:, column])
        assert np.allclose(np.sort(-(ends[1] - ends[0]) / (2 * h)), slopes, atol=1e-4), joint
    lower = np.sort((bounds - rows @ q) / 0.5 + 0.02)
    assert np.allclose(lower, 0.5 * (ends[0] + ends[1]), atol=1e-5)


def test_a_base_on_its_table_has_no_row():
    mass = '<collision><geometry><box size=".1 .1 .1"/></geometry></collision></link>\n<link name="upper">'
    robot = robot_of(URDF.replace('{mass}</link>\n<link name="upper">', mass, 1))
    solver = placo.KinematicsSolver(robot)
    avoidance = clearance.placo.CollisionAvoidance(solver, detection_distance=0.01)
    avoidance.engine.allow("base_0", "upper_0")  # the arm's root is in the base
    avoidance.engine.add_body("table", box=[0.1, 0.1, 0.1], pose=[0, 0, -0.099, 1, 0, 0, 0])
    assert -0.0011 < avoidance.update() < 0, "1 mm into it, which counts until it is allowed"
    rows = avoidance.constraint.A.reshape(-1, 9)
    assert not any((row == 0).all() and bound < 0 for row, bound in zip(rows, avoidance.constraint.b))
    solver.solve(False)
    avoidance.engine.allow("base_0", "table")
    assert 0 <= avoidance.update() <= 0.01


ONE_LINK = """<robot name="arm"><link name="base">{mass}</link>
<link name="upper"><collision><origin xyz=".2 0 0"/><geometry><box size=".4 .05 .05"/></geometry></collision>
{mass}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>{limit}</joint></robot>"""


def test_a_link_in_a_wall_that_no_joint_leaves_counts():
    """The wall reaches 15 mm into the link from below, and the joint turns about z; a ball is 5 mm before its side."""
    robot = robot_of(ONE_LINK)
    solver = placo.KinematicsSolver(robot)
    avoidance = clearance.placo.CollisionAvoidance(solver)
    avoidance.engine.add_body("ball", sphere=0.05, pose=[0.3, 0.08, 0, 1, 0, 0, 0])
    assert 0.005 - 1e-6 < avoidance.update() <= 0.005
    row = avoidance.constraint.A.copy()
    avoidance.engine.add_body("wall", box=[2, 2, 0.1], pose=[0, 0, -0.06, 1, 0, 0, 0])
    assert -0.016 < avoidance.update() <= -0.015
    assert row.size == 8 and row.any() and np.array_equal(avoidance.constraint.A, row), "only the ball has a row"


def test_errors():
    robot = robot_of()
    solver = placo.KinematicsSolver(robot)
    fails(lambda: clearance.placo.CollisionAvoidance(solver, gain=2), "gain")
    fails(lambda: clearance.placo.CollisionAvoidance(solver, minimum_distance=-1), "minimum_distance")
    call = lambda: clearance.placo.CollisionAvoidance(solver, minimum_distance=0.05, detection_distance=0.04)  # noqa: E731
    fails(call, "detection_distance", "minimum_distance, 0.05", "0.04")
    avoidance = clearance.placo.CollisionAvoidance(solver, base_is_fixed=False)
    avoidance.update()
    avoidance.engine.add_body("ball", sphere=0.05)
    fails(avoidance.update, "base_is_fixed", "ball")
    avoidance = clearance.placo.CollisionAvoidance(solver)
    avoidance.engine.add_body("ball", sphere=0.05)
    try:
        avoidance.update()
    except RuntimeError as error:
        assert "ball" in str(error) and "NO_POSE" in str(error), error
    else:
        raise AssertionError("a body without a pose is passed over")
    turning = robot_of(URDF.replace('type="revolute"', 'type="continuous"').replace("{limit}", ""))
    if turning.model.nq != turning.model.nv + 1:
        fails(lambda: clearance.placo.CollisionAvoidance(placo.KinematicsSolver(turning)), "solver", "continuous")


def main():
    test_rows()
    test_it_keeps_the_robot_from_a_post()
    test_a_base_on_its_table_has_no_row()
    test_a_link_in_a_wall_that_no_joint_leaves_counts()
    test_errors()
    print("placo: as it should be")


if __name__ == "__main__":
    main()
