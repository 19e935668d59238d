"""Trajectories: conversions compared with exact rational numbers, and proofs in process and through a daemon."""

from fractions import Fraction
from math import comb
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import clearance
from clearance import Status, Trajectory
from robots import rows_of
from scenes import same_bits

CELL = Path(__file__).resolve().parents[3] / "scenes/cell/robot.yaml"
PAIRS = [("arm", "cup"), ("arm/palm", "table"), ("arm/fore", "table")]


def exact(value):
    return [exact(v) for v in value] if np.ndim(value) else Fraction(float(value))


def bezier(points, t):
    """A position of one joint, exactly."""
    n = len(points) - 1
    return sum(comb(n, i) * t**i * (1 - t) ** (n - i) * p for i, p in enumerate(exact(points)))


def hermite(times, rows, t):
    """The polynomial with the given derivatives at both ends, at a share t, exactly. rows: derivatives, (N,) each."""
    h = Fraction(float(times[1])) - Fraction(float(times[0]))
    order = len(rows)
    nodes = [Fraction(0)] * order + [Fraction(1)] * order
    given = [[Fraction(float(row[end])) * h**k for k, row in enumerate(rows)] for end in (0, 1)]
    table = [given[int(x)][0] for x in nodes]  # Newton's divided differences, repeated nodes by derivatives
    coefficients, factorial = [table[0]], 1
    for k in range(1, 2 * order):
        factorial *= k
        table = [
            given[int(nodes[i])][k] / factorial
            if nodes[i] == nodes[i + k]
            else (table[i + 1] - table[i]) / (nodes[i + k] - nodes[i])
            for i in range(len(table) - 1)
        ]
        coefficients.append(table[0])
    value, product = Fraction(0), Fraction(1)
    for c, node in zip(coefficients, nodes):
        value += c * product
        product *= t - node
    return value


@pytest.mark.parametrize("order", [2, 3])
def test_hermite_data(order):
    rng = np.random.default_rng(order)
    times = np.cumsum(rng.uniform(0.1, 2, 5))
    rows = [rng.uniform(-2, 2, (5, 3)) for _ in range(order)]
    made = (Trajectory.cubic if order == 2 else Trajectory.quintic)(times, *rows)
    assert made.points.shape == (4, 2 * order, 3) and made.times.tolist() == times.tolist()
    for k in range(4):
        for j in range(3):
            for t in (Fraction(0), Fraction(1, 7), Fraction(1, 2), Fraction(1)):
                given = hermite(times[k : k + 2], [row[k : k + 2, j] for row in rows], t)
                assert abs(bezier(made.points[k, :, j], t) - given) <= Fraction(float(made.rounding[j]))


def test_from_drake():
    rng = np.random.default_rng(4)
    for degree in (0, 1, 3, 7):
        breaks, c = np.cumsum(rng.uniform(0.1, 2, 4)), rng.uniform(-1, 1, (3, degree + 1, 2))
        made = Trajectory.from_drake(breaks, c)
        assert made.points.shape == (3, max(degree, 1) + 1, 2)
        for k in range(3):
            h = Fraction(float(breaks[k + 1])) - Fraction(float(breaks[k]))
            for t in (Fraction(0), Fraction(1, 3), Fraction(1)):
                given = sum(Fraction(float(a)) * (h * t) ** i for i, a in enumerate(c[k, :, 1]))
                assert abs(bezier(made.points[k, :, 1], t) - given) <= Fraction(float(made.rounding[1]))


def test_from_bspline():
    rng = np.random.default_rng(5)
    for degree in (1, 3, 5):
        points = rng.uniform(-2, 2, (degree + 5, 2))
        knots = np.sort(rng.uniform(0, 5, 2 * degree + 6))
        knots[degree + 2] = knots[degree + 3]  # an empty span
        made = Trajectory.from_bspline(points, knots, degree)
        assert len(made) == 4 and made.times[0] == knots[degree] and made.times[-1] == knots[degree + 5]
        u = exact(knots)
        for time in exact(rng.uniform(made.times[0], made.times[-1], 20)):
            k = max(i for i in range(degree, degree + 5) if u[i] <= time)
            c = exact(points[k - degree : k + 1, 1])
            for r in range(1, degree + 1):  # de Boor
                for j in range(degree, r - 1, -1):
                    low, high = u[j + k - degree], u[j + 1 + k - r]
                    c[j] = c[j - 1] + (time - low) / (high - low) * (c[j] - c[j - 1])
            i = made.times.tolist().index(knots[k])
            share = (time - u[k]) / (u[k + 1] - u[k])
            assert abs(bezier(made.points[i, :, 1], share) - c[degree]) <= Fraction(float(made.rounding[1]))


