"""Certificates of motions along curves: both checkers accept every kind of them, and find every tampering with control
points, bounds and spans."""

import copy
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import clearance
from certificates import NAMES
from clearance import Trajectory
from scenes import at
from test_motion_certificates import check, claims, engine, kind_of_contact, spans  # noqa: F401  (a fixture)

PAIRS = [("arm/finger", "egg"), ("arm/fore", "wall"), ("arm/rod", "arm/base"), ("arm/fore", "post"),
         ("arm/upper", "vague")]  # fmt: skip


def curves(count, points, seed, size=0.5):
    """(count, points, 3) control points of the arm that overshoot their ends."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (count, 1, 3)) * [1, 1.5, 0.1]
    return start + rng.uniform(-size, size, (count, points, 3)) * [1, 1, 0.2]


def test_every_degree_and_reduction(checker, engine):  # noqa: F811
    seen: set = set()
    for points in range(3, 9):
        reduce = ("min", "any", "none")[points % 3]
        document = check(checker, engine, seen, joints="arm", start=curves(1, points, points), pairs=PAIRS[1:],
                         reduce=reduce, margin=0.01, abs_tol=5e-3)  # fmt: skip
        for positions in document["configurations"][0]["positions"].values():
            assert len(positions) == points
    assert {"ok", "beyond", "half", "whole"} <= seen
    assert {order for order, *_ in (x for x in seen if isinstance(x, tuple))} == {1, 2}


def test_at_rest_at_both_ends_and_on_the_way(checker, engine):  # noqa: F811
    """Velocities that vanish: in a motion at rest at both ends, and where a curve turns round."""
    rest = np.repeat(curves(1, 2, 4), 3, axis=1)
    back = curves(1, 3, 5)
    back[:, 2] = back[:, 0]
    still = np.repeat(curves(1, 1, 6), 4, axis=1)
    for points in (rest, back, still):
        check(checker, engine, set(), joints="arm", start=points, pairs=PAIRS, reduce="min")


def test_first_contact(checker, engine):  # noqa: F811
    kinds = set()
    for seed, reduce in ((1, "min"), (8, "any"), (9, "none")):
        requested = {"joints": "arm", "start": curves(3, 4, seed, 0.9), "pairs": PAIRS[:2], "margin": [0.5, 0.05]}
        for row in check(checker, engine, set(), **requested, reduce=reduce, abs_tol=0.05)["rows"]:
            kinds.add(kind_of_contact(row)[0])
    assert {"inf", "a while"} <= kinds


@pytest.mark.parametrize("profile", ["cubic", "quintic", "trapezoidal"])
def test_trajectories(checker, arm_engine, profile):
    """Each segment of a trajectory, on an arm with joints of all kinds."""
    arm = arm_engine.joints("arm")
    rng = np.random.default_rng(7)
    home = np.array([joint.position for joint in arm_engine.joint_states()])[: len(arm)]
    knots = home + np.cumsum(rng.uniform(-0.1, 0.1, (4, len(arm))), axis=0)
    made = {
        "cubic": lambda: Trajectory.cubic([0, 1, 2, 3], knots, rng.uniform(-1, 1, knots.shape)),
        "quintic": lambda: Trajectory.quintic([0, 1, 2, 3], knots),
        "trapezoidal": lambda: Trajectory.trapezoidal(knots[:3], 1.0, 2.0),
    }[profile]()
    pairs = [("arm", "cup"), ("arm", "table")]
    document = arm_engine.certificate(start=made, joints=arm, pairs=pairs, reduce="any", margin=0.001).document
    assert len(document["rows"]) == len(made)
    assert all(is_proved for is_proved, _ in checker.verdicts(document))
    assert "beyond" in {row["status"] for row in document["rows"]}
    assert checker.each_rejects(document) == [False, False]


def test_two_robots(checker):
    """Each robot's velocities are those of its own joints."""
    scene = clearance.Scene()
    for name, x in (("left", 0), ("right", 0.7)):
        scene.add_robot(name, Path(__file__).parents[3] / "scenes/cell/arm.urdf", home={}, base=at(x))
    arms = clearance.Engine(scene, backend="cpu", covers="off")
    joints = [joint.name for joint in arms.joint_states()]
    rng = np.random.default_rng(2)
    stand = np.where(np.arange(len(joints)) < len(joints) / 2, 0.3, 1.5) * rng.uniform(-1, 1, len(joints))
    start = stand + rng.uniform(-0.3, 0.3, (1, 3, len(joints)))
    pairs = [("left/left_finger", "right/left_finger"), ("left/forearm", "right/wrist_1")]
    document = arms.certificate(start=start, joints=joints, pairs=pairs, reduce="min", abs_tol=1e-3).document
    assert document["rows"][0]["lower"] > 0 and document["rows"][0]["proved"]
    assert all(is_proved for is_proved, _ in checker.verdicts(document))
    assert checker.each_rejects(document) == [False, False]


