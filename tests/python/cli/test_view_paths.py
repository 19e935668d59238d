"""Edges and paths on the viewer's page: spans, first contacts, the ways of bodies. None of it needs viser."""

import json

import numpy as np
import pytest

import clearance
from clearance.view.edge import Verdict, certified_edge
from clearance.view.model import all_joints, positions_now
from clearance.view.path import proved_path, read_path
from clearance.view.session import Session
from clearance.view.tables import edge_table, path_table
from conftest import ROOT


@pytest.fixture
def robot():
    return clearance.Engine(clearance.Scene.load(ROOT / "scenes/cell/robot.yaml"), threads=1, covers="off")


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
