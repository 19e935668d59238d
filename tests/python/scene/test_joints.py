"""Robots in scenes, joint positions and queries in joint space: in process and through a daemon on every transport."""

import math
import warnings

import numpy as np
import pytest

import clearance
from clearance import Flag, Status
from patience import PATIENCE_S
from robots import arm_scene, rows_of
from scenes import at, same_bits


@pytest.fixture
def engine(arm_engine):
    return arm_engine


def test_joints_have_names_ids_and_limits(engine):
    arm = engine.joints("arm")
    assert len(arm) == 8 and arm.names[3] == "arm/joint4" and arm.ids.dtype == np.uint32
    assert (arm.lower[3], arm.upper[3]) == (-3.07, -0.07)
    two = engine.joints(["arm/joint3", 0])
    assert two.names == ("arm/joint3", "arm/joint1") and list(two.ids) == [2, 0]
    with pytest.raises(ValueError, match="group: no robot or group of joints is named 'amr'; did you mean 'arm'"):
        engine.joints("amr")
    with pytest.raises(ValueError, match=r"group\[1\]: no joint is named 'arm/joint9'"):
        engine.joints(["arm/joint1", "arm/joint9"])
    with pytest.raises(ValueError, match="'arm/joint1' is named twice"):
        engine.joints(["arm/joint1", 0])


def test_set_joints_moves_links_and_what_follows_them(engine):
    engine.attach("cup", "arm/palm", at(0, 0, 0.2))
    before = engine.body_states()[engine.body_id("cup")].pose
    done = engine.set_joints({"arm/joint1": 0.7, 1: -0.3}, stamp_ns=5, sequence=2)
    assert (done.applied, done.bad, done.unknown) == (2, 0, 0)
    after = engine.body_states()[engine.body_id("cup")]
    assert after.status == Status.OK and not np.allclose(after.pose, before)
    states = engine.joint_states()
    assert states[0].position == 0.7 and states[0].stamp_ns == 5 and states[0].age_ns >= 0
    assert states[2].position == 0 and states[2].age_ns is None
    row = np.linspace(-0.4, -0.1, 8)
    engine.set_joints(row, joints="arm")
    assert [state.position for state in engine.joint_states()] == list(row)
    assert engine.joint_states()[7].beyond_limits and not engine.joint_states()[3].beyond_limits
    assert engine.set_joints({0: np.nan}).bad == 1
    assert engine.joint_states()[0].status == Status.BAD_POSE


def test_a_query_of_positions_is_that_of_each_in_turn(engine, urdf):
    arm = engine.joints("arm")
    rows = rows_of(arm, 9)
    fields = ("default", "points", "normal", "gradient", "flags")
    answer = engine.distances(joints=arm, configurations=rows, fields=fields)
    other = clearance.Engine(arm_scene(urdf), threads=1, covers="off")
    pairs = answer.pairs
    assert len(pairs) > 10 and answer.lower.shape == (9, len(pairs))
    for k, row in enumerate(rows):
        other.set_joints(row, joints=arm)
        one = other.distances(pairs=pairs, fields=fields)
        for name in ("lower", "upper", "status", "point_a", "normal", "gradient"):
            assert np.array_equal(getattr(answer, name)[k], getattr(one, name)[0], equal_nan=True), name
    nearest = engine.distances(joints="arm", configurations=rows, reduce="min", fields=["lower", "upper", "pair"])
    assert np.array_equal(nearest.upper, answer.upper.min(axis=1))
    robot = engine.distances(pairs=("arm", "table"), joints=arm, configurations=rows)
    assert robot.pairs.shape[1] == 2 and set(robot.pairs[:, 0]) == {engine.body_id("table")}