def test_every_front_has_them(checker, arm_front, arm_engine):
    """Clients of a daemon get the engine's rows."""
    arm = arm_engine.joints("arm")
    rng = np.random.default_rng(11)
    home = np.array([joint.position for joint in arm_engine.joint_states()])[: len(arm)]
    points = home + rng.uniform(-0.2, 0.2, (3, 4, len(arm)))
    requested = {"start": points, "pairs": [("arm", "cup")], "reduce": "any"}
    document = arm_front.certificate(joints=arm_front.joints("arm"), **requested).document
    assert all(is_proved for is_proved, _ in checker.verdicts(document))
    expected = arm_engine.certificate(joints=arm, **requested).document
    assert document["rows"] == expected["rows"] and document["configurations"] == expected["configurations"]


def test_the_checker_derives_control_points_of_both_sides(checker):
    """Those from a time to an end are of the exact polynomial, which their bounds hold for any progress."""
    rng = np.random.default_rng(1)
    for count in range(2, 9):
        points = tuple(Fraction(float(x)) for x in rng.uniform(-3, 3, count))
        time, end = (Fraction(int(x), 64) for x in rng.choice(65, 2, replace=False))
        progress = [Fraction(float(x)) for x in rng.uniform(0, 1, count)]
        way = checker.checker.ways(points, time, end)

        def value(points, t, n=count - 1):
            return sum(math.comb(n, i) * t**i * (1 - t) ** (n - i) * p for i, p in enumerate(points))

        farthest, last, rest = checker.checker.bounds_of([(x, 0, 0) for x in way], progress)
        for t in (Fraction(k, 16) for k in range(17)):
            moved = value(points, time + t * (end - time)) - value(points, time)
            assert moved == value(way, t)
            assert abs(moved) <= farthest and abs(moved - value(progress, t) * way[-1]) <= rest
        assert abs(way[-1]) <= last <= abs(way[-1]) + Fraction(1, 1 << 300)
        assert rest <= max(abs(x - r * way[-1]) for x, r in zip(way, progress)) + Fraction(1, 1 << 300)


SLIDER = """<robot name="r"><link name="base"/><link name="ball"><collision><geometry><sphere radius="0.25"/></geometry>
  </collision></link><joint name="x" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="1 0 0"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


TURNER = """<robot name="r"><link name="base"/><link name="upper"/><link name="ball"><collision><origin xyz="1 0 0"/>
  <geometry><sphere radius="0.25"/></geometry></collision></link>
  <joint name="x" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="y" type="continuous"><parent link="upper"/><child link="ball"/><axis xyz="0 0 1"/><origin xyz="1 0 0"/>
  </joint></robot>"""


def single_spans(folder, robot, wall):
    """Documents of one span of a whole motion, of a robot's ball and a wall at an x."""
    urdf = folder / "robot.urdf"
    urdf.write_text(robot)
    scene = clearance.Scene()
    scene.add_robot("r", urdf, home={}, base=at(0))
    scene.add_box("wall", [1, 1, 1], static=True, pose=at(wall + 0.5))
    engine = clearance.Engine(scene, covers="off")  # noqa: F811

    def document(points, place, order, lower, progress=None, turned=0.0):
        """Evaluated at a time, where the ball is turned, with one progress for both sides. points: (P, J)"""
        found = engine.certificate(joints="r", start=[points], pairs=[("r/ball", "wall")]).document
        (row,) = found["rows"]
        (pair,) = row["pairs"]
        direction = [[math.cos(turned), 0.0], [-math.sin(turned), 0.0], [0.0, 0.0]]  # along x, in the ball's axes
        claim = {"pieces": [0, 0], "order": order, "seer": None, "direction": direction, "arithmetic": "float64"}
        pair["spans"] = [{**pair["spans"][0], "begin": 0, "end": 1, "at": place, "lower": [claim]}]
        pair["spans"][0]["progress"] = progress and [progress, progress]
        pair["free"] = row["first_contact"] = None
        row["lower"] = pair["lower"] = lower
        return found

    return document


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    """A ball that slides along x towards a wall at x = 1: 3/4 - q m apart."""
    document = single_spans(tmp_path_factory.mktemp("slider"), SLIDER, 1)
    return lambda points, *more: document([[x] for x in points], *more)


