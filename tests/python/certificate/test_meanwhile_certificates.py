"""Certificates of bodies that move along curves, and of bodies that grow: both checkers accept every kind of them, and
find every tampering with control poses and growths."""

import copy

import numpy as np
import pytest

import clearance
from certificates import NAMES
from clearance import BodyPath
from scenes import at
from test_curve_certificates import SLIDER, curves, sides_of
from test_motion_certificates import check, claims, engine, kind_of_contact, spans  # noqa: F401  (a fixture)
from test_surface_certificates import ball, torus

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")

PAIRS = [("arm/finger", "egg"), ("arm/fore", "wall"), ("arm/upper", "vague"), ("egg", "post")]
CLOSE = [("arm/finger", "egg"), ("egg", "post")]


def controls(points, seed, turn=(1, 0.2, -0.1, 0.3)):
    """(1, points, 7) control poses of the cart, which carries the arm, and of the egg; they keep their rotation."""
    rng = np.random.default_rng(seed)

    def around(place, way):
        return [[[*(np.array(place) + rng.uniform(-1, 1, 3) * way), *turn] for _ in range(points)]]

    cart, egg = around([0, 0, -0.2], [0.1, 0.1, 0]), around([0.2, -1.2, 0.9], 0.4)
    return {"cart": BodyPath(cart), "egg": BodyPath(egg, radius=0.05, growth=0.2)}


def test_curves_of_every_degree_that_grow(checker, engine):  # noqa: F811
    seen: set = set()
    for points in range(2, 9):
        reduce = ("min", "any", "none")[points % 3]
        document = check(checker, engine, seen, joints="arm", start=curves(1, points, points, 0.3), reduce=reduce,
                         pairs=PAIRS[: 2 + 2 * (points == 4)], margin=0.01, abs_tol=2e-2,
                         meanwhile=controls(points, points))  # fmt: skip
        (configuration,) = document["configurations"]
        assert {len(poses) for poses in configuration["poses"].values()} == {points}
        assert {len(pose) for poses in configuration["poses"].values() for pose in poses} == {8}
    assert {"ok", "beyond", "half", "whole"} <= seen
    assert {order for order, *_ in (x for x in seen if isinstance(x, tuple))} == {1, 2}


def test_curves_without_growth(checker, engine):  # noqa: F811
    for points in (3, 5):
        moved = {name: BodyPath(path.poses) for name, path in controls(points, points).items()}
        document = check(checker, engine, set(), joints="arm", start=curves(1, points, points, 0.3), reduce="any",
                         pairs=PAIRS, margin=0.01, meanwhile=moved)  # fmt: skip
        poses = document["configurations"][0]["poses"].values()
        assert {len(pose) for each in poses for pose in each} == {7}


@pytest.fixture
def walk(checker, tmp_path):
    """Numbers of spans that prove a walk past some posts, balls of 0.1 m, at rest at both ends."""
    urdf = tmp_path / "slider.urdf"
    urdf.write_text(SLIDER)
    scene = clearance.Scene()
    scene.add_robot("r", urdf, home={}, base=at(0, 0, -9))
    for name, place in (("post", at(0)), ("nearer", at(1.7))):
        scene.add_sphere(name, 0.1, static=True, pose=place)
    scene.add_sphere("walker", 0.1, pose=at(3))
    yard = clearance.Engine(scene, backend="cpu", covers="off")

    def spans_of(middle, step, margin, posts=("post",)):
        line = [[[*(middle + (share - 0.5) * step), 1, 0, 0, 0] for share in (0, 0, 0, 1, 1, 1)]]
        document = check(checker, yard, set(), joints="r", start=[[[0.0]] * 6], reduce="any", margin=margin,
                         pairs=[("walker", post) for post in posts], meanwhile={"walker": BodyPath(line)})  # fmt: skip
        return [len(pair["spans"]) for pair in document["rows"][0]["pairs"]]

    return spans_of


def test_coordinates_count_as_one_curve(walk):
    """Bounds on the speeds of a body's three coordinates, added up, took 44 spans."""
    nearest, step = np.array([0.3, -0.3, 0]), np.ones(3) * 0.3 / 3**0.5
    assert sum(walk(nearest, step, float(np.linalg.norm(nearest)) - 0.203)) < 43


