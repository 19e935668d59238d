"""Bodies that move, or grow, while joints move along a path."""

import numpy as np
import pytest

import clearance


@pytest.fixture(scope="module")
def rail(tmp_path_factory):
    """A ball of 0.1 m on a rail along x, from 0 to 4 m, and free bodies."""
    path = tmp_path_factory.mktemp("rail") / "rail.urdf"
    path.write_text(
        "<robot name='r'><link name='base'/><link name='cart'><collision><geometry><sphere radius='0.1'/></geometry>"
        "</collision></link><joint name='x' type='prismatic'><parent link='base'/><child link='cart'/>"
        "<axis xyz='1 0 0'/><limit lower='0' upper='4'/></joint></robot>"
    )
    scene = clearance.Scene()
    scene.add_robot("r", path, home={"x": 0.0})
    scene.add_sphere("crate", 0.1, pose=[0, 9, 0, 1, 0, 0, 0])
    scene.add_sphere("person", 0.1, pose=[0, 9, 9, 1, 0, 0, 0])
    return clearance.Engine(scene)


def pose(x, y, z=0.0):
    return [x, y, z, 1, 0, 0, 0]


CART = ("r/cart", "crate")


def least(engine, meanwhile, path=((0.0,), (2.0,)), **more):
    start, end = ([row] for row in path)
    return engine.motions(start, end, "r", pairs=[("r/cart", body) for body in meanwhile], meanwhile=meanwhile, **more)


def test_two_bodies_that_pass_through_each_other_between_their_ends(rail):
    crossing = [pose(1, 1), pose(1, -1)]  # at x = 1 and y = 0 at half the time, as the cart
    r = least(rail, {"crate": crossing})
    assert r.status[0] == clearance.Status.OVERLAP
    late = [pose(1, 1.5), pose(1, -0.5)]
    r = least(rail, {"crate": late})
    t = np.linspace(0, 1, 2001)
    d = np.hypot(2 * t - 1, 1.5 - 2 * t).min() - 0.2
    assert r.lower[0] <= d <= r.upper[0] + 1e-6 and r.upper[0] - r.lower[0] <= 1e-3


def test_a_growing_ball_touches_at_one_time(rail):
    for gap, free in ((1e-6, True), (-1e-6, False)):
        # The cart recedes from x = 0, at 2 m per unit of time; the ball reaches 0.1 + 2 t - gap past it at the end.
        person = clearance.BodyPath(pose(-1, 0), growth=2.8 - gap)
        done = rail.check_path([[0.0], [2.0]], "r", pairs=[("r/cart", "person")], meanwhile={"person": person})
        assert done.free == free, gap
    assert done.hit and done.t == pytest.approx(1.0, abs=1e-5)
    r = least(rail, {"person": person}, margin=0.5)
    assert r.first_contact[0] == pytest.approx([(0.8 - 0.5) / 0.8] * 2, abs=2e-3)


def test_a_trajectory_takes_lines_to_its_own_times(rail):
    slow = clearance.Trajectory.quintic([0, 1, 4], [[0.0], [0.5], [2.0]])
    crossing = clearance.BodyPath([pose(1, 1.5), pose(1, -0.5)], [0, 4])
    engine_says = rail.check_path(slow, "r", pairs=[CART], meanwhile={"crate": crossing})
    t = np.linspace(0, 4, 8001)
    at = np.array([slow.at(s)[0] for s in t])
    d = np.hypot(at - 1, 1.5 - t / 2).min() - 0.2
    assert engine_says.free and d > 0.01
    for margin, free in ((d - 1e-4, True), (d + 1e-4, False)):
        options = {"joints": "r", "pairs": [CART], "margin": margin, "meanwhile": {"crate": crossing}}
        assert rail.check_path(slow, **options).free == free
        verdicts = rail.motions(slow, reduce="any", fields="verdict", **options).verdict
        assert (verdicts == clearance.Status.BEYOND).all() == free


def test_growth_takes_the_seconds_of_a_trajectory(rail):
    slow = clearance.Trajectory.linear([0, 4], [[0.0], [2.0]])
    person = clearance.BodyPath(pose(1, 2), growth=0.4)  # 0.436 m away at the end, grown by 1.6 m
    options = {"joints": "r", "pairs": [("r/cart", "person")], "meanwhile": {"person": person}}
    for margin, free in ((0.43, True), (0.44, False)):
        assert rail.check_path(slow, margin=margin, **options).free == free
        verdict = rail.motions(slow, margin=margin, reduce="any", **options).verdict[0]
        assert (verdict == clearance.Status.BEYOND) == free


def test_limits_of_waypoints_are_named_by_waypoint(rail):
    crate = {"crate": pose(9, 9)}
    plain = rail.check_path([[0.0], [5.0]], "r", pairs=[CART])
    done = rail.check_path([[0.0], [5.0]], "r", pairs=[CART], meanwhile=crate)
    assert [v.configuration for v in done.limit_violations] == [v.configuration for v in plain.limit_violations] == [1]