def test_trapezoidal():
    rows = np.array([[0, 0], [1, -0.5], [1, -0.5], [1.01, -0.4]])
    made = Trajectory.trapezoidal(rows, max_velocity=[1.0, 2.0], max_acceleration=2.0)
    assert [made.at(t).round(12).tolist() for t in made.times[[0, 3, 5]]] == rows[[0, 1, 3]].tolist()
    assert made.points.shape == (5, 3, 2), "the short motion has no part at constant speed"
    h = np.diff(made.times)[:, None]
    velocity = 2 * np.diff(made.points, axis=1) / h[:, None]
    assert np.abs(velocity).max(axis=(0, 1)) == pytest.approx([1, 0.5])
    assert np.abs(np.diff(velocity, axis=1)[:, 0] / h).max() == pytest.approx(2)
    assert np.abs(velocity[1:, 0] - velocity[:-1, -1]).max() < 1e-12


def test_trapezoidal_equals_its_profile():
    """In rational numbers: each part is a polynomial of its share of time, within `rounding`; times are relative."""
    rng = np.random.default_rng(8)
    kinds, worst = set(), Fraction(0)
    for _ in range(300):
        rows = rng.uniform(-2, 2, (2, 3)) * 10.0 ** rng.uniform(-3, 1, 3)
        rows[1, rng.integers(3)] *= -1  # the change is up to twice the size
        limits = [rng.uniform(0.1, 3, 3), rng.uniform(0.1, 20, 3)]
        made = Trajectory.trapezoidal(rows, *limits)
        change = [b - a for a, b in zip(*exact(rows))]
        velocity, acceleration = (min(m / abs(c) for m, c in zip(exact(limit), change)) for limit in limits)
        square = velocity * velocity / acceleration  # of the change, at constant speed or more
        assert len(made) == (3 if square < 1 else 2)
        share = min(square, 1) / 2
        kinds.add(len(made))
        for j in range(3):
            start, end = exact(rows[:, j])
            a, b = start + share * change[j], end - share * change[j]
            # Shares of the change at a share t of each part's time: t^2, t, and 1 - (1 - t)^2.
            parts = [(start, a, lambda t: t * t), (a, b, lambda t: t), (b, end, lambda t: 1 - (1 - t) ** 2)]
            if len(made) == 2:
                del parts[1]
            for points, (p, q, of) in zip(made.points[:, :, j], parts):
                for t in (Fraction(0), Fraction(1, 7), Fraction(1, 2), Fraction(1)):
                    off = abs(bezier(points, t) - (p + of(t) * (q - p)))
                    assert off <= Fraction(float(made.rounding[j]))
                    worst = max(worst, off / Fraction(float(made.rounding[j])))
        if square < 1:
            until, cruise = velocity / acceleration, (1 - 2 * share) / velocity
            given = [until, until + cruise, 2 * until + cruise]
            assert all(abs(exact(t) - g) <= g / 2**48 for t, g in zip(made.times[1:], given))
        else:  # half of the change within until^2 acceleration / 2
            assert all(abs(exact(t) ** 2 * acceleration - k * k) < Fraction(1, 2**46) for k, t in enumerate(made.times))
    assert kinds == {2, 3} and worst > Fraction(1, 10)


