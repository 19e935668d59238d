"""Queries on an engine in this process."""

import gc

import numpy as np
import pytest
from scenes import (ARM_PAIRS, ARM_POSES, IDENTITY, arm, at, hull_distance,
                    placed, random_hulls, random_poses, sphere_gap_bounds_hold, same)  # fmt: skip

import clearance
from clearance import Flag, Status


# ---- answers --------------------------------------------------------------------------------------------------------


def test_shapes_dtypes_and_what_is_known(engine):
    r = engine.distances()
    assert r.distance.shape == r.lower.shape == r.upper.shape == r.status.shape == (1, 7)
    assert r.distance.dtype == np.float64 and r.status.dtype == np.uint8
    assert r.point_a.shape == r.point_b.shape == r.normal.shape == (1, 7, 3)
    assert (r.status == Status.OK).all() and (r.lower > 0).all() and (r.lower <= r.upper).all()
    assert np.allclose(np.linalg.norm(r.point_b - r.point_a, axis=-1), r.upper, rtol=1e-9)
    assert np.allclose(np.linalg.norm(r.normal, axis=-1), 1)
    assert r.pairs.tolist() == ARM_PAIRS == engine.pairs.tolist()
    assert r.configuration.tolist() == [0] and r.configurations == 1 and r.total == 7
    assert r.backend == engine.backend == "cpu"
    assert r.snapshot_revision == engine.pose_revision > 0
    assert r.scene_revision == engine.scene_revision != 0
    assert r.reduce == "none" and r.engine_ns > 0
    assert repr(r).startswith("<clearance.Result none (1, 7): distance, lower, upper, status")
    assert r.distance is r.distance, "made once"


def test_columns_own_their_memory(engine):
    r = engine.distances()
    distance = r.distance
    before = distance.copy()
    del r
    gc.collect()
    engine.distances()
    assert np.array_equal(distance, before)
    distance[:] = 0  # writable


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_spheres_against_exact_arithmetic(backend):
    rng = np.random.default_rng(11)
    scene = clearance.Scene()
    radii = rng.uniform(0.01, 0.3, 60)
    for i, radius in enumerate(radii):
        scene.add_sphere(f"ball{i}", radius)
    engine = clearance.Engine(scene, backend=backend)
    scales = 10.0 ** rng.uniform(-1, 3, (60, 1))
    poses = random_poses(rng, 60, 1.0)
    poses[:, :3] *= scales
    engine.set_poses(poses)
    r = engine.distances(fields=("default", "points"))
    apart = 0
    for (a, b), lower, upper, status in zip(r.pairs, r.lower[0], r.upper[0], r.status[0]):
        if status == Status.OK:
            apart += 1
            assert sphere_gap_bounds_hold(lower, upper, poses[a, :3], radii[a], poses[b, :3], radii[b])
            assert upper - lower <= 1e-6 * upper
    assert apart > 1500


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_polytopes_against_an_independent_judge(backend):
    scene, poses = random_hulls(14, seed=5)
    engine = clearance.Engine(scene, backend=backend)
    engine.set_poses(poses)
    r = engine.distances(fields=("default", "points", "normal"))
    apart = overlapping = 0
    for (a, b), lower, upper, status, n in zip(r.pairs, r.lower[0], r.upper[0], r.status[0], r.normal[0]):
        (va, ra), (vb, rb) = scene.pieces(int(a))[0], scene.pieces(int(b))[0]
        wa, wb = placed(va, poses[a]), placed(vb, poses[b])
        lo, hi = hull_distance(wa, ra, wb, rb)
        if status == Status.OK:
            apart += 1
            assert lower <= hi + 1e-12 and lo - 1e-12 <= upper, (a, b)
            assert hi - lo < 1e-9 and upper - lower <= 1e-6 * upper
            gap = (wb @ n).min() - (wa @ n).max() - ra - rb
            assert gap >= lower - 1e-12, "the normal proves lower"
        else:
            overlapping += 1
            assert status == Status.OVERLAP and lo < 1e-12
    assert apart > 40 and overlapping >= 1