def test_far_bodies_take_one_span(walk):
    """As along a straight motion: 0.8 m less 0.25 is more than 0.5. The greatest speed would lead 0.47 m away."""
    for step in ([0, 0.5, 0], [0, 0.3, 0.4]):
        spans = walk(np.array([1, 0, 0]), np.array(step), 0.0, posts=("post", "nearer"))
        assert min(spans) == 1 and len(spans) == 2


def test_bodies_that_turn_and_grow(checker, engine):  # noqa: F811
    """Straight motions: between two poses a body turns, while it grows linearly."""
    turning = {"egg": BodyPath([at(0.2, -1.2, 0.9), at(0.1, -0.9, 1.0, (1, 1, 0, 0.3))], growth=0.4)}
    for reduce in ("min", "any", "none"):
        check(checker, engine, set(), joints="arm", start=[[0.1, 0.3, 0.0]], end=[[0.5, 0.1, 0.05]], pairs=PAIRS,
              reduce=reduce, meanwhile=turning, margin=0.05)  # fmt: skip


def test_growth_alone_makes_contacts_and_overlaps(checker, engine):  # noqa: F811
    kinds, statuses = set(), set()
    for growth, reduce in ((0.2, "min"), (1.0, "min"), (1.0, "any"), (3.0, "none"), (6.0, "any")):
        grows = {"egg": BodyPath(at(0.2, -1.2, 0.9), growth=growth)}
        rest = np.repeat(curves(1, 1, 3), 3, axis=1)
        rest[:, 1:] += 0.05
        document = check(checker, engine, set(), joints="arm", start=rest, pairs=CLOSE, margin=0.1, reduce=reduce,
                         meanwhile=grows)  # fmt: skip
        for row in document["rows"]:
            statuses.add(row["status"])
            kinds.add(kind_of_contact(row)[0])
    assert {"inf", "a while"} <= kinds and {"ok", "overlap"} <= statuses


def test_solids_that_grow(checker, tmp_path):
    """Elements of meshes, and a ball that is inside a solid from the beginning."""
    urdf = tmp_path / "slider.urdf"
    urdf.write_text(SLIDER)
    scene = clearance.Scene()
    scene.add_robot("r", urdf, home={}, base=at(0, 0, -3))
    scene.add_body("ring", mesh=torus(5, 3, 0.3, 0.1), mesh_as="solid", pose=at(0))
    scene.add_body("ball", mesh=ball(0.5, 1), mesh_as="solid", pose=at(3))
    scene.add_sphere("pea", 0.01, pose=at(3))
    yard = clearance.Engine(scene, backend="cpu", covers="off")
    seen: set = set()
    for growth, pairs in ((0.1, ["ring", "pea"]), (0.9, ["ring"])):
        line = BodyPath([[at(3), at(2, 0.5, 1.5), at(1.5, 0, 1)]], growth=growth)
        check(checker, yard, seen, joints="r", start=[[[0.0], [0.1], [0.3]]], reduce="none", abs_tol=5e-2,
              pairs=[("ball", name) for name in pairs], meanwhile={"ball": line})  # fmt: skip
    assert {"overlap", "ok"} <= seen


