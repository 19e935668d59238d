"""The viewer's page shows the answers: shapes, pictures, edges, tables. None of it needs viser."""

import html
import json
import math
import os
import re
import shutil
import subprocess
import sys
from decimal import Decimal

import numpy as np
import pytest

import clearance
from clearance.view import command
from clearance.view.camera import camera_at_first
from clearance.view.edge import Verdict, certified_edge
from clearance.view.model import ViewQuery, WhatIf, all_joints, look, positions_now, shapes_of
from clearance.view.path import proved_path, read_path
from clearance.view.plots import Series, nice_step, plot
from clearance.view.session import Session
from clearance.view.shadow import Shadow
from clearance.view.shapes import HALF_SPACE_EDGE, hull_mesh
from clearance.view.tables import edge_table, pairs_table, path_table, rounded_down, rounded_up, service_table
from conftest import BUILD, INSTALLED, ROOT
from patience import PATIENCE_S
from robots import ARM_YAML, arm_scene, rows_of
from scenes import at, box_vertices

PROGRAM = shutil.which("clearance") if INSTALLED else str(BUILD / "bin" / "clearance")


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


# ---- edges -----------------------------------------------------------------------------------------------------------


def test_spans_say_what_sampling_finds(robot):
    joints = all_joints(robot)
    start = positions_now(robot)
    end = start.copy()
    end[0], end[1] = 0.9, 0.25
    margin = 0.012
    edge = certified_edge(robot, joints, start, end, margin, spans=24)
    assert [s.begin for s in edge.spans] == [0.0, *(s.end for s in edge.spans[:-1])] and edge.spans[-1].end == 1.0
    verdicts = {span.verdict for span in edge.spans}
    assert {Verdict.FREE, Verdict.HIT} <= verdicts and edge.whole.verdict is Verdict.HIT
    requested = {"joints": joints, "reduce": "min", "fields": ("lower", "upper", "pair")}
    for span in edge.spans:
        rows = np.array([edge.at(t) for t in np.linspace(span.begin, span.end, 21)])
        r = robot.distances(configurations=rows, **requested)
        least = r.upper.min()
        assert span.lower <= least + 1e-12, "the bound is above a sample"
        if span.verdict is Verdict.FREE:
            assert r.lower.min() > margin - 1e-6 and span.lower > margin - 1e-3  # to abs_tol
        if span.verdict is Verdict.HIT:
            there = robot.distances(configurations=edge.at(span.at)[None], **requested)
            assert there.lower[0] <= margin + 1e-9
            assert tuple(there.pair[0]) == span.decided_by or there.upper[0] == 0
    assert edge.whole.lower <= min(span.lower for span in edge.spans) + 1e-3
    r = robot.motions(start[None], end[None], joints=joints, margin=margin)
    assert (edge.whole.lower, edge.whole.upper) == (r.lower[0], r.upper[0])
    text = edge_table(edge, [body.name for body in robot.bodies])
    assert text.count("data-span") == 25 and text.count(">free<") == sum(s.verdict is Verdict.FREE for s in edge.spans)
    contact, deepest = edge.report.contact, edge.report.nearest
    assert contact.t == pytest.approx(next(s.begin for s in edge.spans if s.verdict is not Verdict.FREE), abs=1 / 24)
    assert f"first contact at {contact.t:.3f}: {contact.pair_names[0]} &ndash; {contact.pair_names[1]}" in text
    assert f"{'deepest' if deepest.upper <= 0 else 'nearest'} at {deepest.t:.3f}: " in text
    with pytest.raises(ValueError, match="spans: expected 1 or more, got 0"):
        certified_edge(robot, joints, start, end, spans=0)


def test_the_way_of_an_edge_is_that_of_the_body_that_gets_farthest(robot):
    scene = clearance.Scene.load(ROOT / "scenes/cell/robot.yaml")
    session = Session(robot, scene, "")
    start = session.positions()
    end = start.copy()
    end[0] -= 1.0
    edge = session.edge(start, end, 0.01, 4)
    way = session.trace(edge)
    assert way is not None and way.shape == (17, 3)
    robot.set_joints(end, joints=session.joints)
    ends = np.array([state.pose[:3] for state in robot.body_states()])
    assert np.linalg.norm(ends - way[-1], axis=1).min() < 1e-9
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() > 0.4