def test_gradients_by_joints_are_differences(engine):
    arm = engine.joints(["arm/joint4", "arm/joint1", "arm/grip"])
    rows = rows_of(arm, 4, seed=3)
    fields = ("upper", "flags", "gradient_joints")
    options = dict(joints=arm, pairs=("table", "arm"), rel_tol=1e-10)
    answer = engine.distances(configurations=rows, fields=fields, **options)
    assert answer.gradient_joints.shape == answer.upper.shape + (3,) and "gradient_joints" in answer.columns
    step, compared = 1e-6, 0
    for j in range(3):
        ahead, behind = (
            engine.distances(configurations=rows + s * np.eye(3)[j], fields="upper", **options) for s in (step, -step)
        )
        slope = (ahead.upper - behind.upper) / (2 * step)
        smooth = (answer.upper > 0.01) & ((answer.flags & Flag.NONSMOOTH) == 0)
        compared += int(np.count_nonzero(smooth))
        assert np.abs(answer.gradient_joints[..., j] - slope)[smooth].max() < 1e-4
    assert compared > 20
    least = engine.distances(configurations=rows, reduce="min", fields=("gradient_joints", "flags"), joints=arm)
    assert least.gradient_joints.shape == (4, 3)
    with pytest.raises(clearance.QueryError, match="fields: gradient_joints is for a query with joints"):
        engine.distances(fields="gradient_joints")


# A link that rotates about z, and the obstacles next to it. At q = 0 their faces and edges are parallel.
ROUND_LINK = """<robot name="r"><link name="base"/><link name="l"><collision><origin xyz="0.3 0.05 0.02" rpy="{rpy}"/>
<geometry>{shape}</geometry></collision></link><joint name="j" type="continuous"><parent link="base"/><child link="l"/>
<axis xyz="0 0 1"/></joint></robot>"""
ROUND_SHAPES = [
    "<cylinder radius='0.2' length='0.5'/>",
    "<box size='0.4 0.3 0.5'/>",
    "<capsule radius='0.1' length='0.3'/>",
]
BESIDE = {
    "box": lambda scene, pose: scene.add_box("o", [1, 1, 1], static=True, pose=pose),
    "ellipsoid": lambda scene, pose: scene.add_ellipsoid("o", [0.5, 0.4, 0.3], static=True, pose=pose),
    "cylinder": lambda scene, pose: scene.add_cylinder("o", 0.5, 1, static=True, pose=pose),
    "lying cylinder": lambda scene, pose: scene.add_cylinder("o", 0.5, 1, static=True, pose=[*pose[:3], 1, 0, 1, 0]),
    "cone": lambda scene, pose: scene.add_cone("o", 0.5, 1, static=True, pose=pose),
}


@pytest.mark.parametrize("beside", BESIDE)
def test_gradients_of_round_bodies_are_right_or_flagged(tmp_path, beside):
    """Compared with differences, at the default tolerance: accurate to the normal's uncertainty, or NONSMOOTH."""
    step, seen, flagged = 1e-5, 0, 0
    rng = np.random.default_rng(3)
    for shape in ROUND_SHAPES:
        for rpy in ("0 0 0", "1.5707963267948966 0 0", "0 1.5707963267948966 0", "0.3 0.2 0.1"):
            (tmp_path / "r.urdf").write_text(ROUND_LINK.format(shape=shape, rpy=rpy))
            scene = clearance.Scene()
            scene.add_robot("r", tmp_path / "r.urdf")
            BESIDE[beside](scene, at(0.2, 1.4, 0.0))
            engine = clearance.Engine(scene, threads=1, covers="off")
            rows = np.concatenate([np.zeros((1, 1)), rng.uniform(-1e-4, 1e-4, (5, 1)), rng.uniform(-0.5, 0.5, (20, 1))])
            options = {"pairs": [("r/l", "o")], "joints": "r"}
            r = engine.distances(configurations=rows, fields=["gradient_joints", "flags"], **options)
            below, here, above = (
                engine.distances(configurations=rows + d, fields="upper", rel_tol=1e-13, **options).upper
                for d in (-step, 0, step)
            )
            smooth = (r.flags & Flag.NONSMOOTH) == 0
            slopes = np.sort([(here - below) / step, (above - here) / step], axis=0)  # they differ next to an edge
            gradient = r.gradient_joints[..., 0]
            wrong = np.maximum(slopes[0] - gradient, gradient - slopes[1])
            assert (wrong[smooth] < 5e-3).all(), (shape, rpy, wrong[smooth].max())
            seen, flagged = seen + smooth.sum(), flagged + (~smooth).sum()
    assert seen > 150
    assert flagged > 3 or beside in ("ellipsoid", "cone")