def test_pairs_by_id_name_and_group(engine):
    everything = engine.distances()
    rows = {tuple(pair): i for i, pair in enumerate(ARM_PAIRS)}

    def check(pairs, expected):
        r = engine.distances(pairs=pairs)
        assert r.pairs.tolist() == expected
        assert r.lower.tolist() == [[everything.lower[0, rows[tuple(pair)]] for pair in expected]]

    check([[1, 2], [0, 3]], [[1, 2], [0, 3]])
    check(np.array([[1, 2], [0, 3]], dtype=np.int64), [[1, 2], [0, 3]])
    check(np.array([[3, 4]], dtype=np.uint32), [[3, 4]])
    check([("link1", "link2"), ("base", "cup")], [[1, 2], [0, 3]])
    check([("link1", 2)], [[1, 2]])
    check(("link1", "link2"), [[1, 2]])
    check((1, 2), [[1, 2]])
    check([1, np.uint8(2)], [[1, 2]])
    check(("arm", "*"), ARM_PAIRS)
    check(("arm", "arm"), [[1, 2], [1, 3]])
    check(("cup", "*"), [[0, 3], [1, 3], [3, 4]])
    check([("link1", "link2"), ("cup", "*")], [[1, 2], [0, 3], [1, 3], [3, 4]])
    assert engine.pair_table(("cup", "*")).tolist() == [[0, 3], [1, 3], [3, 4]]


def test_pairs_beyond_the_enabled_ones_and_none_at_all(engine):
    assert engine.distances(pairs=("base", "table")).upper[0, 0] == pytest.approx(0.35)
    for pairs in ([], np.zeros((0, 2), np.uint32), np.zeros((0, 2), np.int64)):
        r = engine.distances(pairs=pairs)
        assert r.distance.shape == (1, 0) and r.point_a.shape == (1, 0, 3) and r.pairs.shape == (0, 2)


def test_result_pairs_do_not_follow_the_callers_array(engine):
    pairs = np.array([[1, 2]], dtype=np.uint32)
    r = engine.distances(pairs=pairs)
    pairs[:] = 0
    assert r.pairs.tolist() == [[1, 2]]


def test_configurations_equal_poses_bit_for_bit(engine):
    rng = np.random.default_rng(2)
    configurations = random_poses(rng, 10, 1.0).reshape(5, 2, 7)
    r = engine.distances(configurations=configurations, bodies=["link1", "link2"])
    assert r.lower.shape == (5, 7) and r.point_a.shape == (5, 7, 3) and r.configurations == 5
    assert r.configuration.tolist() == [0, 1, 2, 3, 4]
    assert same(r, engine.distances(configurations=configurations, bodies=[1, 2]))
    assert same(r, engine.distances(configurations=configurations, bodies=np.array([1, 2])))
    assert engine.distances().snapshot_revision == r.snapshot_revision, "configurations leave the poses alone"
    for k in range(5):
        engine.set_poses(configurations[k], bodies=["link1", "link2"])
        one = engine.distances()
        for name in r.columns:
            assert np.array_equal(one.columns[name][0], r.columns[name][k]), name


def test_configurations_answer_pairs_of_moved_bodies_and_their_followers(engine):
    r = engine.distances(configurations=np.array([[at(1, 1, 1)]]), bodies=["link2"])
    assert r.pairs.tolist() == [[0, 2], [0, 3], [1, 2], [1, 3], [2, 4], [3, 4]], "all but link1-table"
    movable = engine.distances(configurations=np.tile(IDENTITY, (2, 3, 1)))
    assert movable.lower.shape == (2, 7), "bodies=None: link1, link2 and cup"


def test_matrices_are_poses(engine):
    pose = np.array(ARM_POSES["link2"])
    matrix = np.eye(4)
    from scenes import rotation

    matrix[:3, :3], matrix[:3, 3] = rotation(pose), pose[:3]
    expected = engine.distances()
    moved = engine.distances(configurations=matrix[None, None], bodies=["link2"])
    both = [ARM_PAIRS.index(pair) for pair in moved.pairs.tolist()]
    assert np.allclose(moved.upper[0], expected.upper[0, both], rtol=1e-12)
    engine.set_poses({"link2": matrix, 1: at(0, 0, 0.4)})
    assert np.allclose(engine.distances().upper, expected.upper, rtol=1e-12)
    engine.set_poses(matrix[None], bodies=["link2"])
    assert np.allclose(engine.distances().upper, expected.upper, rtol=1e-12)


# ---- reductions -----------------------------------------------------------------------------------------------------