# ---- paths -----------------------------------------------------------------------------------------------------------


def path_of(robot, *ways):
    start = positions_now(robot)
    rows = [start]
    for joint, change in ways:
        rows.append(rows[-1].copy())
        rows[-1][joint] += change
    return np.array(rows)


def written(robot, rows, file):
    names = ",".join(state.name for state in robot.joint_states())
    file.write_text("\n".join([names, *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n")
    return read_path(file)


def test_a_path_is_shown_with_what_explain_path_finds(robot, tmp_path):
    rows = path_of(robot, (0, -0.3), (1, -0.4), (0, 1.2))
    path = written(robot, rows, tmp_path / "path.csv")
    np.testing.assert_array_equal(path.points, np.stack((rows[:-1], rows[1:]), axis=1))
    proved = proved_path(robot, path, 0.01)
    report = robot.explain_path(rows, all_joints(robot), margin=0.01)
    assert [v is Verdict.FREE for v in proved.verdicts] == [True, True, report.check.free]
    assert proved.report.nearest.t == report.nearest.t and proved.report.nearest.pair == report.nearest.pair
    text = path_table(proved)
    assert text.count("data-motion") == 3 and text.count(">free<") == sum(v is Verdict.FREE for v in proved.verdicts)
    for what, point in (
        ("first contact", report.contact),
        ("deepest" if report.contact else "nearest", report.nearest),
    ):
        if point:
            assert f"{what} at {point.index + point.t:.3f}: {' &ndash; '.join(point.pair_names)}, " in text


def test_a_path_into_an_obstacle_names_its_first_contact(robot, tmp_path):
    path = written(robot, path_of(robot, (0, -0.2), (0, 1.0)), tmp_path / "path.csv")
    proved = proved_path(robot, path, 0.01)
    assert proved.verdicts == (Verdict.FREE, Verdict.HIT)
    contact = proved.report.contact
    assert contact is not None and contact.index == 1 and proved.time_of(1, contact.t) == 1 + contact.t
    assert f"first contact at {1 + contact.t:.3f}: " in path_table(proved)


def test_polylines_are_those_of_the_bodies_that_a_path_moves(robot, tmp_path):
    scene = clearance.Scene.load(ROOT / "scenes/cell/robot.yaml")
    rows = path_of(robot, (0, -0.5), (1, -0.3))
    session = Session(robot, scene, "", written(robot, rows, tmp_path / "path.csv"))
    proved = session.proved_path(0.0)
    ways = session.ways(proved, each=5)
    assert ways is not None and ways.shape[0] == 11 and ways.shape[2] == 3
    assert (np.linalg.norm(np.diff(ways, axis=0), axis=2).sum(axis=0) > 1e-6).all()
    for time, place in ((0.0, 0), (1.0, 5), (1.6, 8), (2.0, 10)):
        positions = session.along(time)
        np.testing.assert_allclose(positions, proved.path.at(time))
        robot.set_joints(positions, joints=session.joints)
        origins = np.array([state.pose[:3] for state in robot.body_states()])
        for point in ways[place]:
            assert np.linalg.norm(origins - point, axis=1).min() < 1e-9
    assert ways.shape[1] > 4


def test_a_trajectory_is_read_from_a_ros_message(robot, tmp_path):
    rows = path_of(robot, (0, -0.3))
    names = [state.name.rsplit("/")[-1] for state in robot.joint_states()]
    points = [
        {"positions": r.tolist(), "velocities": [0.02] * len(r), "time_from_start": k} for k, r in enumerate(rows)
    ]
    file = tmp_path / "move.json"
    file.write_text(json.dumps({"joint_names": names, "points": points}))
    path = read_path(file)
    assert path.points.shape == (1, 4, len(names))
    proved = proved_path(robot, path, 0.0)
    assert proved.joints.names == tuple(state.name for state in robot.joint_states())
    assert len(proved.verdicts) == 1 and proved.report.nearest.upper > 0


@pytest.mark.parametrize(
    "text, error",
    [
        ("a,b\n1,2\n", "path.csv: expected a line of joint names and two waypoints or more, got 1"),
        ("a,b\n1,2\n3\n", "path.csv: expected 2 numbers, one for each joint of the first line, got 1"),
        ("a,b\n1,2\n3,x\n", "path.csv: could not convert string to float: .*x"),
        ("", "path.csv: expected a line of joint names"),
    ],
)
def test_files_that_are_no_paths(tmp_path, text, error):
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(ValueError, match=error):
        read_path(tmp_path / "path.csv")


def test_joints_that_a_path_cannot_name(robot, tmp_path):
    (tmp_path / "path.csv").write_text("elsewhere\n1\n2\n")
    with pytest.raises(ValueError, match="path: no joint is named 'elsewhere'"):
        proved_path(robot, read_path(tmp_path / "path.csv"), 0.0)


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


# ---- the command -----------------------------------------------------------------------------------------------------


def options(*arguments):
    return command.parser().parse_args([str(argument) for argument in arguments])


def test_what_is_shown_is_what_was_named(start_daemon, cell, urdf, monkeypatch):
    monkeypatch.delenv("CLEARANCE_URL", raising=False)
    session = command.open_session(options(cell))
    assert not session.asks_only and len(session.shapes) == 23
    session = command.open_session(options(urdf))
    assert session.joints.names[0].startswith("arm/") and session.picture(ViewQuery()).placed.all()
    url = start_daemon(cell, ["ipc"]).urls["ipc"]
    session = command.open_session(options("--connect", url))
    assert session.asks_only and not any(session.known)
    session = command.open_session(options(cell, "--connect", url))
    assert session.asks_only and all(session.known)
    monkeypatch.setenv("CLEARANCE_URL", url)
    assert command.open_session(options()).source == url
    assert not command.open_session(options(cell)).asks_only


def test_what_does_not_go_together_is_refused(cell, urdf, monkeypatch):
    monkeypatch.delenv("CLEARANCE_URL", raising=False)
    with pytest.raises(ValueError, match="expected a scene file, a URDF, or --connect URL"):
        command.open_session(options())
    with pytest.raises(ValueError, match="--srdf and --packages are of a URDF"):
        command.open_session(options(cell, "--packages", "a=b"))
    with pytest.raises(ValueError, match="--packages: expected NAME=FOLDER, got 'a'"):
        command.open_session(options(urdf, "--packages", "a"))
    with pytest.raises(SystemExit):
        options(cell, "--rate", "1000")


def test_without_viser_the_command_says_what_to_install(cell, tmp_path):
    (tmp_path / "viser.py").write_text("raise ModuleNotFoundError('No module named viser', name='viser')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [PROGRAM, "view", str(cell)],
        env={**os.environ, "PYTHONPATH": path, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert (
        done.stderr
        == 'clearance view: the page needs viser: pip install "WHEEL[view]", where WHEEL is the file clearance-*.whl\n'
    )


def test_a_wheels_command_knows_it(root):
    code = "import runpy, sys; sys.argv[:] = ['clearance', 'view', '--help']; runpy.run_path({!r})['clearance']()"
    done = subprocess.run(
        [sys.executable, "-c", code.format(str(root / "client/python/_clearance_programs.py"))],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        cwd=root / "tests",
    )
    assert done.returncode == 0 and done.stdout.startswith("usage: clearance view"), done.stderr


@pytest.mark.skipif(INSTALLED, reason="the wheel's command runs the package itself")
def test_a_program_without_the_package_says_what_to_install(tmp_path):
    def run(path):
        command = [shutil.copy(PROGRAM, tmp_path / "clearance"), "view", "scene.yaml", "--port", "1"]
        return subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, env={**os.environ, "PATH": str(path)}
        )

    answer = run(tmp_path)
    assert answer.returncode == 1
    assert (
        "clearance-view is part of the Python package" in answer.stderr and 'pip install "WHEEL[view]"' in answer.stderr
    )
    # ... and finds the program on PATH.
    program = tmp_path / "bin" / "clearance-view"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\necho "found: $*"\n')
    program.chmod(0o755)
    assert run(program.parent).stdout == "found: scene.yaml --port 1\n"
