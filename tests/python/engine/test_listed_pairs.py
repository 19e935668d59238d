"""Pairs that a query lists: twice, or of bodies that both stay. Covers answer as the exact engine does."""

import numpy as np
import pytest

import clearance

POSES = np.zeros((64, 1, 7))
POSES[:, 0, :3] = np.random.default_rng(0).uniform(-0.3, 0.3, (64, 3))
POSES[:, 0, 3] = 1
WALL, POST = ("mover", "wall"), ("mover", "post")


def engine_of(covers):
    scene = clearance.Scene()
    scene.add_box("mover", [0.1, 0.1, 0.1])
    scene.add_box("wall", [0.1, 1, 1], static=True, pose=[1, 0, 0, 1, 0, 0, 0])
    scene.add_box("post", [0.1, 1, 1], static=True, pose=[6, 0, 0, 1, 0, 0, 0])
    scene.add_points("nothing", np.zeros((0, 3)), radius=0.01, static=True, pose=[0, 3, 0, 1, 0, 0, 0])
    engine = clearance.Engine(scene, threads=1, covers=covers)
    assert engine.wait_covers(60)
    return engine


@pytest.fixture(scope="module")
def engines():
    return engine_of("background"), engine_of("off")


@pytest.mark.parametrize("margins", [[0.95, 0.0], [0.0, 0.95], [0.9, 0.9]])
def test_a_pair_that_is_listed_twice_has_both_margins(engines, margins):
    by_covers, exact = engines
    options = {"bodies": ["mover"], "pairs": [WALL, WALL], "margin": np.array(margins)}
    free = by_covers.check(POSES, **options).free
    assert (free == exact.check(POSES, **options).free).all()
    wide = exact.check(POSES, bodies=["mover"], pairs=[WALL], margin=max(margins)).free
    assert (free == wide).all() and 0 < free.sum() < len(free)
    options |= {"reduce": "any", "fields": "verdict"}
    verdicts = [engine.motions(POSES[:32], POSES[32:], **options).verdict for engine in engines]
    assert (verdicts[0] == verdicts[1]).all() and 0 < (verdicts[0] == clearance.Status.BEYOND).sum() < 32


def test_a_pair_that_is_listed_twice_has_two_rows(engines):
    r = engines[0].distances([("*", "wall"), WALL], POSES, bodies=["mover"], abs_tol=0.06, fields=["lower", "upper"])
    same = [p for p, (a, b) in enumerate(r.pairs.tolist()) if {a, b} == {0, 1}]
    assert len(same) == 2
    assert np.isfinite(r.upper[:, same]).all() and (r.upper[:, same] - r.lower[:, same] <= 0.06 + 1e-9).all()


@pytest.mark.parametrize("tolerance", [{"rel_tol": 0.4}, {"abs_tol": 0.06}])
@pytest.mark.parametrize("reduce", ["none", "nearest", "min"])
@pytest.mark.parametrize(
    "pairs", [[WALL, ("wall", "post")], [WALL, ("wall", "nothing")], [("post", "wall"), WALL, POST]]
)
def test_bodies_that_stay_are_beyond_as_without_covers(engines, pairs, reduce, tolerance):
    fields = ["distance", "lower", "upper", "status", *([] if reduce == "none" else ["pair"])]
    for most in (0.8, 2.0, np.inf):
        options = {"bodies": ["mover"], "reduce": reduce, "max_distance": most, "fields": fields}
        wide, exact = (e.distances(pairs, POSES, **options, **t) for e, t in zip(engines, (tolerance, {})))
        beyond = np.isinf(exact.upper)
        assert (wide.status[~beyond] != clearance.Status.BEYOND).all() and np.isfinite(wide.upper[~beyond]).all()
        assert (np.isinf(wide.upper) | (wide.upper < 1e3)).all()
        assert (wide.lower <= exact.upper).all() and (wide.upper >= exact.lower).all()
        assert np.isfinite(wide.upper[wide.status == clearance.Status.OK]).all()
        if reduce != "none":
            ids = wide.pair[wide.pair != clearance.NONE]
            assert (ids < 4).all()


def test_an_ok_row_has_an_upper_bound():
    rng = np.random.default_rng(5)
    scene = clearance.Scene()
    for i in range(12):
        scene.add_hull(f"h{i}", rng.normal(size=(20, 3)) * 0.1)
    engine = clearance.Engine(scene, threads=1)
    assert engine.wait_covers(60)
    bodies = [f"h{i}" for i in range(12)]
    poses = np.zeros((400, 12, 7))
    poses[..., :3] = rng.uniform(-1, 1, (400, 12, 3))
    poses[..., 3] = 1
    near = 0
    for reduce in ("min", "nearest"):
        for tolerance in ({"rel_tol": 0.3}, {"abs_tol": 0.06}):
            r = engine.distances(None, poses, bodies=bodies, reduce=reduce, max_distance=0.5, **tolerance)
            ok = r.status == clearance.Status.OK
            assert np.isfinite(r.upper[ok]).all()
            near += int((abs(r.lower - 0.5) < 0.02).sum())
    assert near > 100
