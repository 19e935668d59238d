"""Pairs with a cloud without points: beyond any distance, for every reduction, backend and tolerance."""

from pathlib import Path

import numpy as np
import pytest

import clearance
from clearance import Status

CELL = Path(__file__).resolve().parents[3] / "scenes/cell/robot.yaml"
LINKS = ("arm/forearm", "arm/gripper")
FIELDS = ("distance", "lower", "upper", "status", "pair", "pair_lower")


def scene_with_cloud(is_static):
    scene = clearance.Scene.load(CELL)
    scene.add_points("seen", [], radius=0.01, static=is_static, pose=[1, 0, 0, 1, 0, 0, 0])
    return scene


def expect_nothing(rows):
    assert (rows.status == Status.BEYOND).all()
    for column in (rows.distance, rows.lower, rows.upper):
        assert np.isposinf(column).all()


@pytest.fixture(scope="module", params=[(b, c) for b in clearance.Engine.backends() for c in ("off", "background")],
                ids="-".join)  # fmt: skip
def engines(request):
    backend, covers = request.param
    found = [clearance.Engine(scene_with_cloud(s), backend=backend, threads=1, covers=covers) for s in (True, False)]
    for engine in found:
        assert engine.wait_covers(60)
    return found


class Moves:
    """States of the cell's arm, and queries about them."""

    def __init__(self, engine, options):
        self.engine, self.options = engine, options
        self.joints = engine.joints("arm")
        home = np.array([state.position for state in engine.joint_states() if state.name in self.joints.names])
        self.states = home + np.random.default_rng(1).uniform(-0.3, 0.3, (40, len(home)))

    def rows(self, pairs, reduce):
        query = self.engine.prepare(reduce=reduce, pairs=pairs, joints=self.joints, fields=FIELDS, **self.options)
        query.run(self.states)
        return query.run(self.states)  # covers answer from the second time on


def expect_same(rows, others, selected=...):
    for field in FIELDS:
        assert np.array_equal(getattr(rows, field)[selected], getattr(others, field)[selected]), field


@pytest.mark.parametrize("tolerance", [{}, {"abs_tol": 1e-6}, {"abs_tol": 5e-2}], ids=str)
@pytest.mark.parametrize("most", [{}, {"max_distance": 0.7}], ids=str)
def test_every_reduction(engines, most, tolerance):
    for engine in engines:
        body = {b.name: b.id for b in engine.bodies}
        arm = Moves(engine, {**most, **tolerance})
        alone, shelf = [("seen", link) for link in LINKS], [("shelf", link) for link in LINKS]
        first = (body["seen"], body[LINKS[0]])
        least = arm.rows(alone, "min")
        expect_nothing(least)
        assert (least.pair == first).all() and (least.pair_lower == first).all()
        expect_nothing(arm.rows(alone, "none"))
        assert len(arm.rows(alone, "within").status) == 0
        decided = engine.distances(configurations=arm.states, joints=arm.joints, pairs=alone, reduce="any")
        assert (decided.status == Status.BEYOND).all()

        # With other pairs, they change no row but the cloud's.
        both = arm.rows(alone + shelf, "min")
        expect_same(both, arm.rows(shelf, "min"))
        assert (both.lower < np.inf).all()
        nearest = arm.rows(alone + shelf, "nearest")
        others = np.arange(len(body)) != body["seen"]
        expect_same(nearest, arm.rows(shelf, "nearest"), (slice(None), others))
        assert (nearest.status[:, ~others] == Status.BEYOND).all() and np.isposinf(nearest.lower[:, ~others]).all()
        assert (nearest.pair[:, body["seen"]] == first).all()
