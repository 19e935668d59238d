"""Queries on an engine in this process."""

import gc

import numpy as np
import pytest

import clearance
from clearance import Status
from scenes import (
    ARM_PAIRS,
    ARM_POSES,
    IDENTITY,
    at,
    hull_distance,
    placed,  # fmt: skip
    random_hulls,
    random_poses,
    same,
    sphere_gap_bounds_hold,
)

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
    engine = clearance.Engine(scene, backend=backend, covers="off")
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
    engine = clearance.Engine(scene, backend=backend, covers="off")
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
    query = engine.prepare("distances", reduce="within", max_distance=0.4, max_results=7)
    few = query.run(configurations)
    assert few.lower.shape == (7,) and few.total == len(expected)
    assert same(few, query.run(configurations))
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
    columns = "distance lower upper status flags point_a point_b normal pieces gradient pair"
    assert list(r.columns) == columns.split()
    assert r.flags.dtype == np.uint16 and r.flags.shape == (1, 7)
    assert r.pieces.dtype == np.uint32 and r.pieces.shape == (1, 7, 2) and (r.pieces == 0).all()
    assert r.gradient.shape == (1, 7, 2, 6) and r.pair.shape == (1, 7, 2) and r.pair[0].tolist() == ARM_PAIRS
    only = engine.distances(fields="upper")
    assert list(only.columns) == ["upper"] and np.array_equal(only.upper, r.upper)
    with pytest.raises(AttributeError, match="the column 'normal' was not requested; fields were: upper"):
        only.normal
    assert not hasattr(only, "lower")
    assert same(engine.distances(fields=int(clearance.Field.UPPER | clearance.Field.LOWER)), r)


def test_gradient_is_the_change_of_distance(engine):
    r = engine.distances(pairs=("link1", "link2"), fields=("distance", "gradient"))
    step = 1e-6
    for axis in range(3):
        moved = np.array(ARM_POSES["link2"])
        moved[axis] += step
        changed = engine.distances(
            pairs=("link1", "link2"), configurations=moved[None, None], bodies=["link2"], rel_tol=1e-12
        )
        slope = (changed.distance[0, 0] - r.distance[0, 0]) / step
        assert slope == pytest.approx(r.gradient[0, 0, 1, 3 + axis], abs=1e-3)


@pytest.mark.parametrize("name, row", [("link1", 0), ("link2", 1)])
def test_the_gradient_is_about_the_bodys_own_origin_turn_first(engine, name, row):
    poses = {
        "link1": [0.2, -0.3, 0.4, *quaternion(0.3, [1, 2, 3])],
        "link2": [0.5, 0.1, 0.9, *quaternion(0.8, [3, -1, 1])],
    }
    engine.set_poses(poses)
    options = dict(pairs=("link1", "link2"), rel_tol=1e-12)
    r = engine.distances(**options, fields=("distance", "gradient", "flags"))
    assert not r.flags[0, 0] & clearance.Flag.NONSMOOTH
    gradient, origin, step = r.gradient[0, 0, row], np.array(poses[name][:3]), 1e-6
    turn_about_the_world_origin = gradient[:3] + np.cross(origin, gradient[3:])
    assert np.abs(turn_about_the_world_origin - gradient[:3]).max() > 0.05, "else this could not tell the two apart"
    for axis in range(6):
        moved = {**poses}
        if axis < 3:
            moved[name] = [*origin, *product(quaternion(step, np.eye(3)[axis]), poses[name][3:])]
        else:
            moved[name] = [*(origin + step * np.eye(3)[axis - 3]), *poses[name][3:]]
        engine.set_poses(moved)
        assert (engine.distances(**options).distance[0, 0] - r.distance[0, 0]) / step == pytest.approx(
            gradient[axis], abs=1e-4
        )


def quaternion(angle, axis):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    return [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]


def product(p, q):
    (a, *u), (b, *v) = p, q
    return [a * b - np.dot(u, v), *(a * np.array(v) + b * np.array(u) + np.cross(u, v))]


def test_points_come_by_default_for_few_rows_only():
    scene = clearance.Scene()
    for i in range(25):
        scene.add_sphere(f"s{i}", 0.1, pose=at(i))
    engine = clearance.Engine(scene, covers="off")
    k = 100000 // 300
    configurations = np.tile(IDENTITY, (k, 25, 1))
    assert "point_a" in engine.distances(configurations=configurations).columns
    more = np.tile(IDENTITY, (k + 1, 25, 1))
    assert len(engine.pairs) * (k + 1) > 100000
    assert list(engine.distances(configurations=more).columns) == ["distance", "lower", "upper", "status"]
    assert "normal" in engine.distances(configurations=more, reduce="min").columns
    assert "point_a" in engine.distances(configurations=more, fields=["points", "lower"]).columns


def test_float32_columns(engine):
    full = engine.distances()
    r = engine.distances(fields=("bounds", "points32"))
    assert r.bounds.shape == (1, 7, 2) and r.points32.shape == (1, 7, 2, 3) and r.points32.dtype == np.float32
    lower, upper = r.bounds[..., 0], r.bounds[..., 1]
    assert (lower.astype(np.float64) <= full.lower).all() and (upper.astype(np.float64) >= full.upper).all()
    assert np.allclose(lower, full.lower, rtol=1e-6)
    origins = np.array([[state.pose[:3] for state in np.array(engine.body_states())[pair]] for pair in r.pairs])
    assert np.allclose(origins + r.points32[0], np.stack((full.point_a[0], full.point_b[0]), axis=1), atol=1e-6)


def test_bounds_are_rounded_outward(engine):
    full = engine.distances()
    r = engine.distances(fields="bounds")
    assert r.bounds.dtype == np.float32 and r.bounds.shape == (1, 7, 2)
    lower, upper = np.moveaxis(r.bounds.astype(np.float64), -1, 0)
    assert (lower <= full.lower).all() and (upper >= full.upper).all()
    assert np.allclose(lower, full.lower, rtol=1e-6) and np.allclose(upper, full.upper, rtol=1e-6)
    with pytest.raises(AttributeError, match="'distance' was not requested"):
        r.distance


def test_memory_of_answers_that_are_gone_is_used_again(engine):
    poses = np.tile(np.array(at(0.3, 0, 0.3)), (4000, 1, 1))

    def evaluate():
        return engine.distances(configurations=poses, bodies=["link2"], fields="default")

    kept = evaluate()
    first, address = kept.lower.copy(), kept.lower.ctypes.data
    assert kept.lower.nbytes * 3 > 128 << 10, "small answers are the heap's business"
    engine.set_poses({"base": at(0, 0.1, 0)})
    assert evaluate().lower.ctypes.data != address, "an answer in use keeps its memory"
    view = kept.lower[1:]
    del kept
    assert evaluate().lower.ctypes.data != address, "so do views of its columns"
    assert np.array_equal(view, first[1:])
    del view
    assert evaluate().lower.ctypes.data == address


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
