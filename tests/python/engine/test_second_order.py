"""Rates, second derivatives and the k nearest pairs: in process and through a daemon."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import clearance
from clearance._words import DEFAULT_POINTS_ROWS
from patience import PATIENCE_S
from robots import arm_scene, rows_of
from scenes import at

FIELDS = ["distance", "lower", "gradient_joints", "hessian_joints", "rate", "curvature", "smooth_radius"]


@pytest.fixture
def engine(arm_engine):
    return arm_engine


def answer(front, rows, velocities=None, twists=None, **options):
    return front.prepare(joints="arm", **options).run(rows, velocities, twists)


def distances(engine, rows, **options):
    return engine.distances(joints="arm", configurations=rows, rel_tol=1e-13, fields="distance", **options).distance


def test_rate_and_curvature_are_differences(engine):
    rows = rows_of(engine.joints("arm"), 20, seed=5)
    v = np.random.default_rng(6).uniform(-1, 1, rows.shape)
    r = answer(engine, rows, v, fields=FIELDS)
    step, pairs = 1e-4, r.pairs
    before, now, after = (distances(engine, rows + s * step * v, pairs=pairs) for s in (-1, 0, 1))
    smooth = (r.smooth_radius > 0.01) & (now > 0.05)
    assert smooth.sum() > 100
    assert np.abs(r.rate - (after - before) / (2 * step))[smooth].max() < 1e-4
    assert np.abs(r.curvature - (after - 2 * now + before) / step**2)[smooth].max() < 1e-4
    assert np.allclose(r.rate, (r.gradient_joints * v[:, None]).sum(-1), atol=1e-2, equal_nan=True)
    product = np.einsum("kpij,ki,kj->kp", r.hessian_joints, v, v)
    assert np.allclose(r.curvature, product, equal_nan=True)
    assert np.array_equal(r.hessian_joints, r.hessian_joints.swapaxes(-1, -2), equal_nan=True)
    assert np.array_equal(r.nonsmooth, ~(r.smooth_radius > 0))
    at_rest = engine.distances(joints="arm", configurations=rows, fields=["rate", "curvature"])
    assert (np.nan_to_num(at_rest.rate) == 0).all() and (np.nan_to_num(at_rest.curvature) == 0).all()


def test_twists_of_bodies_and_of_joints_add_up(engine):
    rows = rows_of(engine.joints("arm"), 1, seed=7)
    poses, twists = np.array([[at(0.4, 0.3, 0.5)]], float), np.array([[[0, 0, 0, 0.3, -0.2, 0.1]]], float)
    v = np.full_like(rows, 0.2)
    options = {"bodies": ["cup"], "joints": "arm", "pairs": ("cup", "arm")}
    fields = ["rate", "curvature", "smooth_radius"]
    r = engine.prepare(fields=fields, **options).run((rows, poses), v, twists)
    step = 1e-4

    def moved(time):
        shifted = poses.copy()
        shifted[..., :3] += time * twists[..., 3:]
        return engine.distances(
            configurations=(rows + time * v, shifted), rel_tol=1e-13, fields="distance", **options
        ).distance

    before, now, after = (moved(s * step) for s in (-1, 0, 1))
    smooth = r.smooth_radius > 0.001
    assert smooth.sum() > 3
    assert np.abs(r.rate - (after - before) / (2 * step))[smooth].max() < 1e-5
    assert np.abs(r.curvature - (after - 2 * now + before) / step**2)[smooth].max() < 1e-4


@pytest.mark.parametrize("k", [1, 5, 1000])
def test_the_k_nearest_pairs_are_the_least_of_all_in_their_order(engine, k):
    rows = rows_of(engine.joints("arm"), 12, seed=8)
    every = engine.distances(joints="arm", configurations=rows, fields=FIELDS)
    count = min(k, len(every.pairs))
    r = answer(engine, rows, reduce="nearest", k=k, fields=FIELDS)
    assert r.distance.shape == (12, count) and r.hessian_joints.shape == (12, count, 8, 8)
    for i in range(12):
        least = np.sort(np.argsort(every.distance[i], kind="stable")[:count])
        assert np.array_equal(r.pairs[i], every.pairs[least])
        assert np.allclose(r.lower[i], every.lower[i, least], rtol=1e-5)
        assert np.allclose(r.gradient_joints[i], every.gradient_joints[i, least], atol=2e-2, equal_nan=True)


def test_rows_change_only_where_a_pair_becomes_nearer(arm_front):
    arm, k, steps = arm_front.joints("arm"), 6, 40
    options = {"reduce": "nearest", "k": k, "joints": "arm", "fields": ["distance", "upper", "normal", "rate"]}
    prepared, every = arm_front.prepare(**options), arm_front.prepare(joints="arm", fields=["distance", "upper"])
    stops = rows_of(arm, 5, seed=13)
    walk = np.concatenate([np.linspace(a, b, steps) for a, b in zip(stops, stops[1:])])
    order = {tuple(pair): i for i, pair in enumerate(every.run(walk[:1]).pairs.tolist())}
    before, changes = None, 0
    for row in walk[:, None]:
        kept = [order[tuple(pair)] for pair in prepared.run(row).pairs[0].tolist()]
        assert kept == sorted(kept), "they are in the order of the pairs"
        upper = every.run(row).upper[0]
        assert upper[kept].max() <= np.delete(upper, kept).min() * (1 + 1e-6), "they are the nearest"
        changes += before is not None and kept != before
        before = kept
    assert 3 < changes < len(walk) / 3
    # The same after other states, and of a query that has seen none.
    again = [prepared.run(row[None]) for row in walk[[100, 3, 100]]]
    fresh = arm_front.prepare(**options).run(walk[100][None])
    for r in (again[0], again[2]):
        assert np.array_equal(r.pairs, fresh.pairs) and r.upper.tobytes() == fresh.upper.tobytes()


def test_a_pair_without_usable_poses_counts_as_the_nearest(urdf):
    scene = arm_scene(urdf)
    scene.add_sphere("unseen", 0.1)
    engine = clearance.Engine(scene, threads=1, covers="off")
    rows = rows_of(engine.joints("arm"), 1)
    r = answer(engine, rows, reduce="nearest", k=3, fields=["status", "rate"])
    assert (r.status == clearance.Status.NO_POSE).all() and np.isnan(r.rate).all()
    assert "unseen" in r.pair_names


def test_a_prepared_run_takes_velocities(arm_front):
    rows = rows_of(arm_front.joints("arm"), 3, seed=9)
    v = np.random.default_rng(10).uniform(-1, 1, rows.shape)
    prepared = arm_front.prepare(joints="arm", reduce="nearest", k=4, fields=FIELDS)
    for speeds in (v, -2 * v, v[::-1].copy()):
        r = prepared.run(rows, speeds)
        once = answer(arm_front, rows, speeds, reduce="nearest", k=4, fields=FIELDS)
        assert r.rate.shape == (3, 4) and np.abs(r.rate).max() > 0
        for name in FIELDS:
            assert getattr(r, name).tobytes() == getattr(once, name).tobytes(), name
        later = prepared.submit(rows, speeds).result()
        assert later.curvature.tobytes() == r.curvature.tobytes()
    assert (prepared.run(rows).rate == 0).all()


def test_wrong_arguments_are_named(arm_front):
    rows = rows_of(arm_front.joints("arm"), 2)
    for arguments, inputs, error, text in (
        ({"fields": "rate"}, (rows[:1],), ValueError, r"velocities: expected shape \(2, 8\), got \(1, 8\)"),
        ({}, (rows,), clearance.QueryError, "velocities: only for the columns rate, rate_bounds and curvature"),
        ({"fields": "rate"}, (None, rows), ValueError, "twists: only together with configurations of bodies"),
        ({"k": 3}, (), clearance.QueryError, "k: only for reduce nearest"),
        ({"reduce": "any", "fields": "rate"}, (), clearance.QueryError, "fields: reduce any has no rate"),
    ):
        with pytest.raises(error, match=text):
            answer(arm_front, rows, *inputs, **arguments)
    with pytest.raises(clearance.QueryError, match="hessian_joints is for a query with joints"):
        arm_front.distances(fields="hessian_joints")
    with pytest.raises(AttributeError, match="neighbours: only for reduce='nearest' without k"):
        answer(arm_front, rows, reduce="nearest", k=3).neighbours


def test_neighbours_are_not_of_the_nearest_pair():
    scene = clearance.Scene()
    for i in range(2):
        scene.add_sphere(f"ball{i}", 0.1, pose=at(i, 0, 0))
    engine = clearance.Engine(scene, threads=1, covers="off")
    r = engine.prepare(reduce="nearest", k=1).run()
    assert r.pairs.tolist() == [[[0, 1]]]  # has body 0, whose row it would be without k
    for result in (r, pickle.loads(pickle.dumps(r))):
        with pytest.raises(AttributeError, match="neighbours: only for reduce='nearest' without k"):
            result.neighbours
    each = engine.distances(reduce="nearest")
    assert pickle.loads(pickle.dumps(each)).neighbours.tolist() == [[1, 0]]


def test_points_by_default_depend_on_the_pairs_that_there_are(arm_front):
    rows = rows_of(arm_front.joints("arm"), 2)
    r = answer(arm_front, rows, reduce="nearest", k=60000)
    assert len(rows) * 60000 > DEFAULT_POINTS_ROWS > r.lower.size > 0
    assert r.point_a.shape == (*r.lower.shape, 3)


#: A chain of sliding balls among others: few rows are kept of many that are found.
_MANY_FOUND = """
import resource, clearance, numpy as np
from pathlib import Path
import sys
links = "".join(f"<link name='l{i}'/>" for i in range(64))
ball = "<link name='l64'><collision><geometry><sphere radius='0.1'/></geometry></collision></link>"
joints = "".join(
    f"<joint name='j{i}' type='prismatic'><parent link='l{i}'/><child link='l{i + 1}'/><axis xyz='1 0 0'/>"
    "<limit lower='-9' upper='9' velocity='1' effort='1'/></joint>" for i in range(64))