def test_within(crowd):
    engine, configurations = crowd
    dense = engine.distances(configurations=configurations)
    r = engine.distances(configurations=configurations, reduce="within", max_distance=0.4)
    expected = [(k, *dense.pairs[p]) for k, p in np.argwhere(dense.lower <= 0.4)]
    assert 10 < len(expected) < 600 and r.total == len(expected)
    assert [(k, *pair) for k, pair in zip(r.configuration, r.pairs)] == expected
    assert r.lower.shape == r.status.shape == (len(expected),) and r.point_a.shape == (len(expected), 3)
    assert r.pairs.shape == (len(expected), 2) and r.configuration.dtype == np.uint32
    few = engine.distances(configurations=configurations, reduce="within", max_distance=0.4, max_results=7)
    assert few.lower.shape == (7,) and few.total == len(expected)
    assert same(few, engine.distances(configurations=configurations, reduce="within", max_distance=0.4, max_results=7))
    assert few.pairs.tolist() == r.pairs[:7].tolist()


def test_nearest(crowd):
    engine, configurations = crowd
    dense = engine.distances(configurations=configurations)
    r = engine.distances(configurations=configurations, reduce="nearest")
    assert r.upper.shape == (3, 40) and r.pairs.shape == (3, 40, 2) and r.normal.shape == (3, 40, 3)
    assert r.neighbours.shape == (3, 40)
    for k in range(3):
        for body in range(40):
            mine = (dense.pairs == body).any(axis=1)
            assert r.upper[k, body] == dense.upper[k, mine].min()
            assert r.lower[k, body] <= dense.lower[k, mine].min()
            assert body in r.pairs[k, body]
            assert {body, r.neighbours[k, body]} == set(r.pairs[k, body])


def test_min(crowd):
    engine, configurations = crowd
    dense = engine.distances(configurations=configurations)
    r = engine.distances(configurations=configurations, reduce="min")
    assert r.upper.shape == (3,) and r.pairs.shape == (3, 2) and r.point_a.shape == (3, 3)
    assert r.upper.tolist() == dense.upper.min(axis=1).tolist()
    assert r.pairs.tolist() == dense.pairs[dense.upper.argmin(axis=1)].tolist()
    with pytest.raises(AttributeError, match="neighbours: only for reduce='nearest'"):
        r.neighbours


def test_max_distance(crowd):
    engine, _ = crowd
    r = engine.distances(max_distance=0.5)
    beyond = r.status == Status.BEYOND
    assert 0 < beyond.sum() < beyond.size
    assert (r.lower[beyond] > 0.5).all() and (r.distance[beyond] == r.lower[beyond]).all()
    assert np.isnan(r.point_a[beyond]).all()


# ---- columns --------------------------------------------------------------------------------------------------------


def test_fields(engine):
    r = engine.distances(fields=("default", "points", "normal", "pieces", "flags", "gradient", "pair"))
    assert list(r.columns) == ["distance", "lower", "upper", "status", "flags", "point_a", "point_b", "normal", "pieces",
                               "gradient", "pair"]  # fmt: skip
    assert r.flags.dtype == np.uint16 and r.flags.shape == (1, 7)
    assert r.pieces.dtype == np.uint32 and r.pieces.shape == (1, 7, 2) and (r.pieces == 0).all()
    assert r.gradient.shape == (1, 7, 2, 6) and r.pair.shape == (1, 7, 2) and r.pair[0].tolist() == ARM_PAIRS
    only = engine.distances(fields="upper")
    assert list(only.columns) == ["upper"] and np.array_equal(only.upper, r.upper)
    with pytest.raises(AttributeError, match="the column 'normal' was not asked for; fields were: upper"):
        only.normal
    assert not hasattr(only, "lower")
    assert same(engine.distances(fields=int(clearance.Field.UPPER | clearance.Field.LOWER)), r)


def test_gradient_is_the_change_of_distance(engine):
    r = engine.distances(pairs=("link1", "link2"), fields=("distance", "gradient"))
    step = 1e-6
    for axis in range(3):
        moved = np.array(ARM_POSES["link2"])
        moved[axis] += step
        changed = engine.distances(pairs=("link1", "link2"), configurations=moved[None, None], bodies=["link2"], rel_tol=1e-12)
        slope = (changed.distance[0, 0] - r.distance[0, 0]) / step
        assert slope == pytest.approx(r.gradient[0, 0, 1, 3 + axis], abs=1e-3)


