"""`model="pieces"`: bodies answered by convex parts alone, in process and through a daemon over every transport."""

import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

import clearance
from clearance import Flag, Status
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S
from scenes import at

PROGRAM = "clearance" if INSTALLED else str(BUILD / "bin" / "clearance")
SCENE = """
bodies:
  - {name: bracket, mesh: bracket.obj, mesh_as: decompose, pose: [0,0,0, 1,0,0,0]}
  - {name: ball, sphere: 0.1, pose: [0.6,0.25,0.6, 1,0,0,0]}
  - {name: plate, mesh: bracket.obj, mesh_as: solid, static: true, pose: [0,3,0, 1,0,0,0]}
  - {name: floor, half_space: true, pose: [0,0,-1, 1,0,0,0]}
"""
SHRUNK = 0.01  # metres, for each side of each part
# The ball: in the bracket's corner, near its foot, inside it, and far away.
PLACES = np.array([[at(0.6, 0.25, 0.6)], [at(0.6, 0.25, 0.355)], [at(0.6, 0.25, 0.2)], [at(9)]], float)
TRUE = [0.25, 0.005, 0.0]


def box_text(name, low, high, first):
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = ("1 2 4", "1 4 3", "5 7 8", "5 8 6", "1 5 6", "1 6 2", "3 4 8", "3 8 7", "1 3 7", "1 7 5", "2 6 8", "2 8 4")
    lines = [f"o {name}", *(f"v {x} {y} {z}" for x, y, z in corners)]
    return lines + ["f " + " ".join(str(int(i) + first) for i in face.split()) for face in faces]


def bracket_text():
    """An L of 1 m, 0.25 m thick and 0.5 m wide."""
    profile = [(0, 0), (1, 0), (1, 0.25), (0.25, 0.25), (0.25, 1), (0, 1)]
    lines = [f"v {x} {y} {z}" for y in (0, 0.5) for x, z in profile]
    for a, b, c in ((1, 2, 3), (1, 3, 4), (1, 4, 5), (1, 5, 6)):  # sides: all of the L is visible from the corner
        lines += [f"f {a} {b} {c}", f"f {a + 6} {c + 6} {b + 6}"]
    for i in range(1, 7):
        j = i % 6 + 1
        lines += [f"f {i} {i + 6} {j + 6}", f"f {i} {j + 6} {j}"]
    return lines


@pytest.fixture
def scene(tmp_path):
    d = SHRUNK
    pieces = box_text("lying", (d, d, d), (1 - d, 0.5 - d, 0.25 - d), 0)
    pieces += box_text("standing", (d, d, d), (0.25 - d, 0.5 - d, 1 - d), 8)
    (tmp_path / "bracket.obj").write_text("\n".join(bracket_text()) + "\n")
    (tmp_path / "bracket.obj.pieces.obj").write_text("\n".join(pieces) + "\n")
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def evaluate(front, **more):
    """Columns of the one pair."""
    query = {"pairs": [("bracket", "ball")], "bodies": ["ball"], "fields": ["default", "flags"]}
    answer = front.prepare("distances", **query, **more).run(PLACES)
    return SimpleNamespace(**{name: getattr(answer, name)[:, 0] for name in ("lower", "upper", "status", "flags")})


def test_the_interval_holds_the_mesh_s_distance_and_is_as_wide_as_the_pieces_miss_it(front):
    exact_value, pieces = evaluate(front), evaluate(front, model="pieces")
    assert exact_value.status.tolist() == [Status.OK, Status.OK, Status.OVERLAP, Status.OK]
    assert pieces.status.tolist() == [Status.OK, Status.CONTACT, Status.CONTACT, Status.OK]
    width = pieces.upper - pieces.lower
    slack = 3**0.5 * SHRUNK  # of a corner, as far as it is proved
    for row, exact in enumerate(TRUE):
        assert exact_value.lower[row] - 1e-6 <= exact <= exact_value.upper[row] + 1e-6
        assert pieces.lower[row] <= exact <= pieces.upper[row] + 1e-12
    assert (pieces.lower <= exact_value.upper).all() and (exact_value.lower <= pieces.upper).all()
    assert (exact_value.upper - exact_value.lower < 1e-4).all() and slack <= width[0] <= 1.2 * slack + 0.002
    assert pieces.flags[0] & Flag.UNCERTAINTY_LIMITED and not exact_value.flags[0] & Flag.UNCERTAINTY_LIMITED
    pairs = [("ball", "plate"), ("plate", "floor")]
    same, known = front.prepare("distances", pairs=pairs, model="pieces").run(), front.distances(pairs)
    assert same.lower.tolist() == known.lower.tolist() and same.upper.tolist() == known.upper.tolist()
    assert evaluate(front, model="truth").upper.tolist() == exact_value.upper.tolist()