def test_a_second_robot_moves_in_the_same_query(tmp_path, rail):
    path = tmp_path / "r.urdf"
    path.write_text(
        "<robot name='r'><link name='base'/><link name='cart'><collision><geometry><sphere radius='0.1'/></geometry>"
        "</collision></link><joint name='x' type='prismatic'><parent link='base'/><child link='cart'/>"
        "<axis xyz='1 0 0'/><limit lower='-4' upper='4'/></joint></robot>"
    )
    scene = clearance.Scene()
    scene.add_robot("a", path, home={"x": 0.0})
    scene.add_robot("b", path, home={"x": 0.0}, base=[1, 1, 0, 0.5**0.5, 0, 0, -(0.5**0.5)])  # moves along -y
    engine = clearance.Engine(scene)
    assert engine.wait_covers(60)
    both = ["a/x", "b/x"]
    pairs = [("a/cart", "b/cart")]
    hit = engine.motions([[0, 0]], [[2, 2]], both, pairs=pairs, reduce="any", fields="verdict")
    free = engine.motions([[0, 0]], [[2, 0.5]], both, pairs=pairs, reduce="any", fields="verdict")
    assert hit.verdict[0] == clearance.Status.OK and free.verdict[0] == clearance.Status.BEYOND


def test_covers_decide_as_without(rail):
    assert rail.wait_covers(60)
    rng = np.random.default_rng(3)
    verdicts = []
    for _ in range(60):
        ends = [pose(*rng.uniform(-1, 3, 1), *rng.uniform(-1.5, 1.5, 1)) for _ in range(2)]
        body = clearance.BodyPath(ends, radius=rng.uniform(0, 0.2), growth=rng.uniform(0, 0.4))
        r = least(rail, {"crate": body}, reduce="any", fields="verdict")
        exact = least(rail, {"crate": body}, reduce="any", fields=["verdict", "lower", "steps"])
        assert r.verdict[0] == exact.verdict[0]
        verdicts.append(int(r.verdict[0]))
    assert min(verdicts.count(0), verdicts.count(int(clearance.Status.BEYOND))) > 10


@pytest.mark.parametrize(
    ("meanwhile", "text"),
    [
        (
            {"crate": clearance.BodyPath([pose(0, 1), pose(0, 2), pose(0, 3)], [0, 0.5, 1])},
            "at 0.5 s, within a segment",
        ),
        ({"crate": [pose(0, 1), pose(0, 2), pose(0, 3), pose(1, 1)]}, "a pose at each of 2 waypoints"),
        ({"absent": [pose(0, 1), pose(0, 2)]}, "absent"),
        ({}, "meanwhile: expected a dict"),
        ({"crate": np.zeros((3, 2, 7))}, r"expected \(1, 2, 7\) control poses"),
    ],
)
def test_wrong_ones_are_rejected_by_name(rail, meanwhile, text):
    with pytest.raises((ValueError, TypeError, KeyError), match=text):
        rail.check_path([[0.0], [1.0]], "r", meanwhile=meanwhile)


def test_more_of_them(rail):
    turning = [pose(0, 1), [0, 2, 0, 0, 0, 0, 1]]
    curve = clearance.Trajectory.quintic([0, 1], [[0.0], [1.0]])
    with pytest.raises(ValueError, match="bodies do not turn along curves"):
        rail.check_path(curve, "r", meanwhile={"crate": turning})
    with pytest.raises(ValueError, match="meanwhile: expected joints"):
        rail.check_path([[pose(0, 1)], [pose(0, 2)]], bodies=["crate"], meanwhile={"person": turning})
    with pytest.raises(ValueError, match="growth: expected"):
        clearance.BodyPath(pose(0, 1), growth=-1)
    turns = np.tile(np.array([[pose(0, 1)], [pose(0, 2)]]).reshape(1, 2, 7), (1, 3, 1))
    turns[0, 3, 3:] = [0, 0, 0, 1]
    with pytest.raises(clearance.QueryError, match="turns in motion 0"):
        rail.check_path(curve, "r", meanwhile={"crate": turns})


def test_clients_answer_as_an_engine(arm_front, arm_engine):
    start = [[0.0] * len(arm_engine.joints("arm"))]
    end = [[0.4] * len(start[0])]
    curve = clearance.Trajectory.quintic([0, 2], [start[0], end[0]])
    for cup in ([pose(0.4, 1), pose(0.4, -1)], clearance.BodyPath([pose(0.4, 1), pose(0.4, 0)], growth=0.1)):
        options = {"joints": "arm", "pairs": [("arm", "cup")], "meanwhile": {"cup": cup}}
        for path in ((start, end), (curve,)):
            here, there = (front.motions(*path, **options) for front in (arm_engine, arm_front))
            assert here.lower == there.lower and here.upper == there.upper and here.time == there.time
            assert here.status[0] in (clearance.Status.OK, clearance.Status.OVERLAP)
        with pytest.raises((ValueError, clearance.QueryError, clearance.RequestError), match=r"growths|joints|cup"):
            arm_front.motions(start, end, joints="arm", meanwhile={"cup": clearance.BodyPath(pose(0, 0), growth=2000)})