def test_points_come_by_default_for_few_rows_only():
    scene = clearance.Scene()
    for i in range(25):
        scene.add_sphere(f"s{i}", 0.1, pose=at(i))
    engine = clearance.Engine(scene)
    k = 100000 // 300
    configurations = np.tile(IDENTITY, (k, 25, 1))
    assert "point_a" in engine.distances(configurations=configurations).columns
    more = np.tile(IDENTITY, (k + 1, 25, 1))
    assert len(engine.pairs) * (k + 1) > 100000
    assert list(engine.distances(configurations=more).columns) == ["distance", "lower", "upper", "status"]
    assert "normal" in engine.distances(configurations=more, reduce="min").columns
    assert "point_a" in engine.distances(configurations=more, fields=["points", "lower"]).columns


def test_compact(engine):
    full = engine.distances()
    r = engine.distances(format="compact")
    assert r.compact.dtype.itemsize == 32 and r.compact.shape == (1, 7)
    assert r.lower.dtype == np.float32 and r.point_a.shape == (1, 7, 3)
    assert (r.lower.astype(np.float64) <= full.lower).all() and (r.upper.astype(np.float64) >= full.upper).all()
    assert np.allclose(r.lower, full.lower, rtol=1e-6)
    assert np.array_equal(r.status, full.status)
    states = engine.body_states()
    origins = np.array([states[a].pose[:3] for a, b in r.pairs])
    assert np.allclose(origins + r.point_a[0], full.point_a[0], atol=1e-6)
    with pytest.raises(AttributeError, match="'distance' was not asked for"):
        r.distance


# ---- out= -----------------------------------------------------------------------------------------------------------


def empty_columns(shape, names=("lower", "upper", "status", "point_a", "gradient")):
    from clearance._words import COLUMNS

    return {name: np.empty(shape + COLUMNS[name].shape, COLUMNS[name].dtype) for name in names}


def test_out_dict_is_written_in_place(engine):
    out = empty_columns((1, 7))
    addresses = {name: array.ctypes.data for name, array in out.items()}
    r = engine.distances(out=out)
    assert r.lower is out["lower"] and r.gradient is out["gradient"]
    assert {name: array.ctypes.data for name, array in r.columns.items()} == addresses
    assert same(r, engine.distances(fields=list(out)))
    assert same(engine.distances(out=out, fields=("gradient", "lower", "upper", "status", "point_a")), r)


def test_out_result_is_written_over(engine):
    first = engine.distances(fields=("lower", "status"))
    lower, address = first.lower, first.lower.ctypes.data
    before = lower.copy()
    engine.set_poses({"link2": at(0.9, 0, 0.9)})
    second = engine.distances(out=first)
    assert second.lower.ctypes.data == address and list(second.columns) == ["lower", "status"]
    assert not np.array_equal(lower, before), "the old arrays show the new answer"
    assert same(second, engine.distances(fields=("lower", "status")))
    third = engine.distances(out=second)
    assert third.lower.ctypes.data == address


def test_out_within_needs_room_and_shows_what_was_found(crowd):
    engine, _ = crowd
    expected = engine.distances(reduce="within", max_distance=0.4)
    assert 0 < expected.total < 400
    out = empty_columns((400,), ("lower", "pair", "configuration"))
    r = engine.distances(reduce="within", max_distance=0.4, max_results=400, out=out)
    assert r.lower.shape == (expected.total,) and r.lower.base is out["lower"]
    assert r.pairs.tolist() == expected.pairs.tolist()
    again = engine.distances(reduce="within", max_distance=0.2, max_results=400, out=r)
    assert again.lower.ctypes.data == out["lower"].ctypes.data and again.total < r.total
    own = engine.distances(reduce="within", max_distance=0.2, max_results=400)
    wider = engine.distances(reduce="within", max_distance=0.4, max_results=400, out=own)
    assert wider.total == expected.total > own.total, "room that the first answer did not need is used"
    lower_only = engine.distances(reduce="within", max_distance=0.4, max_results=400, out=empty_columns((400,), ("lower",)))
    assert lower_only.pairs.tolist() == expected.pairs.tolist(), "pairs come anyway"