Path(sys.argv[1]).write_text(f"<robot name='s'>{links}{ball}{joints}</robot>")
scene = clearance.Scene()
scene.add_robot("arm", urdf=sys.argv[1])
for i in range(100):
    scene.add_sphere(f"ball{i}", 0.1, pose=(i, 5, 0, 1, 0, 0, 0), static=True)
engine = clearance.Engine(scene, threads=1, covers="off")
rows = np.random.default_rng(3).uniform(-0.1, 0.1, (64, 64))
ask = engine.prepare(joints="arm", reduce="within", max_distance=np.inf, max_results=1, fields=FIELDS)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
r = ask.run(rows)
assert r.total == 6400 and len(r.distance) == 1, r
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_rows_that_are_dropped_take_no_memory_for_second_derivatives(tmp_path):
    code = _MANY_FOUND.replace("FIELDS", repr(["distance", "hessian_joints"]))
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "s.urdf")], capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    all_rows = 6400 * 64 * 64 * 8 // 1024
    assert int(done.stdout) < all_rows / 4


def smooth_pairs(engine, rows):
    """Pairs with second derivatives at all rows."""
    r = engine.distances(joints="arm", configurations=rows, fields=["hessian_joints"])
    return r.pairs[np.isfinite(r.hessian_joints).all(axis=(0, 2, 3))]