@pytest.fixture(scope="module")
def turn(tmp_path_factory):
    """A ball 1 m from an axis, which turns about another one 1 m away; a wall at x = 3."""
    return single_spans(tmp_path_factory.mktemp("turner"), TURNER, 3)


def sides_of(points, place):
    """Control points of a parabola from a time to its begin and to its end, less its place there, exactly."""
    sides = []
    for end in (0.0, 1.0):
        way = [
            sum(w * p for w, p in zip(((1 - s) * (1 - t), (1 - s) * t + s * (1 - t), s * t), points))
            for s, t in ((place, place), (place, end), (end, end))
        ]
        sides.append([x - way[0] for x in way])
    return sides


@pytest.mark.parametrize("points", [(0.0, -0.5, 0.0), (0.0, 0.125, 0.5), (0.25, 0.0, -0.125), (-0.5, 0.0, 0.5)])
@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("progress", [None, [0.0, 0.5, 1.0], [0.0, 0.125, 1.0], [0.25, 1.0, 0.75]])
def test_bounds_along_parabolas_are_tight(checker, slide, points, place, progress):
    """One span proves the distance at either end of a side, less the rest of the way, and no more."""
    now = sum(w * p for w, p in zip(((1 - place) ** 2, 2 * place * (1 - place), place**2), points))
    nearest = 0.75 - now
    for way in sides_of(points, place):
        rest = max(abs(x - r * way[2]) for x, r in zip(way, progress or [0, 0, 1]))
        nearest = min(nearest, 0.75 - now - max(way[2], 0) - rest)
    if nearest > 0:
        assert checker.each_rejects(slide(points, place, 2, nearest - 2**-40, progress)) == [False, False]
    least = max(nearest, 0) + 2**-40  # no other bound of a row without depths claims anything
    assert checker.each_rejects(slide(points, place, 2, least, progress)) == [True, True]


@pytest.mark.parametrize("place", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("progress", [None, [0.0, 0.5, 1.0], [0.0, 0.25, 1.0]])
def test_bounds_of_turning_joints_are_tight(checker, turn, place, progress):
    """Both joints reach as far as their chain of lengths, and the outer one is turned by the inner one."""
    curves = np.array([[0.1, 0.15, 0.05], [-0.2, -0.1, -0.05]])
    first, second = (
        sum(w * p for w, p in zip(((1 - place) ** 2, 2 * place * (1 - place), place**2), c)) for c in curves
    )
    reach, nearest = np.array([2.25, 1.25]), math.inf
    for ways in zip(*(sides_of(c, place) for c in curves)):
        last = np.array([way[2] for way in ways])
        rest = np.array([max(abs(x - r * way[2]) for x, r in zip(way, progress or [0, 0, 1])) for way in ways])
        for share in (0, 1):
            by, turned = share * abs(last) + rest, share * last
            n = np.array([1, -turned.sum()])
            axis, arm = (np.array([math.cos(q), math.sin(q)]) for q in (first, first + second))
            gap = 3 - n @ axis - turned[1] * axis[1] - n @ arm - 0.25 * np.linalg.norm(n) - reach @ rest
            nearest = min(nearest, gap - reach[0] * by[0] ** 2 / 2 - reach[1] * by[1] * (by[1] / 2 + by[0]))
    points = curves.T.tolist()
    assert nearest > 0.2
    for by, rejects in ((-(2**-40), False), (2**-40, True)):
        document = turn(points, place, 2, float(nearest + by), progress, float(first + second))
        assert checker.each_rejects(document) == [rejects, rejects]


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 1.0])
def test_bounds_by_speed_are_those_of_the_hulls(checker, slide, place):
    points = (0.0, -0.25, 0.125)
    middle = 2 * place * (1 - place) * points[1] + place**2 * points[2]
    apart = 0.75 - middle - max(abs(p) for way in sides_of(points, place) for p in way)
    assert checker.each_rejects(slide(points, place, 1, apart - 2**-40)) == [False, False]
    assert checker.each_rejects(slide(points, place, 1, apart + 2**-40)) == [True, True]


def test_rules_of_progress(checker, slide):
    """A progress has a number from 0 to 1 for each control point."""
    for progress in ([0.0, 0.5], [0.0, 0.5, 1.0, 1.0], [0.0, -0.5, 1.0], [0.0, 1.5, 1.0], [0.0, "inf", 1.0], 1.0):
        assert checker.each_rejects(slide((0.0, 0.125, 0.5), 0.5, 2, 0.125, progress)) == [True, True], progress
    assert checker.each_rejects(slide((0.0, 0.125, 0.5), 0.5, 2, 0.125, [0.0, 0.5, 1.0])) == [False, False]


