"""The viewer's covers: balls of each level contain the body, inner balls lie within it. None of it needs viser."""

import numpy as np
import pytest

import clearance
from clearance.view.covers import LEVELS, Balls, DrawnBalls, cover_of
from clearance.view.model import ViewQuery
from clearance.view.session import Session
from scenes import at

HALF = np.array([0.3, 0.2, 0.1])


@pytest.fixture(scope="module")
def scene():
    made = clearance.Scene()
    made.add_box("table", [2, 2, 0.1], static=True, pose=at(0, 0, -1))
    made.add_half_space("floor", pose=at(0, 0, -2))
    made.add_box("crate", 2 * HALF, pose=at(0))
    made.add_sphere("ball", 0.25, pose=at(2))
    return made


def inside(points, balls):
    """(N,) bool: points in an outer ball, with a tolerance for rounding."""
    gaps = np.linalg.norm(points[:, None] - balls.centres[None].astype(np.float64), axis=2) - balls.outer
    return (gaps <= 1e-12).any(axis=1)


def test_each_level_contains_the_body_and_deeper_ones_are_narrower(scene):
    rng = np.random.default_rng(7)
    points = np.concatenate([rng.uniform(-HALF, HALF, (2000, 3)), HALF * (rng.integers(0, 2, (50, 3)) * 2 - 1)])
    cover = cover_of(scene, 2)
    assert len(cover) == LEVELS and len(cover[0].centres) == 1
    for balls in cover:
        assert inside(points, balls).all()
        solid = balls.inner > 0
        depth = (HALF - np.abs(balls.centres.astype(np.float64))).min(axis=1)
        assert (balls.inner[solid] <= depth[solid]).all()
    assert (cover[-1].inner > 0).any() and not inside(points * 1.5, cover[-1]).all()
    counts, widths = [len(balls.centres) for balls in cover], [balls.width for balls in cover]
    assert counts == sorted(counts) and counts[-1] > 100 and widths == sorted(widths, reverse=True)


def test_balls_that_are_not_divided_stay_in_later_levels(scene):
    """A ball is its own cover: nothing is left to divide."""
    cover = cover_of(scene, 3)
    directions = np.random.default_rng(3).normal(size=(1000, 3))
    points = 0.25 * (1 - 1e-6) * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    for balls in cover:
        assert inside(points, balls).all() and balls.width < 1e-6
    assert [len(balls.centres) for balls in cover[1:]] == [len(cover[1].centres)] * (LEVELS - 1)


def test_a_half_space_has_none(scene):
    assert cover_of(scene, 1) == ()


def test_a_session_makes_them_one_by_one_robots_first(scene):
    session = Session(clearance.Engine(scene, threads=1, covers="off"), scene, "")
    assert session.uncovered == [2, 3, 0, 1]
    session.make_cover()
    assert list(session.covers) == [2] and session.uncovered == [3, 0, 1]
    for _ in range(5):
        session.make_cover()
    assert {body: len(cover) for body, cover in session.covers.items()} == {0: LEVELS, 1: 0, 2: LEVELS, 3: LEVELS}
    session.refresh()
    assert not session.covers and len(session.uncovered) == 4
    shapeless = Session(session.front, None, "")
    assert not shapeless.uncovered
    shapeless.make_cover()
    assert not shapeless.covers


@pytest.mark.parametrize("bodies", [["other"], ["table", "floor", "other", "crate"]])
def test_a_changed_scene_is_adopted_before_more_covers_are_made(scene, bodies):
    """The body that is next has no name there, or one that the file lacks."""
    session = Session(clearance.Engine(scene, threads=1, covers="off"), scene, "")
    changed = clearance.Scene()
    for name in bodies:
        changed.add_sphere(name, 0.1, pose=at(3))
    session.front = clearance.Engine(changed, threads=1, covers="off")  # as after the restart of a daemon
    session.make_cover()
    assert not session.covers and session.uncovered == [2, 3, 0, 1]
    session.picture(ViewQuery())
    assert session.uncovered == [k for k, name in enumerate(bodies) if name != "other"]


class FakeScene:
    """Records the nodes of a page."""

    def __init__(self):
        self.nodes = {}

    def add_batched_meshes_simple(self, name, vertices, faces, wxyzs, positions, *, batched_scales, **_):
        assert len(wxyzs) == len(positions) == len(batched_scales) and name not in self.nodes
        self.nodes[name] = (positions, batched_scales)
        scene = self

        class Handle:
            def remove(self):
                del scene.nodes[name]

        return Handle()


def test_one_level_is_drawn_at_a_time():
    def level(inner):
        inner = np.array(inner, np.float32)
        return Balls(np.arange(3 * len(inner), dtype=np.float32).reshape(-1, 3), inner + np.float32(1), inner)

    page, cover = FakeScene(), (level([0.5]), level([-0.1, 0.2]))
    drawn = DrawnBalls(page, "/b")
    drawn.show((), 1)
    assert not page.nodes, "the cover is still to be made"
    drawn.show(cover, 0)
    assert set(page.nodes) == {"/b/outer", "/b/inner"}
    drawn.show(cover, 1)
    assert len(page.nodes["/b/outer"][0]) == 2
    np.testing.assert_array_equal(page.nodes["/b/inner"][1], np.float32([0.2]))
    np.testing.assert_array_equal(page.nodes["/b/inner"][0], cover[1].centres[1:])
    drawn.show(cover, None)
    assert not page.nodes
