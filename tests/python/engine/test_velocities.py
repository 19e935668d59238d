"""Velocities that come with poses and positions, and the rates of the current poses."""

import numpy as np
import pytest

import clearance
from robots import rows_of
from scenes import at

RATES = ["rate", "rate_bounds", "curvature"]


def given_rates(front, row, v, pose, twist, pairs):
    """Rates by velocities that the query gives."""
    rows = front.prepare(bodies=["cup"], joints="arm", pairs=pairs, fields=RATES)
    return rows.run((row[None], np.array([[pose]], float)), v[None], np.array([[twist]], float))


@pytest.fixture
def scene_of_balls():
    scene = clearance.Scene()
    scene.add_box("table", [1, 1, 0.1], static=True, pose=at(0, 0, -0.05))
    scene.add_sphere("ball", 0.1, pose=at(0, 0, 1))
    scene.add_sphere("fast", 0.1, pose=at(0.3, 0, 2), max_speed=3.0)
    return scene


def test_current_rates_are_those_of_the_stored_velocities(arm_front):
    arm = arm_front.joints("arm")
    rng = np.random.default_rng(1)
    row, v, twist, pose = (
        rows_of(arm, 1, seed=2)[0],
        rng.uniform(-1, 1, len(arm)),
        rng.uniform(-1, 1, 6),
        at(0.4, 0.3, 0.5),
    )
    pairs = [("cup", "arm"), ("table", "arm"), ("table", "cup")]
    expected = given_rates(arm_front, row, v, pose, twist, pairs)
    arm_front.set_joints(row, joints=arm, velocities=v)
    arm_front.set_poses({"cup": pose}, velocities={"cup": twist})
    r = arm_front.distances(pairs, fields=RATES)
    assert np.isfinite(r.rate).sum() > 5 and np.abs(r.rate).max() > 0.1
    assert np.allclose(r.rate, expected.rate, rtol=0, atol=1e-12, equal_nan=True)
    assert np.allclose(r.curvature, expected.curvature, rtol=0, atol=1e-9, equal_nan=True)
    assert np.allclose(r.rate_bounds, expected.rate_bounds, rtol=0, atol=1e-9)
    assert ((r.rate_bounds[..., 0] <= r.rate) & (r.rate <= r.rate_bounds[..., 1])).all()


def test_an_update_without_velocities_makes_them_unknown(arm_front):
    arm = arm_front.joints("arm")
    row = rows_of(arm, 1, seed=3)[0]
    zero = np.zeros(len(arm))
    arm_front.set_joints(row, joints=arm, velocities=zero)
    arm_front.set_poses({"cup": at(0.4, 0.3, 0.5)}, velocities={"cup": np.zeros(6)})
    pairs = [("cup", "arm/palm"), ("table", "cup"), ("table", "arm/palm")]
    at_rest = arm_front.distances(pairs, fields=RATES)
    assert (at_rest.rate == 0).all() and (at_rest.rate_bounds == 0).all()
    arm_front.set_poses({"cup": at(0.4, 0.3, 0.5)})
    r = arm_front.distances(pairs, fields=RATES)
    assert np.isnan(r.rate[0]).tolist() == [True, True, False] and np.isnan(r.curvature[0]).tolist() == [
        True,
        True,
        False,
    ]
    assert np.isinf(r.rate_bounds[0]).all(-1).tolist() == [True, True, False]
    arm_front.set_joints(row[:1], joints=arm.names[:1], velocities=[np.nan])
    r = arm_front.distances(pairs, fields=RATES)
    assert np.isnan(r.rate).all() and np.isinf(r.rate_bounds).all()
    # A query with configurations uses the velocities that it gives.
    assert given_rates(arm_front, row, zero, at(0.4, 0.3, 0.5), np.zeros(6), pairs).rate.tolist() == [[0, 0, 0]]


def test_bodies_where_the_scene_has_them_are_at_rest_unless_they_may_move(scene_of_balls):
    engine = clearance.Engine(scene_of_balls, threads=1, covers="off")
    pairs = [("table", "ball"), ("table", "fast")]
    r = engine.distances(pairs, fields=RATES)
    assert r.rate[0, 0] == 0 and np.isnan(r.rate[0, 1])
    assert np.allclose(r.rate_bounds[0, 1], [-3, 3])
    engine.set_poses({"fast": at(0.3, 0, 2)}, velocities={"fast": [0, 0, 0, 0, 0, -2]})
    r = engine.distances(pairs, fields=RATES)
    assert abs(r.rate[0, 1] + 2) < 1e-12 and r.rate_bounds[0, 1, 0] <= -2 <= r.rate_bounds[0, 1, 1]


