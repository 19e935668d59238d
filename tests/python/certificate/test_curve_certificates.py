"""Certificates of motions along curves: both checkers accept every kind of them, and find every tampering with control
points, bounds and spans."""

import copy
import math
from fractions import Fraction

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


def test_the_checkers_derive_the_same_bounds_from_control_points(checker):
    """Bounds on derivatives hold samples, and are those of the exact polynomial at its ends."""
    rng = np.random.default_rng(1)
    for count in range(2, 9):
        points = tuple(Fraction(float(x)) for x in rng.uniform(-3, 3, count))
        begin, end = sorted(Fraction(int(x), 64) for x in rng.choice(65, 2, replace=False))
        (low, high), speed, bend = checker.checker.extent(points, begin, end)

        def derivative(time, order, points=points):
            """The derivative by Bernstein's polynomials."""
            values = list(points)
            for _ in range(order):
                values = [(len(values) - 1) * (b - a) for a, b in zip(values, values[1:])] or [Fraction(0)]
            n = len(values) - 1
            return sum(math.comb(n, i) * time**i * (1 - time) ** (n - i) * p for i, p in enumerate(values))

        times = [begin + k * (end - begin) / 16 for k in range(17)]
        assert all(low <= derivative(t, 0) <= high for t in times)
        assert all(abs(derivative(t, 1)) <= speed and abs(derivative(t, 2)) <= bend for t in times)
        assert low <= min(derivative(t, 0) for t in (begin, end))
        if count == 2:
            assert (speed, bend) == (abs(points[1] - points[0]), 0)
        if count == 3:
            assert (speed, bend) == (max(abs(derivative(t, 1)) for t in (begin, end)), abs(derivative(begin, 2)))


SLIDER = """<robot name="r"><link name="base"/><link name="ball"><collision><geometry><sphere radius="0.25"/></geometry>
  </collision></link><joint name="x" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="1 0 0"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    """A ball that slides along x towards a wall at x = 1: 3/4 - q m apart."""
    urdf = tmp_path_factory.mktemp("slider") / "slider.urdf"
    urdf.write_text(SLIDER)
    scene = clearance.Scene()
    scene.add_robot("r", urdf, home={}, base=at(0))
    scene.add_box("wall", [1, 1, 1], static=True, pose=at(1.5))
    engine = clearance.Engine(scene, covers="off")  # noqa: F811

    def document(points, place, order, lower):
        """One span of the whole motion, evaluated at a time."""
        found = engine.certificate(joints="r", start=[[[x] for x in points]], pairs=[("r/ball", "wall")]).document
        (row,) = found["rows"]
        (pair,) = row["pairs"]
        claim = {"pieces": [0, 0], "order": order, "seer": None, "direction": [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
                 "arithmetic": "float64"}  # fmt: skip
        pair["spans"] = [{**pair["spans"][0], "begin": 0, "end": 1, "at": place, "lower": [claim]}]
        pair["free"] = row["first_contact"] = None
        row["lower"] = pair["lower"] = lower
        return found

    return document


@pytest.mark.parametrize("points", [(0.0, -0.5, 0.0), (0.0, 0.125, 0.5), (0.25, 0.0, -0.125), (-0.5, 0.0, 0.5)])
@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 1.0])
def test_bounds_of_parabolas_are_tight(checker, slide, points, place):
    """Velocity and acceleration are exact, so one span proves the distance at the nearer end, and no more."""
    nearest = 0.75 - max(points[0], points[2])
    assert checker.each_rejects(slide(points, place, 2, nearest - 2**-40)) == [False, False]
    assert checker.each_rejects(slide(points, place, 2, nearest + 2**-40)) == [True, True]


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 1.0])
def test_bounds_by_speed_are_those_of_the_hull(checker, slide, place):
    points = (0.0, -0.25, 0.125)
    middle = 2 * place * (1 - place) * points[1] + place**2 * points[2]
    apart = 0.75 - middle - max(abs(p - middle) for p in points)
    assert checker.each_rejects(slide(points, place, 1, apart - 2**-40)) == [False, False]
    assert checker.each_rejects(slide(points, place, 1, apart + 2**-40)) == [True, True]


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