@pytest.mark.parametrize("rows_by", [{}, {"reduce": "min"}, {"reduce": "nearest", "k": 2}])
@pytest.mark.parametrize("library", ["jax", "torch"])
def test_host_distances_are_twice_differentiable(engine, library, rows_by):
    module = pytest.importorskip(library, reason=f"needs {library}")
    functions = pytest.importorskip(f"clearance.{library}")
    rows = rows_of(engine.joints("arm"), 3, seed=11)
    pairs = smooth_pairs(engine, rows)
    assert len(pairs) > 3
    prepared = engine.prepare(
        joints="arm", pairs=pairs, fields=["distance", "gradient_joints", "hessian_joints"], **rows_by
    )
    distances = functions.HostJointDistances(prepared)
    moves = np.random.default_rng(12).normal(size=rows.shape)
    if library == "jax":
        module.config.update("jax_enable_x64", True)
        as_array = np.asarray
        product = module.jit(lambda q, t: functions.hvp(lambda x: distances(x).sum(), q, t))(rows, moves)
    else:
        as_array = module.as_tensor
        product = functions.hvp(lambda x: distances(x).sum(), as_array(rows), as_array(moves))
    r = prepared.run(rows)
    hessian = r.hessian_joints.reshape(3, -1, 8, 8).sum(1)
    assert np.array_equal(np.asarray(distances(as_array(rows))), r.distance)
    assert np.allclose(np.asarray(product), np.einsum("kij,kj->ki", hessian, moves), rtol=1e-12, atol=1e-12)
    with pytest.raises(TypeError, match=r"positions: expected float64 \(K, 8\), got"):
        distances(as_array(rows[:, :7]))


def test_host_rows_name_what_they_lack(engine):
    from clearance._device.host_rows import HostRows

    with pytest.raises(ValueError, match="prepared: expected the column 'hessian_joints' among its fields"):
        HostRows(engine.prepare(joints="arm", fields=["distance", "gradient_joints"]))
    with pytest.raises(ValueError, match="prepared: expected configurations of joints alone"):
        HostRows(engine.prepare(fields="distance"))
    every = ["distance", "gradient_joints", "hessian_joints"]
    with pytest.raises(ValueError, match="prepared: the rows of reduce='within' vary"):
        HostRows(engine.prepare(joints="arm", reduce="within", max_distance=10.0, fields=every))