def test_attached_bodies_move_with_their_parent(scene_of_balls):
    scene_of_balls.add_sphere("rider", 0.05, pose=at(0, 0, 3))
    engine = clearance.Engine(scene_of_balls, threads=1, covers="off")
    engine.set_poses({"ball": at(0, 0, 1), "rider": at(0, 0, 3)})
    engine.attach("rider", "ball")
    engine.set_poses({"ball": at(0, 0, 1)}, velocities={"ball": [0, 0, 0, 0, 0, -0.5]})
    pair = [("table", "rider")]
    assert engine.distances(pair, fields=RATES).rate.tolist() == [[-0.5]]
    engine.attach("rider", None)
    assert np.isnan(engine.distances(pair, fields=RATES).rate).all(), "its velocity is unknown"


def test_points_that_are_replaced_may_move(scene_of_balls):
    for name, is_static in (("seen", False), ("mapped", True)):
        scene_of_balls.add_body(name, points=[[0, 0, 0]], radius=0.1, pose=at(0, 0, 4), static=is_static)
    engine = clearance.Engine(scene_of_balls, threads=1, covers="off")
    pairs = [("ball", "seen"), ("ball", "mapped")]
    assert engine.distances(pairs, fields="rate").rate.tolist() == [[0, 0]]
    for name in ("seen", "mapped"):
        engine.set_points(name, [[0, 0, 0.1]])
    assert np.isnan(engine.distances(pairs, fields="rate").rate).tolist() == [[True, False]]


def test_bounds_hold_errors_of_speeds(arm_front):
    arm = arm_front.joints("arm")
    row, v = rows_of(arm, 1, seed=4), np.full((1, len(arm)), 0.3)
    errors = np.linspace(0.01, 0.1, len(arm))
    fields = ["rate", "rate_bounds", "gradient_joints"]
    exact = arm_front.prepare(joints="arm", fields=fields).run(row, v)
    r = arm_front.prepare(joints="arm", fields=fields, speed_errors=errors).run(row, v)
    wider = np.abs(exact.gradient_joints) @ errors
    assert (r.rate_bounds[..., 0] <= exact.rate - 0.99 * wider).all()
    assert (r.rate_bounds[..., 1] >= exact.rate + 0.99 * wider).all()
    assert np.array_equal(r.rate, exact.rate)
    assert np.isfinite(r.rate_bounds).all()
    for given, error, text in (
        (
            errors[:3],
            clearance.QueryError,
            "speed_errors: expected 8 numbers, one for each joint and two for each body",
        ),
        (-errors, clearance.QueryError, r"speed_errors\[0\]: expected a number >= 0"),
        (errors[None], ValueError, "speed_errors: expected one number for each joint and two for each body, got shape"),
    ):
        with pytest.raises(error, match=text):
            arm_front.prepare(joints="arm", fields=fields, speed_errors=given).run(row, v)
    with pytest.raises(clearance.QueryError, match="speed_errors: only for the column rate_bounds"):
        arm_front.prepare(joints="arm", fields="rate", speed_errors=errors).run(row, v)


def test_wrong_velocities_are_named_and_change_nothing(arm_front):
    arm = arm_front.joints("arm")
    row = rows_of(arm, 1, seed=5)[0]
    pose = at(0.1, 0.2, 0.9)
    before = arm_front.body_states()[arm_front.body_id("cup")].pose
    poses, joints = arm_front.set_poses, arm_front.set_joints
    for call, error, text in (
        (lambda: poses({"cup": pose}, velocities={"table": np.zeros(6)}), ValueError, "velocities: expected the keys"),
        (lambda: poses({"cup": pose}, velocities=np.zeros((2, 6))), ValueError, r"velocities: .* got \(2, 6\)"),
        (lambda: poses({"cup": pose}, velocities=np.zeros(6)), ValueError, r"velocities: .* got \(6,\)"),
        (lambda: poses([pose], ["cup"], velocities={"cup": np.zeros(6)}), TypeError, "velocities: a dict"),
        (lambda: joints(row, joints=arm, velocities=row[:2]), ValueError, r"velocities: .* got \(2,\)"),
        (lambda: joints(row, joints=arm, velocities="fast"), TypeError, "velocities"),
    ):
        with pytest.raises(error, match=text):
            call()
    assert np.array_equal(arm_front.body_states()[arm_front.body_id("cup")].pose, before)
