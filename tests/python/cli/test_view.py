"""The viewer's page shows the answers: shapes, pictures, tables. None of it needs viser."""

import html
import math
import re
import shutil
from decimal import Decimal

import numpy as np
import pytest

import clearance
from clearance.view.camera import camera_at_first
from clearance.view.model import ViewQuery, WhatIf, all_joints, look, positions_now, shapes_of
from clearance.view.plots import Series, nice_step, plot
from clearance.view.session import Session
from clearance.view.shadow import Shadow
from clearance.view.shapes import HALF_SPACE_EDGE, hull_mesh
from clearance.view.tables import pairs_table, rounded_down, rounded_up, service_table
from conftest import ROOT
from robots import ARM_YAML, arm_scene, rows_of
from scenes import at, box_vertices


def volume(mesh):
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij", a, np.cross(b, c)) / 6)


def turned(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


# ---- shapes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_a_box_is_drawn_as_it_is(seed):
    mesh = hull_mesh(box_vertices(1, 2, 3) @ turned(seed).T)
    assert len(mesh.vertices) == 8
    assert volume(mesh) == pytest.approx(6)


def test_a_hull_is_drawn_within_itself_and_grown_by_its_radius():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(500, 3))
    mesh = hull_mesh(points)
    assert {tuple(p) for p in mesh.vertices} < {tuple(p) for p in points}
    ball = points / np.linalg.norm(points, axis=1, keepdims=True)
    assert 0.9 * 4 / 3 * math.pi < volume(hull_mesh(ball)) < 4 / 3 * math.pi
    capsule = hull_mesh(np.array([[0, 0, -1.0], [0, 0, 1.0]]), 0.5)
    along = np.clip(capsule.vertices[:, 2], -1, 1)
    nearest = np.stack([np.zeros_like(along), np.zeros_like(along), along], axis=1)
    np.testing.assert_allclose(np.linalg.norm(capsule.vertices - nearest, axis=1), 0.5, atol=1e-12)
    assert volume(capsule) == pytest.approx(math.pi * 0.25 * (2 + 4 / 3 * 0.5), rel=0.02)


def test_every_kind_of_body_has_a_shape():
    scene = clearance.Scene.load(ROOT / "scenes/primitives/scene.yaml")
    engine = clearance.Engine(scene, threads=1, covers="off")
    for body, shape in zip(engine.bodies, shapes_of(engine, scene)):
        corners = np.concatenate([mesh.vertices for mesh in shape.look("pieces")])
        if math.isinf(body.extent):
            assert np.abs(corners).max() == HALF_SPACE_EDGE / 2 and (corners[:, 2] == 0).all()
        else:
            assert np.linalg.norm(corners, axis=1).max() <= body.extent * 1.001  # the prism around a cylinder
            assert np.linalg.norm(corners, axis=1).max() > 0.9 * body.extent
    balls = shapes_of(engine, None)  # as for a daemon whose scene file is not available
    for body, shape in zip(engine.bodies, balls):
        for mesh in shape.look("mesh"):
            np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), body.extent)
    assert sum(len(shape.mesh) for shape in balls) == sum(math.isfinite(body.extent) for body in engine.bodies)


# ---- pictures --------------------------------------------------------------------------------------------------------


@pytest.fixture
def robot():
    return clearance.Engine(clearance.Scene.load(ROOT / "scenes/cell/robot.yaml"), threads=1, covers="off")


def test_a_picture_is_the_answer(robot):
    robot.set_joints({"arm/turn": 0.55})  # into the shelf
    picture = look(robot, ViewQuery(max_distance=0.3, most_rows=1000))
    r = robot.distances(reduce="within", max_distance=0.3, fields=("default", "pair", "points"))
    expected = {tuple(p): row for p, *row in zip(r.pairs.tolist(), r.lower, r.upper, r.status)}
    have = {tuple(p): row for p, *row in zip(picture.pairs.tolist(), picture.lower, picture.upper, picture.status)}
    assert have == expected and picture.total == len(expected) > 20
    assert (np.diff(picture.lower) >= 0).all()
    apart = picture.status == clearance.Status.OK
    lengths = np.linalg.norm(picture.segments[:, 1] - picture.segments[:, 0], axis=1)[apart]
    assert (lengths > 0).all() and (lengths <= picture.upper[apart] + 1e-9).all()
    overlapping = {i for p, s in zip(r.pairs.tolist(), r.status) if s == clearance.Status.OVERLAP for i in p}
    assert set(np.flatnonzero(picture.overlapping)) == overlapping and overlapping
    states = robot.body_states()
    np.testing.assert_array_equal(picture.poses, [state.pose for state in states])
    assert picture.placed.all()

    few = look(robot, ViewQuery(max_distance=0.3, most_rows=5))
    assert few.total == picture.total and few.lower.tolist() == picture.lower[:5].tolist()