@pytest.mark.parametrize("out, error, text", [
    ([], TypeError, r"out: expected a dict of arrays or an earlier result, got list"),
    ({"lwer": np.empty((1, 7))}, ValueError, r"out: no column is named 'lwer'"),
    ({"lower": [0.0] * 7}, TypeError, r"out\['lower'\]: expected a numpy array, got list"),
    ({"lower": np.empty((1, 7), np.float32)}, TypeError, r"out\['lower'\]: expected dtype float64, got float32"),
    ({"status": np.empty((1, 7), np.int8)}, TypeError, r"out\['status'\]: expected dtype uint8, got int8"),
    ({"lower": np.empty((1, 6))}, ValueError, r"out\['lower'\]: expected shape \(1, 7\), got \(1, 6\)"),
    ({"lower": np.empty(7)}, ValueError, r"out\['lower'\]: expected shape \(1, 7\), got \(7,\)"),
    ({"point_a": np.empty((1, 7))}, ValueError, r"out\['point_a'\]: expected shape \(1, 7, 3\), got \(1, 7\)"),
    ({"gradient": np.empty((1, 7, 12))}, ValueError, r"out\['gradient'\]: expected shape \(1, 7, 2, 6\), got \(1, 7, 12\)"),
    ({"lower": np.empty((1, 14))[:, ::2]}, ValueError, r"out\['lower'\]: expected a C-contiguous, aligned array"),
    ({"lower": np.broadcast_to(0.0, (1, 7))}, ValueError, r"out\['lower'\]: (expected a C-contiguous|the array is read-only)"),
    ({}, ValueError, r"fields: expected at least one column"),
])  # fmt: skip
def test_bad_out(engine, out, error, text):
    with pytest.raises(error, match=text):
        engine.distances(out=out)


def test_read_only_out_and_disagreement_with_fields(engine):
    array = np.zeros((1, 7))
    array.flags.writeable = False
    with pytest.raises(ValueError, match=r"out\['lower'\]: the array is read-only"):
        engine.distances(out={"lower": array})
    with pytest.raises(ValueError, match=r"out: no array for the column 'upper', which fields names"):
        engine.distances(out={"lower": np.zeros((1, 7))}, fields=("lower", "upper"))
    with pytest.raises(ValueError, match=r"out: holds 'lower', which fields does not name"):
        engine.distances(out={"lower": np.zeros((1, 7)), "upper": np.zeros((1, 7))}, fields="upper")
    both = np.zeros((2, 1, 7))
    engine.distances(out={"lower": both[0], "upper": both[1]})
    with pytest.raises(ValueError, match=r"out\['lower'\] and out\['upper'\] share memory"):
        engine.distances(out={"lower": both[0], "upper": both[0]})
    with pytest.raises(ValueError, match=r"copy: out= is a copy"):
        engine.distances(out={"lower": np.zeros((1, 7))}, copy=False)
    with pytest.raises(ValueError, match=r"expected shape \(40,\) or more rows, got \(39,\)"):
        engine.distances(out={"lower": np.zeros(39)}, reduce="within", max_distance=9, configurations=np.tile(
            IDENTITY, (9, 3, 1)), max_results=40)  # fmt: skip


# ---- statuses are not exceptions ------------------------------------------------------------------------------------


def test_missing_and_bad_poses_are_statuses():
    engine = clearance.Engine(arm())
    r = engine.distances(fields=("default", "points", "flags"))
    no_pose = r.status == Status.NO_POSE
    assert no_pose.all() and np.isnan(r.distance).all() and np.isneginf(r.lower).all() and np.isposinf(r.upper).all()
    done = engine.set_poses({"link1": at(0, 0, 0.4), "link2": [np.nan] * 7})
    assert (done.applied, done.bad, done.unknown, done.fixed) == (2, 1, 0, 0) or (done.applied, done.bad) == (1, 1)
    r = engine.distances()
    by_pair = {tuple(pair): Status(s) for pair, s in zip(r.pairs.tolist(), r.status[0])}
    assert by_pair[1, 2] == by_pair[2, 4] == Status.BAD_POSE
    assert by_pair[1, 4] == Status.OK, "the rest of the batch is answered"
    assert engine.body_states()[2].status == Status.BAD_POSE
    for bad in ([0, 0, 0, 0, 0, 0, 0], [np.inf, 0, 0, 1, 0, 0, 0], np.full((4, 4), np.nan)):
        engine.set_poses({"link2": bad})
        assert engine.distances(pairs=("link1", "link2")).status[0, 0] == Status.BAD_POSE
    r = engine.distances(reduce="min", fields=("default", "flags"))
    assert r.flags[0] & Flag.INCOMPLETE


def test_bad_configuration_is_a_status_of_its_rows(engine):
    configurations = np.tile(at(1, 1, 1), (3, 1, 1))
    configurations[1, 0, 3:] = 0
    r = engine.distances(configurations=configurations, bodies=["link2"])
    assert (r.status[1] == Status.BAD_POSE).sum() == 6 and (r.status[[0, 2]] == Status.OK).all()