def test_free_scale_is_a_region_that_is_free(engine):
    arm = engine.joints("arm")
    rows = rows_of(arm, 40, seed=5)
    weights = np.array([1, 1, 1, 1, 2, 2, 0, 0.01])
    pairs = [("table", "arm/palm"), ("cup", "arm/fore"), ("cup", "arm/palm"), ("arm/base", "arm/palm")]
    scale = engine.free_scale(rows, arm, weights, margin=0.005, pairs=pairs)
    assert scale.shape == (40,) and scale.dtype == np.float64 and np.isfinite(scale).all()
    free = engine.check(rows, joints=arm, margin=0.005, pairs=pairs).free
    assert np.array_equal(scale > 0, free) and 5 < free.sum() < 40
    rng = np.random.default_rng(6)
    within = rows[free][:, None] + scale[free][:, None, None] * weights * rng.choice([-1, 1], (free.sum(), 20, 8))
    assert engine.check(within.reshape(-1, 8), joints=arm, margin=0.004, pairs=pairs).free.all()
    half = engine.free_scale(rows, arm, weights / 2, margin=0.005, pairs=pairs)
    assert (half[free] > scale[free]).all()
    with pytest.raises(clearance.QueryError, match="weights: expected 8 numbers, one for each joint, got 2"):
        engine.free_scale(rows, arm, [1, 2])
    with pytest.raises(ValueError, match="weights: expected one number for each joint, got shape"):
        engine.free_scale(rows, arm, np.ones((8, 1)))


def test_bad_rows_are_statuses_and_limits_are_flags(engine):
    rows = np.array([[0.1, -1.0], [np.nan, -1.0], [0.1, 0.5]])
    answer = engine.distances(
        joints=["arm/joint1", "arm/joint4"],
        configurations=rows,
        pairs=("table", "arm/palm"),
        fields=["default", "flags"],
    )
    assert list(answer.status[:, 0]) == [Status.OK, Status.BAD_POSE, answer.status[2, 0]]
    assert [bool(flags & Flag.BEYOND_LIMITS) for flags in answer.flags[:, 0]] == [False, False, True]


WRONG = {
    "joints: only together with configurations": {"joints": "arm"},
    r"configurations: expected shape \(K, 8\), one column for each joint, got \(1, 7\)": {
        "joints": "arm", "configurations": np.zeros((1, 7))},
    r"configurations: expected shape \(K, 8\), .* got \(8,\); write configurations\[None\] for one row": {
        "joints": "arm", "configurations": np.zeros(8)},
    "configurations: expected at least one row": {"joints": "arm", "configurations": np.zeros((0, 8))},
    r"joints: 'arm/joint1' is named twice": {"joints": [0, 0], "configurations": np.zeros((1, 2))},
    "joints: expected at least one": {"joints": [], "configurations": np.zeros((1, 0))},
    r"configurations: expected a pair \(positions, poses\), since joints and bodies move": {
        "joints": "arm", "bodies": ["cup"], "configurations": np.zeros((3, 8))},
    "configurations: expected K = 3 poses as of positions, got 2": {
        "joints": "arm", "bodies": ["cup"],
        "configurations": (np.zeros((3, 8)), np.tile(at(0), (2, 1, 1)).astype(float))},
}  # fmt: skip


@pytest.mark.parametrize("text", WRONG)
def test_wrong_arguments_are_named(engine, text):
    with pytest.raises((ValueError, TypeError), match=text):
        engine.distances(**WRONG[text])


def test_publishing_a_links_pose_is_refused_with_a_reason(engine):
    with pytest.raises(clearance.QueryError, match="'arm/fore' is a link placed by joints"):
        engine.set_poses({"arm/fore": at(0)})
    engine.set_poses({"arm": at(0, 0, 1)})  # the base
    assert engine.body_states()[engine.body_id("arm/base")].pose[2] == 1