def test_explain_path_follows_the_bodies(rail):
    path = [[0.0], [2.0]]
    crossing, late = [pose(1, 1), pose(1, -1)], [pose(1, 1.5), pose(1, -0.5)]
    hit = rail.explain_path(path, "r", pairs=[CART], meanwhile={"crate": crossing})
    assert not hit and hit.contact.pair_names == ("r/cart", "crate") and hit.nearest.upper < -0.15
    t = hit.proved_until[1]
    assert np.hypot(2 * t - 1, 1 - 2 * t) - 0.2 == pytest.approx(0, abs=1e-2)
    free = rail.explain_path(path, "r", pairs=[CART], meanwhile={"crate": late})
    t = np.linspace(0, 1, 2001)
    d = np.hypot(2 * t - 1, 1.5 - 2 * t).min() - 0.2
    assert free and free.least[0] <= d <= free.least[1] + 1e-6


def test_explain_path_with_growth(rail):
    # The cart leaves x = 0 at 2 m in the motion; the person, 1 m behind it, grows by 3 m: contact at 0.8.
    person = clearance.BodyPath(pose(-1, 0), growth=3.0)
    options = {"pairs": [("r/cart", "person"), ("r/cart", "crate")], "margin": 0.01}
    curve = clearance.Trajectory.from_bezier([[[0.0], [1.0], [2.0]]])
    for path in ([[0.0], [2.0]], curve):
        hit = rail.explain_path(path, "r", meanwhile={"crate": pose(1, 0.5), "person": person}, **options)
        assert hit.check.hit and hit.contact.pair_names == ("r/cart", "person")
        assert hit.proved_until[1] == pytest.approx(0.79, abs=2e-3)
        assert hit.proved_until[1] <= hit.contact.t == pytest.approx(0.79, abs=2e-3)
        assert hit.contact.lower <= hit.contact.upper <= 0.01 + 1e-9
        assert hit.nearest.t == 1 and hit.nearest.upper == pytest.approx(-0.2, abs=1e-9)
        assert hit.nearest.lower == -np.inf, "a depth that growth alone makes"
        assert hit.nearest.segment[1] == pytest.approx([-0.9, 0, 0], abs=1e-9), "without growth"


def test_explain_path_of_the_second_motion_counts_growth_from_the_beginning(rail):
    path = [[0.0], [0.0], [2.0]]  # a second of each; the cart stays in the first one
    late = clearance.BodyPath([pose(1, 1.5), pose(1, 1.5), pose(1, -0.5)], radius=0.02, growth=0.05)
    t = np.linspace(0, 1, 2001)
    d = (np.hypot(2 * t - 1, 1.5 - 2 * t) - 0.2 - 0.02 - 0.05 * (1 + t)).min()
    free = rail.explain_path(path, "r", pairs=[CART], meanwhile={"crate": late})
    assert free and free.nearest.index == 1
    assert free.least[0] <= d <= free.least[1] + 1e-6 and free.least[1] - free.least[0] <= 1.001e-3
    near = clearance.BodyPath(late.poses, radius=0.02, growth=0.15)
    hit = rail.explain_path(path, "r", pairs=[CART], meanwhile={"crate": near})
    assert hit.contact.index == 1 and hit.nearest.upper < 0
    t = hit.contact.t
    assert np.hypot(2 * t - 1, 1.5 - 2 * t) - 0.22 - 0.15 * (1 + t) == pytest.approx(0, abs=5e-3)
    alone = rail.explain_path(path, "r", pairs=[CART], meanwhile={"crate": clearance.BodyPath(pose(0.1, 0), radius=1)})
    assert alone.contact.t == 0 and alone.proved_until == (0, 0.0)
    assert alone.contact.upper == pytest.approx(-1.1, abs=1e-9) and alone.contact.lower > -1.1 - 1e-6


def test_clients_explain_as_an_engine(arm_front, arm_engine):
    start = [0.0] * len(arm_engine.joints("arm"))
    end = [0.4] * len(start)
    kinds = set()
    for growth in (0.01, 2.0):
        cup = clearance.BodyPath([pose(0.4, 1), pose(0.4, 0.6)], growth=growth)
        options = {"joints": "arm", "pairs": [("arm", "cup")], "meanwhile": {"cup": cup}}
        here, there = (front.explain_path([start, end], **options) for front in (arm_engine, arm_front))
        assert here.check == there.check and here.least == there.least and here.proved_until == there.proved_until
        for a, b in ((here.nearest, there.nearest), (here.contact, there.contact)):
            kinds.add(a is None)
            assert (a is None) == (b is None)
            if a is not None:
                assert (a.t, a.pair, a.lower, a.upper) == (b.t, b.pair, b.lower, b.upper)
    assert kinds == {True, False}