def test_unknown_ids_are_statuses(engine):
    r = engine.distances(pairs=[[1, 77], [1, 2]])
    assert r.status.tolist() == [[Status.UNKNOWN_BODY, Status.OK]] and np.isnan(r.distance[0, 0])
    done = engine.set_poses({99: IDENTITY, "base": IDENTITY, "link1": IDENTITY})
    assert (done.applied, done.unknown, done.fixed) == (1, 1, 1)


def test_renormalised_and_stale_are_flags(engine):
    engine.set_poses({"link1": at(0, 0, 0.4, (2, 0, 0, 0))}, stamp_ns=12)
    r = engine.distances(fields=("lower", "flags"), max_pose_age_ns=1)
    has_link1 = (r.pairs == 1).any(axis=1)
    assert (r.flags[0, has_link1] & Flag.RENORMALISED).all() and not (r.flags[0, ~has_link1] & Flag.RENORMALISED).any()
    assert (r.flags & Flag.STALE).all()
    assert not (engine.distances(fields=("lower", "flags")).flags & Flag.STALE).any()
    assert r.snapshot_stamp_ns == 12 and engine.body_states()[1].stamp_ns == 12


# ---- exceptions -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments, error, text", [
    ({"pairs": [[1, 2, 3]]}, ValueError, r"pairs\[0\]: expected two bodies or groups, got \[1, 2, 3\]"),
    ({"pairs": np.zeros((2, 3), int)}, ValueError, r"pairs: expected shape \(P, 2\), got \(2, 3\)"),
    ({"pairs": np.array([[0, -1]])}, ValueError, r"pairs: an id is 0 to 4294967295, got -1"),
    ({"pairs": np.array([[0, 1 << 33]])}, ValueError, r"pairs: an id is 0 to 4294967295, got 8589934592"),
    ({"pairs": np.zeros((2, 2))}, TypeError, r"pairs\[0\]\[0\]: expected a name or an id, got .*0\.0"),
    ({"pairs": 7}, TypeError, r"pairs: expected \(P, 2\) ids, a list of name pairs or one pair, got 7"),
    ({"pairs": "arm"}, TypeError, r"pairs: expected \(P, 2\) ids"),
    ({"pairs": [("link1", True)]}, TypeError, r"pairs\[0\]\[1\]: expected a name or an id, got True"),
    ({"pairs": ("lnk1", "*")}, ValueError, r"pairs\[0\]\[0\]: no body or group is named 'lnk1'; did you mean 'link1'"),
    ({"pairs": ("zzzz", "*")}, ValueError, r"no body or group is named 'zzzz'; the scene has 'arm', 'base'|the scene has "),
    ({"pairs": [(1, 1)]}, clearance.QueryError, r"pairs\[0\]: body 1 with itself"),
    ({"configurations": np.zeros((2, 7)), "bodies": ["link1", "link2"]}, ValueError, r"configurations: expected shape \(K, M, 7\) or \(K, M, 4, 4\), got \(2, 7\)"),
    ({"configurations": np.zeros((2, 1, 7)), "bodies": ["link1", "link2"]}, ValueError, r"configurations: expected M = 2 poses each \(bodies\), got shape \(2, 1, 7\)"),
    ({"configurations": np.zeros((2, 1, 7))}, ValueError, r"configurations: expected M = 3 poses each \(every movable body\), got shape \(2, 1, 7\)"),
    ({"configurations": np.zeros((0, 1, 7)), "bodies": ["link1"]}, ValueError, r"configurations: expected at least one, got shape \(0, 1, 7\)"),
    ({"configurations": np.zeros((1, 0, 7)), "bodies": []}, ValueError, r"bodies: expected at least one"),
    ({"configurations": np.zeros((1, 1, 6)), "bodies": ["link1"]}, ValueError, r"configurations: expected poses of 7 numbers"),
    ({"configurations": "abc", "bodies": ["link1"]}, TypeError, r"configurations: expected numbers"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": "link1"}, TypeError, r"bodies: expected a list of names or ids, got 'link1'"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["lnik1"]}, ValueError, r"bodies\[0\]: no body is named 'lnik1'; did you mean 'link1'"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["arm"]}, ValueError, r"bodies\[0\]: 'arm' is a group; expected a body"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["base"]}, clearance.QueryError, r"bodies\[0\]: 'base' is static and cannot be moved"),
    ({"configurations": np.zeros((1, 2, 7)), "bodies": [1, 1]}, clearance.QueryError, r"bodies\[1\]: 'link1' is named twice"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": [55]}, clearance.QueryError, r"bodies\[0\]: unknown body 55"),
    ({"bodies": ["link1"]}, ValueError, r"bodies: only together with configurations"),
    ({"max_distance": "1"}, TypeError, r"max_distance: expected a number, got '1'"),
    ({"max_distance": np.nan}, ValueError, r"max_distance: expected a number, got nan"),
    ({"max_distance": -1}, clearance.QueryError, r"max_distance: expected metres >= 0, got -1"),
    ({"abs_tol": None}, TypeError, r"abs_tol: expected a number, got None"),
    ({"abs_tol": -1e-3}, clearance.QueryError, r"abs_tol"),
    ({"rel_tol": -1}, ValueError, r"rel_tol: expected a number >= 0 or None, got -1"),
    ({"rel_tol": 2}, clearance.QueryError, r"rel_tol: expected a ratio below 1, got 2"),
    ({"precision": "f16"}, ValueError, r"precision: expected 'f64' or 'f32', got 'f16'"),
    ({"reduce": "max"}, ValueError, r"reduce: expected 'none' or 'within' or 'nearest' or 'min', got 'max'"),
    ({"reduce": None}, ValueError, r"reduce: expected 'none' or"),
    ({"format": "json"}, ValueError, r"format: expected 'full' or 'compact', got 'json'"),
    ({"fields": "distnce"}, ValueError, r"fields: no column is named 'distnce'; there are distance, lower"),
    ({"fields": ["lower", 3]}, ValueError, r"fields: no column is named 3"),
    ({"fields": []}, ValueError, r"fields: expected at least one column"),
    ({"fields": 3.5}, TypeError, r"fields: expected column names, got 3\.5"),
    ({"fields": 1 << 20}, ValueError, r"fields: unknown bits in 0x100000"),
    ({"timeout_s": -1}, ValueError, r"timeout_s: expected a number >= 0, got -1"),
    ({"timeout_s": "soon"}, TypeError, r"timeout_s: expected a number, got 'soon'"),
    ({"max_results": -1}, ValueError, r"max_results: expected an integer >= 0, got -1"),
    ({"max_results": 1.5}, TypeError, r"max_results: expected an integer, got 1\.5"),
    ({"max_pose_age_ns": -1}, ValueError, r"max_pose_age_ns: expected an integer >= 0, got -1"),
    ({"radius": 1}, TypeError, r"radius"),
])  # fmt: skip
def test_bad_queries_are_named(engine, arguments, error, text):
    with pytest.raises(error, match=text):
        engine.distances(**arguments)
    with pytest.raises(error, match=text):
        engine.submit(**arguments)
    assert (engine.distances().status == Status.OK).all(), "and the engine goes on"