# ---- one span, to the last bit ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hall(tmp_path_factory):
    """A ball of 0.25 m on a slide at rest, and a ball of 0.25 m that moves along x: 1/2 m apart at x = 1."""
    urdf = tmp_path_factory.mktemp("slider") / "slider.urdf"
    urdf.write_text(SLIDER)
    scene = clearance.Scene()
    scene.add_robot("r", urdf, home={}, base=at(0))
    scene.add_sphere("crate", 0.25, pose=at(1))
    made = clearance.Engine(scene, covers="off")

    def document(places, growths, at_time, order, lower, progress=None):
        """One span of the whole motion, evaluated at a time."""
        poses = [[at(x) for x in places]]
        grows = BodyPath(poses, radius=0.5)
        start = [[[0.0]] * len(places)]
        found = made.certificate(joints="r", start=start, pairs=[("r/ball", "crate")],
                                 meanwhile={"crate": grows}).document  # fmt: skip
        for pose, growth in zip(next(iter(found["configurations"][0]["poses"].values())), growths):
            pose[7] = growth
        (row,) = found["rows"]
        (pair,) = row["pairs"]
        claim = {"pieces": [0, 0], "order": order, "seer": None, "direction": [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
                 "arithmetic": "float64"}  # fmt: skip
        pair["spans"] = [{"begin": 0, "end": 1, "at": at_time, "lower": [claim],
                          "progress": progress and [progress, progress],
                          "slack": {"inner": 0, "outer": 0, "terms": []}}]  # fmt: skip
        pair["free"] = row["first_contact"] = row["witness"] = None
        row.update(lower=lower, upper="inf", status="unconverged", proved=True)
        pair["lower"] = lower
        return found

    return document


SMALL = 2**-40


@pytest.mark.parametrize("growths", [(0.0, 0.0, 0.0), (0.125, 0.0, 0.25), (0.0, 0.125, 0.0), (0.25, 0.25, 0.25)])
@pytest.mark.parametrize("place", [0.0, 0.25, 1.0])
def test_growth_and_curves_are_bounded_tightly(checker, hall, growths, place):
    """Control points of parabolas are exact: along the normal a span proves the least gap at the ends of its sides,
    less the rest that the progress leaves of way and growth. By speed it proves the gap less the greatest way to a
    control point.
    """
    places, progress = (2.0, 1.875, 1.625), [0.0, 0.5, 1.0]

    def quadratic(p, t):
        return (1 - t) ** 2 * p[0] + 2 * t * (1 - t) * p[1] + t**2 * p[2]

    gap = quadratic(places, place) - 0.5 - quadratic(growths, place)
    least, farthest, grown = gap, 0.0, 0.0
    for way, growing in zip(sides_of(places, place), sides_of(growths, place)):
        rest = max(abs(x - r * way[2]) for x, r in zip(way, progress))
        rest += max(x - r * growing[2] for x, r in zip(growing, progress))
        least = min(least, gap - rest, gap + way[2] - growing[2] - rest)
        farthest, grown = max([farthest, *map(abs, way)]), max([grown, *growing])
    assert least > SMALL
    assert checker.each_rejects(hall(places, growths, place, 2, least - SMALL, progress)) == [False, False]
    assert checker.each_rejects(hall(places, growths, place, 2, least + SMALL, progress)) == [True, True]
    by_speed = gap - farthest - grown
    if by_speed > SMALL:
        assert checker.each_rejects(hall(places, growths, place, 1, by_speed - SMALL)) == [False, False]
        assert checker.each_rejects(hall(places, growths, place, 1, by_speed + SMALL)) == [True, True]


def test_rules_of_control_poses(checker, hall):
    """Each violation alone, in a document whose claim would hold."""

    def poses(document):
        return next(iter(document["configurations"][0]["poses"].values()))

    def refuses(growths, change):
        document = hall((2.0, 2.0, 2.0), growths, 0.5, 2, 0.25)
        change(document)
        return checker.each_rejects(document)

    none = (0.0, 0.0, 0.0)
    assert refuses(none, lambda d: None) == [False, False]
    assert refuses((-0.25, -0.25, -0.25), lambda d: None) == [True, True]
    assert refuses(none, lambda d: [pose.append(0.0) for pose in poses(d)]) == [True, True]
    assert refuses(none, lambda d: poses(d)[1].pop()) == [True, True]
    assert refuses(none, lambda d: [pose.pop() for pose in poses(d)]) == [False, False]
    assert refuses(none, lambda d: poses(d).append(poses(d)[0])) == [True, True]
    assert refuses(none, lambda d: poses(d)[1].__setitem__(3, -1.0)) == [
        True,
        True,
    ]  # the same rotation, but not as given


# ---- tampering -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def document(checker, engine):  # noqa: F811
    """A row that is apart, of a body that grows along a curve, proved by several spans of both orders."""
    for seed in range(10, 80):
        found = engine.certificate(
            joints="arm", start=curves(1, 4, seed, 0.3), pairs=[("arm/finger", "egg")], reduce="none", abs_tol=1e-3,
            meanwhile={"egg": controls(4, seed)["egg"]},
        ).document  # fmt: skip
        (row,) = found["rows"]
        orders = {p["order"] for span in row["pairs"][0]["spans"] for p in span["lower"]}
        if row["status"] == "ok" and 2 in orders and 2 < len(spans(found)) < 60 and 0.2 < row["witness"]["time"] < 0.8:
            assert checker.each_rejects(found) == [False, False]
            return found
    raise AssertionError("no such row")


def poses_of(d):
    (poses,) = d["configurations"][0]["poses"].values()
    return poses


def every(change):
    def mutate(d):
        for pose in poses_of(d):
            change(pose)

    return mutate


def nearer(d, control):
    """Moves a control pose 0.5 m towards the finger, where the witness is."""
    witness = d["rows"][0]["witness"]
    place, egg = (np.array(pose[:3]) for pose in witness["poses"])
    step = 0.5 * (place - egg) / np.linalg.norm(place - egg)
    poses_of(d)[control][:3] = list(np.array(poses_of(d)[control][:3]) + step)


TAMPERINGS = {
    "a control pose nearer": lambda d: nearer(d, 1),
    "the first pose nearer": lambda d: nearer(d, 0),
    "the last pose nearer": lambda d: nearer(d, 3),
    "the curve backwards": lambda d: poses_of(d).reverse(),
    "a control pose left out": lambda d: poses_of(d).pop(1),
    "a control pose more": lambda d: poses_of(d).append(list(poses_of(d)[-1])),
    "the chord in place of the curve": lambda d: [poses_of(d).__delitem__(slice(1, 3)),
        *(p.__delitem__(slice(1, 3)) for p in d["configurations"][0]["positions"].values())],
    "a turn along the curve": lambda d: poses_of(d)[2].__setitem__(slice(3, 7), [1, 0, 0, 0]),
    "more growth": every(lambda pose: pose.__setitem__(7, pose[7] + 0.01)),
    "faster growth": lambda d: [pose.__setitem__(7, pose[7] + 0.02 * k) for k, pose in enumerate(poses_of(d))],
    "growth in between": lambda d: poses_of(d)[2].__setitem__(7, poses_of(d)[2][7] + 0.2),
    "less growth, and so a witness too far": every(lambda pose: pose.__setitem__(7, pose[7] - 0.01)),
    "no growth": every(lambda pose: pose.pop()),
    "growth of one pose left out": lambda d: poses_of(d)[1].pop(),
    "negative growth": lambda d: poses_of(d)[0].__setitem__(7, -0.05),
    "growth that is no number": lambda d: poses_of(d)[1].__setitem__(7, "inf"),
    "a ninth number": every(lambda pose: pose.append(0.0)),
    "upper lowered": lambda d: d["rows"][0].update(upper=d["rows"][0]["upper"] * (1 - 1e-3)),
    "lower raised": lambda d: (d["rows"][0].update(lower=d["rows"][0]["upper"]),
                               d["rows"][0]["pairs"][0].update(lower=d["rows"][0]["upper"])),
    "a span left out": lambda d: spans(d).pop(len(spans(d)) // 2),
    "evaluated at the beginning": lambda d: [span.update(at=span["begin"]) for span in spans(d)],
    "bends ignored": lambda d: [claim.update(order=1) for claim in claims(d)],
    "another witness's time": lambda d: d["rows"][0]["witness"].update(time=d["rows"][0]["witness"]["time"] / 2),
}  # fmt: skip


@pytest.mark.parametrize("name", TAMPERINGS)
def test_tampering_is_found(checker, document, name):
    mutated = copy.deepcopy(document)
    TAMPERINGS[name](mutated)
    assert mutated != document
    assert checker.each_rejects(mutated) == [True, True]


def test_statuses(engine):  # noqa: F811
    """A curve with an unusable control pose claims nothing."""
    moved = controls(4, 1)["egg"].poses.copy()
    moved[0, 2, 0] = np.nan
    found = engine.certificate(joints="arm", start=curves(1, 4, 1), pairs=[("arm/finger", "egg")],
                               meanwhile={"egg": BodyPath(moved)}).document  # fmt: skip
    (row,) = found["rows"]
    assert row["status"] == NAMES[clearance.Status.BAD_POSE] and not row["pairs"]


def test_clients_have_them(checker, arm_front, arm_engine):
    arm = arm_engine.joints("arm")
    home = np.array([joint.position for joint in arm_engine.joint_states()])[: len(arm)]
    curve = clearance.Trajectory.quintic([0, 2], [home, home + 0.2])
    cup = BodyPath([at(0.4, 1), at(0.4, 0.5)], growth=0.1)
    options = {"start": curve, "joints": "arm", "pairs": [("arm", "cup")], "meanwhile": {"cup": cup}, "reduce": "any"}
    here, there = arm_engine.certificate(**options).document, arm_front.certificate(**options).document
    assert all(is_proved for is_proved, _ in checker.verdicts(there))
    assert there["rows"] == here["rows"] and there["configurations"] == here["configurations"]