# ---- tampering -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def document(engine):  # noqa: F811
    """A row that is apart, proved by several spans of a curve, along the normal and by speed."""
    for seed in range(10, 60):
        found = engine.certificate(
            joints="arm", start=curves(1, 5, seed), pairs=[("arm/finger", "egg")], reduce="none", abs_tol=1e-3
        ).document
        (row,) = found["rows"]
        orders = {p["order"] for span in row["pairs"][0]["spans"] for p in span["lower"]}
        if row["status"] == "ok" and 2 in orders and 2 < len(spans(found)) < 40 and 0.2 < row["witness"]["time"] < 0.8:
            return found
    raise AssertionError("no such row")


def points_of(d, k=0):
    positions = d["configurations"][0]["positions"]
    return positions[sorted(positions)[k]]


def raise_lower(d):
    row = d["rows"][0]
    row["lower"] = row["pairs"][0]["lower"] = row["upper"]


def move_point(k, by):
    def mutate(d):
        points_of(d)[k] += by

    return mutate


def reverse_time(d):
    for points in d["configurations"][0]["positions"].values():
        points.reverse()


TAMPERINGS = {
    "the first control point": move_point(0, 0.3),
    "a control point in the middle": move_point(2, 0.6),
    "the last control point": move_point(4, -0.5),
    "a control point of a slide": lambda d: points_of(d, 2).__setitem__(2, points_of(d, 2)[2] + 0.5),
    "two control points exchanged": lambda d: points_of(d).__setitem__(slice(1, 4), points_of(d)[3:0:-1]),
    "the curve backwards": reverse_time,
    "a chord in place of the curve": lambda d: [p.__delitem__(slice(1, -1)) for p in
                                                d["configurations"][0]["positions"].values()],
    "a control point left out for one joint": lambda d: points_of(d).pop(2),
    "a control point left out for all": lambda d: [p.pop(2) for p in d["configurations"][0]["positions"].values()],
    "nine control points": lambda d: [p.extend([p[-1]] * 4) for p in d["configurations"][0]["positions"].values()],
    "one control point": lambda d: [p.__delitem__(slice(1, None)) for p in
                                    d["configurations"][0]["positions"].values()],
    "lower raised to upper": raise_lower,
    "upper lowered": lambda d: d["rows"][0].update(upper=d["rows"][0]["upper"] * (1 - 1e-3)),
    "a span left out": lambda d: spans(d).pop(len(spans(d)) // 2),
    "a span said to be longer": lambda d: (spans(d)[0].update(end=1), spans(d).__delitem__(slice(1, None))),
    "spans merged": lambda d: (spans(d)[0].update(end=spans(d)[1]["end"]), spans(d).pop(1)),
    "evaluated at the beginning": lambda d: [span.update(at=span["begin"]) for span in spans(d)],
    "bends ignored": lambda d: [claim.update(order=1) for claim in claims(d)],
    "no progress": lambda d: [span.pop("progress", None) for span in spans(d)],
    "the witness at another time": lambda d: d["rows"][0]["witness"].update(time=d["rows"][0]["witness"]["time"] / 2),
    "a joint that turns farther": lambda d: [m.update(multiplier=1.5 * m["multiplier"]) for body in d["bodies"]
                                             for m in body["moves"]],
    "no motion": lambda d: d["query"].update(motions=False),
}  # fmt: skip


@pytest.mark.parametrize("name", TAMPERINGS)
def test_tampering_is_found(checker, document, name):
    assert checker.each_rejects(document) == [False, False]
    mutated = copy.deepcopy(document)
    TAMPERINGS[name](mutated)
    assert mutated != document
    assert checker.each_rejects(mutated) == [True, True]


def test_each_control_point_matters(checker, document):
    """Of each joint and each control point, a large change is found by both checkers."""
    found = 0
    for k in range(3):
        for i in range(5):
            mutated = copy.deepcopy(document)
            points_of(mutated, k)[i] += 2.0
            refusals = checker.each_rejects(mutated)
            assert refusals[0] == refusals[1]
            found += refusals[0]
    assert found >= 13  # the first point of a joint may lead away from the other body


def test_statuses(engine):  # noqa: F811
    """Curves with an unusable control point claim nothing."""
    points = curves(1, 4, 1)
    points[0, 2, 0] = np.nan
    (row,) = engine.certificate(joints="arm", start=points, pairs=[("arm/finger", "egg")]).document["rows"]
    assert row["status"] == NAMES[clearance.Status.BAD_POSE] and not row["pairs"]