def test_from_ros():
    names, points = ["a", "b"], [([0, 1], [0.5, 0], [0, 0], 1), ([1, 0], [0, 1], [1, 0], 3)]
    rows = [np.array(r, dtype=float) for r in zip(*[p[:3] for p in points])]
    for count, made in ((1, Trajectory.linear), (2, Trajectory.cubic), (3, Trajectory.quintic)):
        keys = ("positions", "velocities", "accelerations")[:count]
        each = [dict(zip(keys, p)) for p in points]
        message = SimpleNamespace(
            joint_names=names,
            points=[SimpleNamespace(**e, time_from_start=SimpleNamespace(sec=p[3], nanosec=5 * 10**8))
                    for e, p in zip(each, points)],
        )  # fmt: skip
        as_dict = {"joint_names": names, "points": [{**e, "time_from_start": p[3] + 0.5} for e, p in zip(each, points)]}
        expected = made([1.5, 3.5], *rows[:count])
        for given in (message, as_dict):
            found = Trajectory.from_ros(given)
            assert found.joint_names == ("a", "b") and found.times.tolist() == [1.5, 3.5]
            assert found.points.tolist() == expected.points.tolist()
    with pytest.raises(ValueError, match=r"points\[1\]: expected velocities"):
        Trajectory.from_ros({"points": [{"positions": [0], "velocities": [1], "time_from_start": 0},
                                        {"positions": [0], "time_from_start": 1}]})  # fmt: skip


@pytest.mark.parametrize(
    "make, error",
    [
        (lambda: Trajectory(np.zeros((2, 9, 1))), r"points: expected 2 to 8 for each segment, got 9"),
        (lambda: Trajectory(np.zeros((2, 3))), r"points: expected shape \(K, D \+ 1, J\)"),
        (lambda: Trajectory(np.zeros((2, 3, 1)), [0, 1]), r"times: expected 3, for 2 segments, got 2"),
        (lambda: Trajectory(np.zeros((2, 3, 1)), [0, 1, 1]), r"times: expected two or more, ascending"),
        (lambda: Trajectory(np.zeros((2, 3, 2)), joint_names=["a"]), r"joint_names: expected 2, got 1"),
        (lambda: Trajectory.cubic([0, 1], np.zeros((2, 1)), np.zeros((3, 1))), r"velocities: expected shape \(2, 1\)"),
        (lambda: Trajectory.from_bspline(np.zeros((5, 1)), np.zeros(8), 3), r"knots: expected 9"),
        (lambda: Trajectory.from_drake([0, 1], np.zeros((1, 9, 1))), r"coefficients: expected degree 1 to 7, got 8"),
        (lambda: Trajectory.trapezoidal([[0.0], [1]], 0, 1), r"max_velocity: expected numbers above 0"),
        (lambda: Trajectory.from_ros({"points": []}), r"points: expected two or more, got 0"),
    ],
)
def test_errors(make, error):
    with pytest.raises(ValueError, match=error):
        make()


def random_curves(arm, count, points, seed=1, size=0.4):
    """(K, D + 1, J) near random states within limits."""
    rng = np.random.default_rng(seed)
    start = rows_of(arm, count, seed)
    return start[:, None] + rng.uniform(-size, size, (count, points, start.shape[1]))


def test_bounds_hold_samples(arm_front):
    arm = arm_front.joints("arm")
    curves = random_curves(arm, 16, 4)
    r = arm_front.motions(curves, joints=arm, pairs=PAIRS)
    free = arm_front.motions(Trajectory(curves), joints=arm, pairs=PAIRS, reduce="any", fields=["status", "verdict"])
    assert r.lower.shape == (16,) and set(r.status) >= {Status.OK, Status.OVERLAP}
    t = np.linspace(0, 1, 65)[:, None]
    for k in range(16):
        rows = sum(comb(3, i) * t**i * (1 - t) ** (3 - i) * curves[k, i] for i in range(4))
        sampled = arm_front.distances(joints=arm, configurations=rows, pairs=PAIRS, reduce="min", fields=["upper"])
        assert r.lower[k] <= sampled.upper.min() + 1e-9
        assert r.upper[k] - r.lower[k] <= 1e-3 or r.status[k] != Status.OK
        assert (free.status[k] == Status.BEYOND) == (r.lower[k] > 0)


