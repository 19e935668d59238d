"""explain_path(): where a path is closest to a contact, and why it is not free."""

from pathlib import Path

import numpy as np
import pytest

import clearance

CELL = Path(__file__).resolve().parents[3] / "scenes/cell/robot.yaml"
MARGIN = 0.02


@pytest.fixture(params=["engine", "client"])
def front(request, start_daemon):
    if request.param == "engine":
        made: clearance.Engine | clearance.Client = clearance.Engine(
            clearance.Scene.load(CELL), threads=1, covers="off"
        )
    else:
        made = clearance.connect(start_daemon(CELL, ["ipc"]).urls["ipc"], timeout_s=60)
    made.allow("arm/wrist_1", "arm/flange")  # never farther apart than 18 mm
    return made


@pytest.fixture
def joints(front):
    return [name for name in front.joints("arm").names if name != "arm/grip"]


@pytest.fixture
def home(front, joints):
    return np.array([state.position for state in front.joint_states() if state.name in joints])


def turned(home, *angles):
    return [np.r_[angle, home[1:]] for angle in angles]


def bounds_at(front, joints, point, **options):
    r = front.distances(configurations=[point.positions], joints=joints, fields=["default", "pair"], **options)
    return r.lower[0], r.upper[0]


def test_a_free_path_has_its_least_distance(front, joints, home):
    path = turned(home, -0.4, -0.2, 0.0)
    report = front.explain_path(path, joints, margin=MARGIN)
    assert report and report.check.free
    assert report.contact is None and report.proved_until is None
    low, high = report.least
    assert MARGIN < low <= high <= low + 1.001e-3
    # The least distance is below that of every state, and the state that the report names attains it.
    states = np.concatenate([path[k] + np.linspace(0, 1, 101)[:, None] * (path[k + 1] - path[k]) for k in (0, 1)])
    assert low <= front.distances(configurations=states, joints=joints, reduce="min").upper.min()
    nearest = report.nearest
    assert nearest.index in (0, 1) and 0 <= nearest.t <= 1
    lower, upper = bounds_at(front, joints, nearest, reduce="min")
    assert lower <= high + 1e-9 and upper >= low
    gap = np.linalg.norm(nearest.segment[1] - nearest.segment[0])
    assert gap == pytest.approx(nearest.upper, abs=1e-9)


def test_a_hit_has_its_contact_and_depth(front, joints, home):
    path = turned(home, -0.4, 0.0, 0.75, 1.0)
    report = front.explain_path(path, joints, margin=MARGIN)
    assert not report and report.check.hit and report.check.index == 1
    assert report.least is None
    index, proved = report.proved_until
    contact, deepest = report.contact, report.nearest
    assert index == contact.index == deepest.index == 1
    assert 0 < proved < contact.t <= deepest.t <= 1
    # Free until `proved`, within the margin at the contact.
    part = [path[1], path[1] + proved * (path[2] - path[1])]
    assert front.check_path(part, joints=joints, margin=MARGIN - 1e-9).free
    assert contact.upper <= MARGIN
    assert contact.pair_names == tuple(front.bodies[i].name for i in contact.pair)
    assert not front.check([contact.positions], joints=joints, pairs=[contact.pair], margin=MARGIN).free[0]
    # The deepest is an overlap, whose bounds hold at its positions, and no deeper state was left out.
    assert deepest.upper < 0
    options = {"pairs": [deepest.pair], "signed_distance": True}
    lower, upper = (float(bound[0]) for bound in bounds_at(front, joints, deepest, **options))
    assert lower <= deepest.upper and deepest.lower <= upper
    times = np.linspace(contact.t, 1, 33)[:, None]
    rows = path[1] + times * (path[2] - path[1])
    all_depths = front.distances(configurations=rows, joints=joints, reduce="min", signed_distance=True)
    assert deepest.upper == all_depths.upper.min()


def test_a_trajectory_that_overshoots(front, joints, home):
    knots = turned(home, -0.4, 0.0)
    still, fast = np.zeros(6), np.r_[9.0, np.zeros(5)]
    assert front.check_path(knots, joints=joints, margin=MARGIN).free
    spline = clearance.Trajectory.cubic([0, 1], knots, [still, fast])
    calm = front.explain_path(clearance.Trajectory.linear([0, 1], knots), joints, margin=MARGIN)
    straight = front.explain_path(knots, joints, margin=MARGIN)
    assert calm.least == straight.least and (calm.nearest.positions == straight.nearest.positions).all()
    report = front.explain_path(spline, joints, margin=MARGIN)
    assert report.check.free == front.check_path(spline, joints=joints, margin=MARGIN).free
    point = report.nearest if report.contact is None else report.contact
    assert point.positions == pytest.approx(spline.at(point.t), abs=1e-12)
    assert point.positions[0] < -0.4  # before the start, where the spline goes first
    back = clearance.Trajectory.cubic([0, 1], turned(home, 0.0, 0.1), [fast, still])
    hit = front.explain_path(back, joints, margin=MARGIN)
    assert hit.check.hit and hit.nearest.upper < 0 and hit.nearest.positions[0] > 0.1