def test_the_camera_opens_on_the_nearest_pair():
    """From a direction from which no body hides it, also if one stands where the camera would."""
    scene = clearance.Scene()
    scene.add_sphere("a", 0.1, static=True, pose=at(0))
    scene.add_sphere("b", 0.1, pose=at(0.3))
    scene.add_sphere("far", 0.1, static=True, pose=at(5))
    engine = clearance.Engine(scene, threads=1, covers="off")
    target, freely = camera_at_first(look(engine, ViewQuery(max_distance=9.0)), shapes_of(engine, scene))
    assert np.allclose(target, [0.15, 0, 0]) and 0.3 < np.linalg.norm(freely - target) < 1
    middle = target + 0.5 * (freely - target)
    scene.add_box("wall", [0.5, 0.5, 0.5], static=True, pose=[*middle, 1, 0, 0, 0])
    scene.ignore("wall", "b")
    engine = clearance.Engine(scene, threads=1, covers="off")
    again, behind = camera_at_first(look(engine, ViewQuery(max_distance=9.0)), shapes_of(engine, scene))
    assert np.allclose(again, target) and not np.allclose(behind, freely)
    rays = behind + np.linspace(0, 0.98, 200)[:, None] * (target - behind)
    assert (np.abs(rays - middle).max(axis=1) > 0.25).all(), "the wall is not before the target"
    assert np.linalg.norm(behind - target) == pytest.approx(np.linalg.norm(freely - target))


def test_the_camera_shows_a_scene_without_pairs():
    scene = clearance.Scene()
    scene.add_sphere("one", 0.1, pose=at(2))
    engine = clearance.Engine(scene, threads=1, covers="off")
    target, position = camera_at_first(look(engine, ViewQuery()), shapes_of(engine, scene))
    assert np.allclose(target, [2, 0, 0]) and 0.3 < np.linalg.norm(position - target) < 3


def test_each_bodys_nearest_comes_once_a_pair(robot):
    picture = look(robot, ViewQuery("nearest"))
    r = robot.distances(reduce="nearest", fields=("default", "pair"))
    expected = {tuple(sorted(p)) for p in r.pairs[0].tolist() if clearance.NONE not in p}
    assert {tuple(sorted(p)) for p in picture.pairs.tolist()} == expected
    assert len(picture.pairs) == len(expected) < len(robot.bodies)


def test_bodies_without_a_pose_are_not_placed():
    scene = clearance.Scene()
    scene.add_sphere("here", 0.1, pose=at(0))
    scene.add_sphere("nowhere", 0.1)
    picture = look(clearance.Engine(scene, threads=1, covers="off"), ViewQuery())
    assert picture.placed.tolist() == [True, False]
    assert not picture.drawn.any() and math.isnan(picture.ages_s[1])
    assert "no_pose" in pairs_table(picture) or "No pair" in pairs_table(picture)


def test_a_daemon_is_asked_and_not_told(arm_daemon, arm_engine, kind, urdf):
    client = clearance.connect(arm_daemon.urls[kind])
    joints = all_joints(client)
    now = positions_now(client)
    np.testing.assert_array_equal(now, positions_now(arm_engine))
    before = look(client, ViewQuery(max_distance=1.0))
    local = look(arm_engine, ViewQuery(max_distance=1.0))
    for column in ("pairs", "status", "lower", "upper", "segments", "poses"):
        np.testing.assert_array_equal(getattr(before, column), getattr(local, column))

    session = Session(client, arm_scene(urdf), "")
    elsewhere = rows_of(joints, 1)[0]
    would_be = session.picture(ViewQuery(max_distance=1.0), elsewhere)
    arm_engine.set_joints(elsewhere, joints=arm_engine.joints("arm"))
    there = look(arm_engine, ViewQuery(max_distance=1.0))
    for column in ("pairs", "status", "lower", "upper", "segments"):
        np.testing.assert_array_equal(getattr(would_be, column), getattr(there, column))
    np.testing.assert_allclose(would_be.poses, there.poses, atol=1e-12)
    assert np.abs(would_be.poses - before.poses).max() > 0.1
    after = look(client, ViewQuery(max_distance=1.0))
    assert after.pose_revision == before.pose_revision and after.poses.tolist() == before.poses.tolist()
    client.close()