def test_two_control_points_are_a_straight_motion(arm_engine):
    arm = arm_engine.joints("arm")
    curves = random_curves(arm, 8, 2)
    as_curves = arm_engine.motions(curves, joints=arm, pairs=PAIRS)
    assert same_bits(as_curves, arm_engine.motions(curves[:, 0], curves[:, 1], joints=arm, pairs=PAIRS))
    prepared = arm_engine.prepare("motions", joints=arm, pairs=PAIRS)
    for _ in range(2):
        assert same_bits(as_curves, prepared.run(curves[:, 0], curves[:, 1]))
        assert same_bits(as_curves, prepared.run(curves, None))


def test_check_path(arm_front):
    arm = arm_front.joints("arm")
    curves = random_curves(arm, 40, 6, seed=5, size=0.2)
    verdicts = arm_front.motions(curves, joints=arm, pairs=PAIRS, reduce="any", fields="verdict").verdict
    first = int(np.argmax(verdicts != Status.BEYOND))
    assert 0 < np.count_nonzero(verdicts == Status.BEYOND) < 40
    done = arm_front.check_path(Trajectory(curves), joints=arm, pairs=PAIRS)
    assert not done.free and done.index == first and 0 <= done.t <= 1
    free = curves[verdicts == Status.BEYOND]
    done = arm_front.check_path(Trajectory(free), joints=arm, pairs=PAIRS)
    assert done.free and done.index is None
    names = [name.rsplit("/")[-1] for name in arm.names]
    again = Trajectory(free[:, :, ::-1], joint_names=names[::-1])
    assert arm_front.check_path(again, joints=arm, pairs=PAIRS).free
    with pytest.raises(ValueError, match="path: no joint is named"):
        arm_front.check_path(Trajectory(free, joint_names=[f"{n}x" for n in names]), joints=arm, pairs=PAIRS)


def test_limits_hold_for_the_curve(arm_engine):
    arm = arm_engine.joints("arm")
    top = float(arm.upper[0])
    home = np.array([joint.position for joint in arm_engine.joint_states()])[: len(arm)]
    for peak, within in ((top + 0.1, True), (4 / 3 * top + 0.1, False)):
        points = np.tile(home, (1, 4, 1))
        points[0, :, 0] = [0, peak, peak, 0]  # up to 3/4 of the peak
        done = arm_engine.check_path(Trajectory(points), joints=arm, pairs=PAIRS)
        assert done.beyond_limits == (not within)
        if not within:
            assert done.limit_violations[0].joint == arm.names[0] and done.limit_violations[0].excess > 0


def test_bodies_move_straight(arm_engine):
    arm = arm_engine.joints("arm")
    with pytest.raises(ValueError, match="start: expected poses, since bodies move"):
        arm_engine.motions(Trajectory(random_curves(arm, 1, 3)), bodies=["cup"])
    with pytest.raises(ValueError, match="end: expected"):
        arm_engine.motions(rows_of(arm, 2, 1), joints=arm)


def test_names_that_two_joints_share_are_rejected():
    points = np.zeros((1, 3, 2))
    with pytest.raises(ValueError, match="joint_names: expected each once"):
        Trajectory(points, joint_names=("b", "b"))
    with pytest.raises(ValueError, match="path: left/b, right/b share names"):
        Trajectory(points, joint_names=("b", "a")).columns(["left/b", "right/b"], "path")


def test_a_huge_joint_frees_no_other():
    """A control point beyond all positions makes its own joint unusable, and leaves the others' motions alone."""
    engine = clearance.Engine(clearance.Scene.load(CELL), threads=1, covers="off")
    joints = engine.joints("arm")
    home = np.array([state.position for state in engine.joint_states() if state.name in joints.names])
    curve = np.repeat(home[None], 3, axis=0)
    curve[1:, 0] += 2.0, 0.75  # drives the arm into the shelf
    pairs = [("shelf", "arm/upper_arm"), ("shelf", "arm/forearm")]
    usual = engine.motions(curve[None], joints=joints, pairs=pairs)
    assert usual.upper[0] <= 0
    for far in (2e6, 1e155, 1e200):
        huge = curve.copy()
        huge[0, -1] = far  # the last joint of the arm, behind both links
        path = engine.check_path(Trajectory(huge[None]), joints=joints, pairs=pairs)
        assert not path.free, far
        r = engine.motions(huge[None], joints=joints, pairs=pairs)
        assert not r.lower[0] > usual.upper[0], far