def test_a_scene_of_one_robot_and_its_warnings(tmp_path, urdf):
    srdf = tmp_path / "arm.srdf"
    srdf.write_text(
        '<robot name="arm"><group name="upper"><joint name="joint1"/><joint name="joint2"/></group>'
        '<group_state name="up" group="upper"><joint name="joint2" value="0.5"/></group_state>'
        '<disable_collisions link1="base" link2="upper" reason="Adjacent"/>'
        '<disable_collisions link1="base" link2="gone" reason="Never"/></robot>'
    )
    with pytest.warns(clearance.RobotWarning, match='arm.srdf:1: .*there is no link "gone"'):
        scene = clearance.Scene.load_urdf(urdf, srdf=srdf)
    assert "arm/upper" not in scene.groups and "arm" in scene.groups, "a link has that name"
    engine = clearance.Engine(scene, covers="off")
    assert engine.joints("arm/upper").names == ("arm/joint1", "arm/joint2")
    assert engine.joint_states()[0].status == Status.NO_POSE, "no home"
    names = {engine.bodies[a].name + " " + engine.bodies[b].name for a, b in engine.pairs}
    assert "arm/base arm/upper" not in names and "arm/upper arm/fore" in names
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", clearance.RobotWarning)
        with pytest.raises(clearance.SceneError, match='"joint4" is not named, and 0 is beyond its limits'):
            clearance.Scene.load_urdf(urdf, srdf=srdf, home="up")


def test_an_srdf_may_disable_all_pairs_of_a_link(tmp_path, urdf):
    def pairs(text):
        (tmp_path / "arm.srdf").write_text(f'<robot name="arm">{text}</robot>')
        engine = clearance.Engine(clearance.Scene.load_urdf(urdf, srdf=tmp_path / "arm.srdf"), covers="off")
        return {frozenset((engine.bodies[a].name, engine.bodies[b].name)) for a, b in engine.pairs}

    default, enabled = '<disable_default_collisions link="base"/>', '<enable_collisions link1="base" link2="fore"/>'
    everything, pair = pairs(""), frozenset(("arm/base", "arm/fore"))
    others = {names for names in everything if "arm/base" not in names}
    assert pair in everything and len(others) < len(everything)
    assert pairs(default) == others
    assert pairs(default + enabled) == pairs(enabled + default) == others | {pair}