def test_what_follows_a_link_would_follow_it(urdf):
    """As in the engine when joints move: also attached bodies, and a base that another client moved."""
    scene = arm_scene(urdf)
    scene.add_sphere("tool", 0.03, pose=at(0.9, 0.1, 0.4))
    engine = clearance.Engine(scene, threads=1, covers="off")
    joints = all_joints(engine)
    engine.set_poses({"arm": at(0.1, 0.2, 0.3, np.array([0.8, 0, 0.6, 0])), "cup": at(0.2, 0.2, 0.9)})
    names = [body.name for body in engine.bodies]
    link = next(name for name in reversed(names) if name.startswith("arm/"))
    engine.attach("tool", link)
    shadow = Shadow(scene)
    assert shadow.fits(engine)
    for row in rows_of(joints, 5, seed=4):
        would_be = shadow.poses(engine, WhatIf(joints, row))
        moved = clearance.Engine(scene, threads=1, covers="off")
        moved.set_poses({"arm": engine.body_states()[names.index("arm")].pose, "cup": at(0.2, 0.2, 0.9)})
        moved.set_joints(positions_now(engine), joints=joints)
        moved.attach("tool", link)
        moved.set_joints(row, joints=joints)
        np.testing.assert_allclose(would_be, [state.pose for state in moved.body_states()], atol=1e-12)


def test_a_session_follows_a_scene_that_changes(start_daemon, urdf, tmp_path):
    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML)
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    session = Session(clearance.connect(daemon.urls["ipc"]), clearance.Scene.load(tmp_path / "scene.yaml"), "")
    assert all(session.known) and not session.warning
    first = session.generation
    session.picture(ViewQuery())
    assert session.generation == first
    with clearance.connect(daemon.urls["ipc"]) as other:
        other.add_body("mug", sphere=0.2, pose=at(0.4, 0.35, 0.5))
    picture = session.picture(ViewQuery())
    assert session.generation > first and picture.names[-1] == "mug"
    assert session.known[-1] is False and all(session.known[:-1]) and "other bodies" in session.warning
    assert len(session.shapes) == len(picture.names) and picture.overlapping[-1]


# ---- tables and plots ------------------------------------------------------------------------------------------------


def test_numbers_on_the_page_are_rounded_outward():
    rng = np.random.default_rng(5)
    values = np.concatenate([rng.normal(size=500) * 10.0 ** rng.integers(-9, 4, 500), [0.0, -0.0, 1e-9, -1e-9, 0.1]])
    assert (np.abs(values) < 1e-6).sum() > 50
    for value in values.tolist():
        low, high = Decimal(rounded_down(value)), Decimal(rounded_up(value))
        assert low <= Decimal(value) <= high and high - low <= Decimal("0.000001")
    assert rounded_up(-1e-9) == "0.000000" and rounded_down(-1e-9) == "-0.000001"
    assert rounded_up(math.inf) == "&infin;" and rounded_down(-math.inf) == "-&infin;" and rounded_up(math.nan) == ""


def test_the_table_has_the_pictures_rows(robot):
    picture = look(robot, ViewQuery(max_distance=0.3, most_rows=7))
    text = pairs_table(picture)
    rows = re.findall(r'data-pair="(\d+),(\d+)"><td>(.*?)</td><td class="lower" title="(.*?)">.*?title="(.*?)"', text)
    assert len(rows) == 7
    for (a, b, names, lower, upper), pair, low, high in zip(rows, picture.pairs, picture.lower, picture.upper):
        assert [int(a), int(b)] == pair.tolist() and (float(lower), float(upper)) == (low, high)
        assert html.unescape(names) == " \N{EN DASH} ".join(picture.names[i] for i in pair)
    assert f"and {picture.total - 7} more pairs" in text
    assert f"{len(picture.names)}, of which {len(picture.names)} have a pose" in service_table(picture, "a <b>")
    assert "a &lt;b&gt;" in service_table(picture, "a <b>")


def test_names_cannot_be_markup():
    scene = clearance.Scene()
    scene.add_sphere("<img src=x onerror=y>", 0.1, pose=at(0))
    scene.add_sphere("b", 0.1, pose=at(0.25))
    text = pairs_table(look(clearance.Engine(scene, threads=1, covers="off"), ViewQuery()))
    assert "<img" not in text and "&lt;img src=x onerror=y&gt;" in text


def test_plots_have_gaps_and_round_steps():
    assert [nice_step(x) for x in (0.0, 0.9, 3.0, 7.0, 12.0, 42.0, math.nan)] == [1, 0.2, 1, 2, 5, 10, 1]
    x = np.linspace(0, 1, 5)
    text = plot("t", x, [Series("a", "#123456", np.array([1, 2, np.nan, 2, 1.0]))], (0, 1), " s")
    (way,) = re.findall(r'<path d="([^"]*)" stroke="#123456"/></svg>|<path d="(M[^"]*L[^"]*)" stroke="#123456"', text)[
        :1
    ]
    assert "".join(way).count("M") == 2 and "".join(way).count("L") == 2