def test_signed_values_below_0_are_the_pieces(front):
    pieces = evaluate(front, model="pieces", signed_distance=True)
    depth = 0.25 - SHRUNK - 0.1  # of the ball's lowest point below the part's top
    assert pieces.lower[2] <= -depth <= pieces.upper[2] < 0
    assert pieces.status[2] == Status.OVERLAP and pieces.flags[2] & Flag.PIECES and not pieces.flags[0] & Flag.PIECES
    assert pieces.lower[0] <= TRUE[0] <= pieces.upper[0]


def test_reductions_and_decisions(front):
    requested = {"pairs": [("bracket", "*")], "bodies": ["ball"], "model": "pieces"}
    least = front.prepare("distances", reduce="min", **requested).run(PLACES)
    for row, exact in enumerate(TRUE):
        assert least.lower[row] <= exact <= least.upper[row] + 1e-12
    within = front.prepare("distances", reduce="within", max_distance=0.1, **requested).run(PLACES)
    assert within.lower.size == 2 and within.configuration.tolist() == [1, 2]
    nearest = front.prepare("distances", reduce="nearest", **requested).run(PLACES)
    assert nearest.lower.size == len(PLACES) * 4
    exact_value = {
        "pairs": [("bracket", "ball")],
        "bodies": ["ball"],
    }  # results cached for one are not used for the other
    assert front.check(PLACES, **exact_value).free.tolist() == [True, True, False, True]
    check = front.prepare("check", **exact_value, model="pieces").run(PLACES)
    assert check.free.tolist() == [True, False, False, True]
    assert check.verdict.tolist() == [Status.BEYOND, Status.UNCONVERGED, Status.UNCONVERGED, Status.BEYOND]
    assert front.check(PLACES, **exact_value).free.tolist() == [True, True, False, True]
    near = front.prepare("check", margin=0.2, **exact_value, model="pieces").run(PLACES)
    assert near.hit.tolist() == [False, True, True, False]


def test_motions(front):
    start, end = PLACES[[0, 0]], PLACES[[1, 2]]
    end[0, 0, 2] = 0.45  # 0.1 m above the foot
    found = front.prepare("motions", pairs=[("bracket", "ball")], bodies=["ball"], model="pieces").run(start, end)
    assert found.lower[0] <= 0.1 <= found.upper[0] and 0.05 < found.lower[0] and found.upper[0] < 0.13
    assert found.lower[1] <= 0 <= found.upper[1] < 0.02


def test_what_is_refused(front):
    with pytest.raises(ValueError, match="model: expected 'truth' or 'pieces', got 'hull'"):
        front.prepare("distances", model="hull")
    with pytest.raises((clearance.QueryError, clearance.RequestError), match="'bracket' is a solid"):
        front.certificate(pairs=[("bracket", "ball")], model="pieces")


def test_a_certificate_is_of_the_mesh(front, checker):
    requested = dict(pairs=[("bracket", "ball")], bodies=["ball"], configurations=PLACES)
    document, answer = front.certificate(**requested).document, front.distances(**requested)
    assert [float(row["lower"]) for row in document["rows"]] == answer.lower.ravel().tolist()
    assert {row["status"] for row in document["rows"]} >= {"ok", "overlap"}
    assert all(is_proved for is_proved, _ in checker.verdicts(document))
    assert document["pieces"][0]["solid"] and len(document["pieces"][0]["elements"]) > 12