def test_a_daemon_answers_as_the_engine_does(arm_daemon, kind, engine):
    with clearance.connect(arm_daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        arm = client.joints("arm")
        assert arm.names == engine.joints("arm").names and np.array_equal(arm.upper, engine.joints("arm").upper)
        start = {"arm/joint1": 0.2, "arm/joint4": -1.1}
        for one in (client, engine):
            assert one.set_joints(start).applied == 2
        assert [s.position for s in client.joint_states()] == [s.position for s in engine.joint_states()]
        rows = rows_of(arm, 40)
        queries = [
            {"joints": arm, "configurations": rows},
            {"joints": "arm", "configurations": rows, "reduce": "min", "fields": ["default", "pair", "flags"]},
            {"joints": ["arm/joint6", "arm/joint2"], "configurations": rows[:, :2], "reduce": "within",
             "max_distance": 0.1},
            {"joints": arm, "bodies": ["cup"], "pairs": ("cup", "arm"),
             "configurations": (rows, np.tile(at(0.1, 0.2, 0.3), (40, 1, 1)).astype(float))},
        ]  # fmt: skip
        for query in queries:
            expected = engine.distances(**query)
            assert same_bits(client.distances(**query), expected)
            assert same_bits(client.submit(**query).result(), expected)
            assert np.array_equal(client.distances(**query).pairs, expected.pairs)
        slopes = {**queries[2], "fields": ["default", "gradient_joints", "normal"]}
        if kind == "lcm":
            with pytest.raises(clearance.QueryError, match="reply_t has no column gradient_joints"):
                client.distances(**slopes)
        else:
            expected = engine.distances(**slopes)
            assert expected.gradient_joints.shape == (expected.total, 2) and expected.total > 10
            assert same_bits(client.distances(**slopes), expected)
            del slopes["configurations"]
            assert same_bits(client.prepare("distances", copy=False, **slopes).run(rows[:, :2]), expected)
        bounds = client.distances(joints=arm, configurations=rows, fields="bounds")
        assert same_bits(bounds, engine.distances(joints=arm, configurations=rows, fields="bounds"))
        pairs = [("table", "arm/palm"), ("cup", "arm/fore"), ("cup", "arm/palm"), ("arm/base", "arm/palm")]
        requested = (rows, arm, np.linspace(0.1, 1, len(arm)), {("arm", "*"): 0.01, ("arm", "cup"): 0.0}, pairs)
        scales = client.free_scale(*requested)
        assert np.array_equal(scales, engine.free_scale(*requested)) and 0 < (scales > 0).sum() < len(rows)
        assert np.array_equal(client.free_scale(rows, arm), engine.free_scale(rows, arm)), "weights are 1"
        with pytest.raises(clearance.QueryError, match="weights: expected 8 numbers, one for each joint, got 2"):
            client.free_scale(rows, arm, [1, 2])
        with pytest.raises(
            clearance.QueryError, match=r"free_scale: weights\[7\]: expected a finite number >= 0, got nan"
        ):
            client.free_scale(rows, arm, [0] * 7 + [math.nan])
        with pytest.raises(ValueError, match="joints: expected some, that move"):
            client.free_scale(rows, None)
        with pytest.raises(clearance.QueryError, match="'arm/joint3' is named twice"):
            client._send_joints(np.array([2, 2], np.uint32), np.zeros(2), 0, 0, None)
        with pytest.raises(clearance.QueryError, match="'arm/fore' is a link placed by joints"):
            client.set_poses({"arm/fore": at(0)})


HOME = [0.0, 0, 0, -1.5, 0, 0, 0, 0]
DEGREES = [0.0, -45, 0, -135, 0, 90, 45, 0]


@pytest.fixture(params=["engine", "shm"])
def one(request, engine, arm_daemon, kinds):
    """An engine, and a client of a daemon of the same scene."""
    if request.param == "engine":
        yield engine
    elif kinds[request.param]:
        pytest.skip(kinds[request.param])
    else:
        with clearance.connect(arm_daemon.urls["shm"], timeout_s=PATIENCE_S) as client:
            client.set_joints(HOME, joints="arm")
            yield client


def test_a_check_says_which_joints_are_beyond_their_limits(one):
    pairs = [("cup", "table")]  # free for all positions of the arm
    rows = np.array([HOME, HOME, HOME, HOME])
    rows[1, 7], rows[3, 0], rows[3, 1] = 0.05, -3.0, math.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check = one.check(rows, joints="arm", pairs=pairs)
        within = one.check(rows[[0, 2]], joints="arm", pairs=pairs)
    assert check.free.tolist() == [True] * 4, "of distances alone"
    assert check.beyond_limits.tolist() == [False, True, False, True]
    assert check.ok.tolist() == [True, False, True, False] and not check
    first, second = check.limit_violations
    assert first == clearance.LimitViolation(1, "arm/grip", 0.05, 0.0, 0.04) and first.excess == 0.05 - 0.04
    assert (second.configuration, second.joint, second.excess) == (3, "arm/joint1", 3.0 - 2.9)
    assert repr(check) == (
        "<clearance.Check: 4 of 4 free, 2 beyond joint limits (arm/grip at 0.05 is 0.01 beyond its limits, 0 to 0.04)>"
    )
    assert within and within.ok.all() and not within.beyond_limits.any() and within.limit_violations == ()
    assert repr(within) == "<clearance.Check: 2 of 2 free>"
    rows[1] = HOME  # earlier answers stay
    assert check.limit_violations[0].position == 0.05
    edge = one.check([[2.9, *HOME[1:]], [-2.9, *HOME[1:]]], joints=list(one.joints("arm").names), pairs=pairs)
    assert edge.ok.all(), "at the limit is within"
    assert not one.check([[3.0]], joints=["arm/joint1"], pairs=pairs).ok.any()
    assert not one.check([[3.0]], joints=one.joints([0]), pairs=pairs)
    touching = one.check([HOME], joints="arm", pairs=pairs, margin=9.0)
    assert not touching and not touching.ok.any() and not touching.beyond_limits.any()


def test_degrees_given_as_radians_get_a_hint(one):
    pairs = [("cup", "table")]
    match = r"arm/joint2 at -45 is 43.24 beyond its limits, -1.76 to 1.76; in degrees they would be within"
    with pytest.warns(clearance.JointLimitWarning, match="configurations: " + match) as caught:
        check = one.check([DEGREES, DEGREES], joints="arm", pairs=pairs)
    assert len(caught) == 1 and caught[0].filename == __file__
    assert check.free.all() and not check and "2 beyond joint limits (arm/joint2 at -45" in repr(check)
    with pytest.warns(clearance.JointLimitWarning, match="path: " + match) as caught:
        one.check_path([HOME, DEGREES], joints="arm", pairs=pairs)
    assert len(caught) == 1 and caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for row in (
            [*HOME[:7], 2.0],
            [0, 8.0, 0, 90.0, 0, 200.0, 0, 0],
            [6.0, *HOME[1:]],
        ):  # as degrees beyond, too, or small
            assert not one.check([row], joints="arm", pairs=pairs)
    with pytest.warns(clearance.JointLimitWarning, match="positions: " + match) as caught:
        one.set_joints(DEGREES, joints="arm")
    assert len(caught) == 1 and caught[0].filename == __file__
    with pytest.warns(clearance.JointLimitWarning, match="joints: " + match):
        now = one.check(pairs=pairs)
    assert now.free.all() and not now and now.limit_violations[0].joint == "arm/joint2"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not one.check(pairs=pairs), "known, and not said again"
        one.set_joints(HOME, joints="arm")
        assert one.check(pairs=pairs), "the joints are where they are now"
        one.set_joints({"arm/grip": 0.041})
        assert [v.joint for v in one.check(pairs=pairs).limit_violations] == ["arm/grip"]
        assert one.check([[at(0.4, 0.3, 0.5)]], bodies=["cup"], pairs=pairs), "joints that a query does not name"


def test_a_path_says_where_joints_leave_their_limits(one):
    pairs = [("cup", "table")]
    there = [*HOME[:7], 0.05]
    path = one.check_path([HOME, there, [3.0, *there[1:]], HOME], joints="arm", pairs=pairs)
    assert path.free and path.beyond_limits and not path.ok and not path
    assert [(v.configuration, v.joint) for v in path.limit_violations] == [(2, "arm/joint1"), (1, "arm/grip")]
    assert "beyond its" not in str(path) and "limit_violations=(LimitViolation(configuration=2" in repr(path)
    good = one.check_path([HOME, [*HOME[:7], 0.04]], joints="arm", pairs=pairs)
    assert good and good.ok and not good.beyond_limits and good.limit_violations == ()
    for before in (1, 2, 8, 20):  # waypoints behind the first motion, where the search ends, in one query or in several
        hit = one.check_path([*[HOME] * before, there], joints="arm", pairs=pairs, margin=9.0)
        assert not hit.free and not hit and hit.index == 0
        assert [(v.configuration, v.joint) for v in hit.limit_violations] == [(before, "arm/grip")]
    assert one.check_path([[at(0.4, 0.3, 0.5)], [at(0.4, 0.3, 0.6)]], bodies=["cup"], pairs=pairs)


def test_joints_without_limits_are_never_beyond_them(tmp_path):
    link = '<link name="{}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    joint = '<joint name="{0}" type="{1}"><parent link="base"/><child link="{0}"/><axis xyz="0 0 1"/>{2}</joint>'
    limit = '<limit lower="-1" upper="1"/>'
    parts = [link.format(name) for name in ("base", "turn", "slide", "follow", "roam")]
    parts += [joint.format("turn", "continuous", ""), joint.format("slide", "prismatic", limit)]
    parts += [joint.format("follow", "prismatic", limit + '<mimic joint="slide" multiplier="3"/>')]
    parts += [joint.format("roam", "planar", "")]
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{"".join(parts)}</robot>')
    scene = clearance.Scene()
    scene.add_robot("r", str(tmp_path / "r.urdf"), home={})
    engine = clearance.Engine(scene, threads=1, covers="off")
    joints = engine.joints("r")
    assert joints.names == ("r/turn", "r/slide", "r/roam/x", "r/roam/y", "r/roam/theta")
    rows = [[1000.0, 0.9, 500, -500, 300], [-90.0, -1.5, 0, 0, 0]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check = engine.check(rows, joints=joints)
    assert check.beyond_limits.tolist() == [False, True], "a mimic joint has no position of its own"
    assert [(v.configuration, v.joint, v.excess) for v in check.limit_violations] == [(1, "r/slide", 0.5)]