@pytest.mark.parametrize("arguments, error, text", [
    (({"lnk1": IDENTITY},), ValueError, r"poses: no body is named 'lnk1'; did you mean 'link1'"),
    (({"link1": [0, 0, 0]},), ValueError, r"poses\['link1'\]: expected poses of 7 numbers .* got shape \(3,\)"),
    (({"link1": IDENTITY, "link2": [0, 0]},), ValueError, r"poses\['link2'\]: expected poses of 7 numbers"),
    (({"link1": "here"},), TypeError, r"poses\['link1'\]: expected numbers"),
    (({"link1": np.zeros((2, 7))},), ValueError, r"poses\['link1'\]: expected one pose, got shape \(2, 7\)"),
    (({"link1": 2 * np.eye(4)},), ValueError, r"poses\['link1'\]: not a rigid transform"),
    (({1.5: IDENTITY},), TypeError, r"poses: expected a body's name or id, got 1\.5"),
    ((np.zeros((2, 7)), ["link1"]), ValueError, r"poses: expected one pose for each of 1 bodies, got shape \(2, 7\)"),
    ((np.zeros(7),), ValueError, r"poses: expected one pose for each of 3 bodies, got shape \(7,\)"),
    (({}, ["link1"]), TypeError, r"bodies: only with an array of poses, not with a dict"),
    (({"link1": IDENTITY}, None, 1.5), TypeError, r"stamp_ns: expected an integer, got 1\.5"),
    ((None,), TypeError, r"poses: expected numbers"),
])  # fmt: skip
def test_bad_poses_are_named(engine, arguments, error, text):
    revision = engine.pose_revision
    with pytest.raises(error, match=text):
        engine.set_poses(*arguments)
    assert engine.pose_revision == revision, "nothing was applied"