def test_neither_free_nor_hit(front, joints, home):
    # Turning the arm as a whole does not change the distance of two links, which cannot be proved to be beyond itself.
    path, pair = turned(home, 0.0, 0.3), [("arm/upper_arm", "arm/gripper")]
    margin = float(front.distances(pair, configurations=path[:1], joints=joints).upper[0, 0])
    report = front.explain_path(path, joints, pair, margin)
    assert not report and not report.check.free and not report.check.hit
    assert report.contact is None and report.proved_until[0] == 0
    assert report.least[0] <= margin <= report.least[1] + 1e-9


def test_a_path_that_touches_from_the_start(front, joints, home):
    report = front.explain_path(turned(home, 0.75, 0.8), joints, margin=MARGIN)
    assert report.proved_until == (0, 0.0) and report.contact.t == 0 and report.nearest.upper < 0


def test_a_cloud_is_named_and_has_no_depth(front, joints, home):
    away, into = turned(home, -0.4, -0.2), turned(home, -0.4, 0.0)
    middle = front.distances([("arm/gripper", "shelf")], configurations=into[1:], joints=joints, fields=["points"])
    points = middle.point_a[0, 0] + 0.01 * np.random.default_rng(5).random((100, 3))
    front.add_body("seen", points=points, radius=0.02, pose=[0, 0, 0, 1, 0, 0, 0])
    cloud = front.body_id("seen")
    free = front.explain_path(away, joints, [("arm", "seen")])
    assert free and cloud in free.nearest.pair and free.least[0] > 0
    assert free.nearest.pair_names == tuple(front.bodies[i].name for i in free.nearest.pair)
    for pairs in ([("arm", "seen")], None):
        hit = front.explain_path(into, joints, pairs, margin=0.003)
        assert hit.check.hit and cloud in hit.contact.pair and hit.contact.lower <= 0.003
        pair = [hit.contact.pair]
        lower, upper = bounds_at(front, joints, hit.contact, pairs=pair)
        assert lower[0] <= hit.contact.upper and hit.contact.lower <= upper[0]
        assert not front.check([hit.contact.positions], joints=joints, pairs=pair, margin=0.003).free[0]
        assert cloud in hit.nearest.pair and hit.nearest.lower == hit.nearest.upper == 0
    # A body with a depth beyond the cloud is deeper.
    beyond = front.explain_path(turned(home, -0.4, 0.75), joints)
    assert cloud in beyond.contact.pair and beyond.nearest.upper < 0 and cloud not in beyond.nearest.pair


def test_a_cloud_without_a_pose_hides_no_depth(front, joints, home):
    path = turned(home, -0.4, 0.0, 0.75, 1.0)
    without = front.explain_path(path, joints, margin=MARGIN)
    front.add_body("seen", points=np.zeros((1, 3)), radius=0.02)  # which has no pose yet
    pairs = [("arm", "*"), ("arm", "seen")]
    for listed in (None, pairs):
        hit = front.explain_path(path[1:], joints, listed, margin=MARGIN)
        assert hit.check.hit and hit.nearest.upper < 0
        assert hit.nearest.pair == without.nearest.pair and hit.nearest.upper == without.nearest.upper


def test_pairs_are_listed_only_for_clouds(front, joints, home, monkeypatch):
    listed = []

    def noted(*args, pairs=None, **options):
        listed.append(pairs)
        return distances(*args, pairs=pairs, **options)

    distances = front.distances
    monkeypatch.setattr(front, "distances", noted)
    assert front.explain_path(turned(home, 0.0, 0.75), joints, margin=MARGIN).contact is not None
    assert listed[0] is None and len(listed) == 2  # of the deepest state, then of the contact
    front.add_body("seen", points=np.full((1, 3), 9.0), static=True)
    assert front.explain_path(turned(home, 0.0, 0.75), joints, margin=MARGIN).contact is not None
    assert listed[2] is not None


def test_a_path_that_loses_its_pairs(front, joints, home, monkeypatch):
    distances = front.distances
    monkeypatch.setattr(front, "distances", lambda **options: distances(**{**options, "pairs": []}))
    with pytest.raises(RuntimeError, match="no pairs in this scene"):
        front.explain_path(turned(home, 0.0, 0.75), joints, margin=MARGIN)


def test_bad_input_names_the_argument(front, joints, home):
    for path in (None, "x", 3, home, [home], [home[:2], home[:2]]):
        with pytest.raises((TypeError, ValueError), match="path: "):
            front.explain_path(path, joints)
    for no_joints in (None, "nonesuch", [True]):
        with pytest.raises((TypeError, ValueError), match=r"joints(\[0\])?: "):
            front.explain_path(turned(home, 0, 1), no_joints)
    with pytest.raises((TypeError, ValueError), match="margin"):
        front.explain_path(turned(home, 0, 1), joints, margin=-1)