def test_the_command(scene, start_daemon, kinds):
    if kinds["shm"]:
        pytest.skip(kinds["shm"])
    url = start_daemon(scene, ["shm"]).urls["shm"]

    def lower(*words):
        command = [PROGRAM, "query", "--connect", url, "--pairs", "bracket,ball", "--csv", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert done.returncode == 0, done.stderr
        names, row = (line.split(",") for line in done.stdout.strip().splitlines()[:2])
        return float(row[names.index("lower_m")])

    assert lower("--model", "truth") == lower() > lower("--model", "pieces") + 0.005
    done = subprocess.run([PROGRAM, "query", "--model", "hull"], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode != 0 and "--model" in done.stderr


URDF = """<robot name="arm"><link name="base"/><link name="hand">
<collision><origin xyz="0.1 0 0" rpy="0 0.5 0"/><geometry><mesh filename="bracket.obj"/></geometry></collision>
<collision><origin xyz="-0.2 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_links_of_robots(scene):
    (scene.parent / "arm.urdf").write_text(URDF)
    robot = "robots:\n  - {name: arm, urdf: arm.urdf, mesh_as: decompose, home: {turn: 0}}\n"
    path = scene.parent / "arm.yaml"
    path.write_text(robot + "bodies:\n  - {name: ball, sphere: 0.1, pose: [0.6,0.25,0.6, 1,0,0,0]}\n")
    engine = clearance.Engine(clearance.Scene.load(path), threads=1)
    turns = np.linspace(-3, 3, 61)[:, None]
    requested = {"pairs": [("arm/hand", "ball")], "joints": "arm"}
    exact_value = engine.distances(configurations=turns, **requested)
    pieces = engine.prepare("distances", model="pieces", **requested).run(turns)
    assert (pieces.lower <= exact_value.lower + 1e-9).all() and (exact_value.upper <= pieces.upper + 1e-9).all()
    apart = exact_value.lower > 0.05
    assert apart.sum() > 20 and (exact_value.status == Status.OVERLAP).sum() > 3
    assert (pieces.upper - pieces.lower)[apart].min() > 0.5 * SHRUNK
    assert (exact_value.upper - exact_value.lower).max() < 1e-5
    free, wider = (engine.prepare("check", model=m, **requested).run(turns).free for m in ("truth", "pieces"))
    assert (wider <= free).all() and wider.sum() > 20
    at_truth, at_pieces = (engine.prepare("free_scale", model=m, **requested).run(turns) for m in ("truth", "pieces"))
    assert (at_pieces[~wider] == 0).all() and (at_pieces[apart[:, 0]] > 0).all() and (at_truth[free] > 0).all()
    for start, end in ((0, 8), (20, 30)):
        least = engine.prepare("motions", model="pieces", **requested).run(turns[[start]], turns[[end]])
        assert least.lower[0] <= exact_value.upper[start : end + 1].min() and least.lower[0] <= least.upper[0]


def test_beside_clouds_whose_points_are_replaced(scene):
    scene.write_text(SCENE + "  - {name: seen, points: [], pose: [0,0,0, 1,0,0,0]}\n")
    engine = clearance.Engine(clearance.Scene.load(scene), threads=1)

    def interval(model):
        answer = engine.prepare("distances", pairs=[("bracket", "seen")], model=model).run()
        return answer.lower[0], answer.upper[0], answer.status[0]

    assert interval("pieces")[2] == Status.BEYOND  # nothing is there
    engine.set_points("seen", np.array([[0.6, 0.25, 0.5], [5, 5, 5]], np.float32))
    for model, least, most in (("truth", 0.0, 1e-6), ("pieces", SHRUNK, 0.03)):
        low, high, status = interval(model)
        assert low <= 0.25 <= high and least <= high - low <= most and status == Status.OK
    engine.set_points("seen", np.zeros((0, 3), np.float32))
    assert interval("pieces")[2] == Status.BEYOND
    with pytest.raises(clearance.QueryError, match="'seen' is a cloud of points"):
        engine.prepare("distances", pairs=[("bracket", "seen")], model="pieces", signed_distance=True).run()