def test_empty_update(engine):
    assert engine.set_poses({}).applied == 0


@pytest.mark.parametrize("arguments, error, text", [
    ({"scene": None}, TypeError, r"scene: expected a clearance.Scene, got NoneType"),
    ({"backend": "gpu"}, ValueError, r"backend: expected auto, cpu, cuda or reference, got 'gpu'"),
    ({"backend": 3}, TypeError, r"backend: expected a name, got 3"),
    ({"threads": -1}, ValueError, r"threads: expected 0 \(all cores\) or more, got -1"),
    ({"threads": 1.5}, TypeError, r"threads: expected an integer, got 1\.5"),
    ({"backend": "cpu", "devices": [0]}, ValueError, r"devices: backend 'cpu' uses none"),
    ({"devices": [1.5]}, TypeError, r"devices\[0\]: expected an integer, got 1\.5"),
    ({"devices": [0, -1]}, ValueError, r"devices\[1\]: expected an integer >= 0, got -1"),
    ({"devices": [99]}, RuntimeError, r"devices: 99 is not there"),
])  # fmt: skip
def test_bad_engines_are_named(arguments, error, text):
    with pytest.raises(error, match=text):
        clearance.Engine(**{"scene": arm(), **arguments})


def test_an_absent_backend_raises():
    assert "cpu" in clearance.Engine.backends()
    if "cuda" not in clearance.Engine.backends():
        with pytest.raises(RuntimeError, match="backend 'cuda' is not there"):
            clearance.Engine(arm(), backend="cuda")


def test_too_many_rows():
    engine = clearance.Engine(arm(), max_rows=20)
    with pytest.raises(clearance.QueryError, match=r"3 configurations x 7 rows are more than the limit of 20") as info:
        engine.distances(configurations=np.tile(IDENTITY, (3, 3, 1)))
    assert info.value.code == clearance.wire.ErrorCode.TOO_LARGE and isinstance(info.value, ValueError)


def test_errors_can_be_pickled():
    import pickle

    error = pickle.loads(pickle.dumps(clearance.QueryError(3, "too large")))
    assert (error.code, str(error)) == (3, "too large")


# ---- bodies that follow others --------------------------------------------------------------------------------------


def test_attach(engine):
    assert [3, 4] in engine.pairs.tolist() and engine.bodies[3].parent == 2
    before = engine.body_states()[3].pose
    old = engine.distances(pairs=("cup", "*"))
    revision = engine.scene_revision
    done = engine.attach("cup", None)
    assert done.scene_revision == engine.scene_revision != revision
    assert np.allclose(engine.body_states()[3].pose, before) and engine.bodies[3].parent is None
    assert [2, 3] in engine.pairs.tolist() and [1, 3] in engine.pairs.tolist()
    engine.attach("cup", "link1", at(0, 0, 0.5))
    assert [1, 3] not in engine.pairs.tolist() and engine.bodies[3].parent == 1
    assert np.allclose(engine.body_states()[3].pose[:3], [0, 0, 0.9])
    with pytest.raises(clearance.QueryError, match="the scene has changed since this answer"):
        old.pairs
    with pytest.raises(clearance.QueryError):
        engine.attach("link1", "cup")
    with pytest.raises(ValueError, match="parent: no body is named 'link'; did you mean"):
        engine.attach("cup", "link")
    with pytest.raises(ValueError, match=r"pose: expected one pose, got shape \(2, 7\)"):
        engine.attach("cup", "link1", np.zeros((2, 7)))


def test_bodies_states_and_stats(engine):
    assert [body.name for body in engine.bodies] == ["base", "link1", "link2", "cup", "table"]
    assert engine.body_id("cup") == 3 and engine.groups["arm"].tolist() == [1, 2, 3]
    with pytest.raises(ValueError, match="name: no body is named 'cap'; did you mean 'cup'"):
        engine.body_id("cap")
    states = engine.body_states()
    assert len(states) == 5 and states[1].pose.tolist() == at(0, 0, 0.4)
    assert states[3].parent == 2 and states[1].age_ns >= 0
    stats = engine.stats()
    assert stats["engine.bodies"] == 5 and all(isinstance(value, int) for value in stats.values())
