"""Motions: the least distance throughout, in process and through a daemon on every transport."""

import json
import subprocess
import sys

import numpy as np
import pytest

import clearance
from clearance import Status
from patience import PATIENCE_S
from robots import arm_scene, rows_of
from scenes import at, same_bits

TIMES = np.linspace(0, 1, 65)  # 1/64 is exact


@pytest.fixture
def engine(arm_engine):
    return arm_engine


#: The arm touches itself nearly everywhere.
PAIRS = [("arm", "cup"), ("arm/palm", "table"), ("arm/fore", "table")]


def edges_of(arm, count, length=2.0, seed=3):
    rng = np.random.default_rng(seed)
    start = rows_of(arm, count, seed)
    way = rng.normal(size=start.shape)
    return start, start + length * way / np.linalg.norm(way, axis=1, keepdims=True)


def along(start, end, t):
    return start + t * (end - start)


def test_the_least_distance_of_a_motion_is_in_its_bounds(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 24)
    r = engine.motions(start, end, joints=arm, pairs=PAIRS, abs_tol=1e-3)
    assert r.lower.shape == (24,) and r.first_contact.shape == (24, 2) and r.steps.dtype == np.uint32
    assert set(r.status) >= {Status.OK, Status.OVERLAP}, "free motions and others"
    for k in range(24):
        rows = np.array([along(start[k], end[k], t) for t in TIMES])
        sampled = engine.distances(joints=arm, configurations=rows, pairs=PAIRS, reduce="min", fields=["upper"])
        assert r.lower[k] <= sampled.upper.min()
        assert r.upper[k] - r.lower[k] <= 1e-3 or r.status[k] != Status.OK
        if not np.isnan(r.time[k]):
            there = engine.distances(
                joints=arm, configurations=along(start[k], end[k], r.time[k])[None], pairs=r.pairs[k : k + 1]
            )
            assert there.lower[0, 0] <= r.upper[k] + 1e-12
        assert r.steps[k] >= 1


def test_any_decides_and_names_when(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 40)
    fields = ("status", "pair", "time", "first_contact")
    r = engine.motions(start, end, joints=arm, pairs=PAIRS, reduce="any", margin=0.01, fields=fields)
    free = r.status == Status.BEYOND
    hit = r.status <= Status.CONTACT
    assert free.sum() >= 5 and hit.sum() >= 5
    assert np.all(np.isinf(r.first_contact[free])) and np.all(r.pair[free] == clearance.NONE)
    for k in np.flatnonzero(hit):
        row = along(start[k], end[k], r.time[k])[None]
        there = engine.distances(joints=arm, configurations=row, pairs=r.pairs[k : k + 1])
        assert there.lower[0, 0] <= 0.01 + 1e-9
    for k in np.flatnonzero(free):
        rows = np.array([along(start[k], end[k], t) for t in TIMES])
        assert engine.check(rows, joints=arm, margin=0.01, pairs=PAIRS).free.all()


def test_a_decision_has_the_columns_that_cost_nothing_more(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 20)
    options = dict(joints=arm, start=start, end=end, pairs=PAIRS)
    decided = engine.motions(reduce="any", **options)
    assert set(decided.columns) == {"status", "verdict", "flags", "pair", "time"}
    assert (decided.status == Status.BEYOND).any() and (decided.status <= Status.CONTACT).any()
    assert {"lower", "upper", "time", "first_contact", "steps"} < set(engine.motions(**options).columns)


def test_a_decision_has_tolerances_that_decide(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 60)
    options = dict(joints=arm, start=start, end=end, pairs=PAIRS, reduce="any")
    r = engine.motions(**options)
    assert same_bits(r, engine.motions(abs_tol=0.0, rel_tol=1e-6, **options))
    assert not (r.status == Status.UNCONVERGED).any()
    least = {"joints": arm, "start": start, "end": end, "pairs": PAIRS}
    assert same_bits(engine.motions(**least), engine.motions(abs_tol=1e-3, rel_tol=0.0, **least))


def test_a_path_whose_search_ends_early_is_not_free():
    """A ball circles a post at 0.1 um, and penetrates an obstacle by 4 cm at 0.8 of its path."""
    scene = clearance.Scene()
    scene.add_sphere("post", 0.95 - 1e-7, static=True, pose=at(0, 0, 0))
    scene.add_sphere("obstacle", 0.03, static=True, pose=at(1.04 * np.cos(2.4), 1.04 * np.sin(2.4), 0))
    scene.add_sphere("arm", 0.001, pose=at(0, 0, 5))
    scene.add_sphere("ball", 0.05, parent="arm", pose=at(1, 0, -5))
    engine = clearance.Engine(scene, threads=1, covers="off")
    path = [[at(0, 0, 5)], [[0, 0, 5, np.cos(1.5), 0, 0, np.sin(1.5)]]]
    pairs = [("ball", "post"), ("ball", "obstacle")]
    for steps in (1, 2, 3, 64, 256):
        r = engine.check_path(path, bodies=["arm"], pairs=pairs, max_evaluations=steps)
        assert not r.free and r.status == Status.UNCONVERGED, steps
    assert engine.check_path(path, bodies=["arm"], pairs=pairs[1:]).status == Status.OVERLAP


def test_a_plate_between_two_samples_is_found():
    scene = clearance.Scene()
    scene.add_box("plate", [1e-4, 1, 1], static=True, pose=at(0.5034, 0, 0))
    scene.add_sphere("ball", 1e-3)
    engine = clearance.Engine(scene, threads=1, covers="off")
    start, end = (np.array(at(x), dtype=float)[None, None] for x in (0, 1))
    samples = np.linspace(0, 1, 33)[:, None, None] * (end[0] - start[0]) + start[0]
    assert engine.check(samples, bodies=["ball"]).free.all(), "what sampling says"
    r = engine.motions(start, end, bodies=["ball"], reduce="any")
    assert r.status[0] <= Status.CONTACT and abs(r.time[0] - 0.5034) < 2e-3
    least = engine.motions(start, end, bodies=["ball"])
    assert least.status[0] == Status.OVERLAP and least.upper[0] <= 0
    first = least.first_contact[0]
    assert first[0] <= 0.5034 - 1e-3 - 5e-5 + 1e-9 and first[1] >= first[0]


def test_each_pair_has_a_row_without_a_reduction(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 3)
    pairs = [("arm/palm", "table"), ("arm/fore", "table")]
    each = engine.motions(start, end, joints=arm, pairs=pairs, reduce="none")
    least = engine.motions(start, end, joints=arm, pairs=pairs)
    assert each.lower.shape == (3, 2) and each.time.shape == (3, 2)
    apart = least.status == Status.OK
    assert apart.any()
    assert np.all(np.abs(each.upper.min(axis=1) - least.upper)[apart] <= 2e-3)


def test_a_path_ends_at_its_first_bad_motion(engine):
    arm = engine.joints("arm")
    start, end = edges_of(arm, 40)
    free = engine.motions(start, end, joints=arm, pairs=PAIRS, reduce="any").status == Status.BEYOND
    good, bad = np.flatnonzero(free)[0], np.flatnonzero(~free)[0]
    there_and_back = [start[good], end[good]] * 15
    ok = engine.check_path(there_and_back, joints=arm, pairs=PAIRS)
    assert ok.free and ok.index is None and ok.status == Status.BEYOND and not ok.hit
    r = engine.check_path([*there_and_back, start[bad], end[bad]], joints=arm, pairs=PAIRS)
    assert not r.free and r.index in (29, 30) and 0 <= r.t <= 1 and len(r.pair) == 2


def test_a_daemon_answers_as_the_engine_does(arm_daemon, kind, engine):
    with clearance.connect(arm_daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        arm = client.joints("arm")
        start, end = edges_of(arm, 6)
        for more in ({}, {"reduce": "any", "margin": 0.01}, {"reduce": "none"}):
            expected = engine.motions(start, end, joints=arm, pairs=PAIRS, **more)
            assert same_bits(client.motions(start, end, joints=arm, pairs=PAIRS, **more), expected)
        path = {"path": start, "joints": arm, "pairs": PAIRS, "margin": 0.01}
        assert client.check_path(**path) == engine.check_path(**path)


def test_the_command_says_where_a_path_is_not_free(arm_daemon, engine, root, tmp_path):
    arm = engine.joints("arm")
    start, end = (np.clip(rows, arm.lower, arm.upper) for rows in edges_of(arm, 40))
    free = engine.motions(start, end, joints=arm, pairs=PAIRS, reduce="any").status == Status.BEYOND
    file = tmp_path / "path.csv"

    def run(rows, *more, names=arm.names):
        file.write_text("\n".join([",".join(names), *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n")
        command = [
            root / "build/bin/clearance",
            "path",
            file,
            "--pairs",
            *(",".join(p) for p in PAIRS),
            "--connect",
            next(iter(arm_daemon.urls.values())),
            *more,
        ]
        return subprocess.run(command, capture_output=True, text=True)

    good, bad = np.flatnonzero(free)[0], np.flatnonzero(~free)[0]
    done = run([start[good], end[good]])
    assert done.returncode == 0 and done.stdout.startswith("free: on all 1 motions"), done
    done = run([start[bad], end[bad]])
    assert done.returncode == 1 and "path.csv:2: motion 0, to line 3: " in done.stderr, done
    proofs = tmp_path / "proofs.json"
    check = [sys.executable, root / "tools" / "check_certificate.py", proofs]
    for rows, code in (([start[good], end[good], start[good]], 0), ([start[good], end[good], start[bad], end[bad]], 1)):
        done = run(rows, "--certificate", proofs)
        made = json.loads(proofs.read_text())["rows"]
        assert done.returncode == code and {row["status"] for row in made[: len(made) - code]} == {"beyond"}
        hit = made[-1]["first_contact"]["hit_at"]
        assert (hit == "inf") if code == 0 else (hit <= 1 and f"motion {len(made) - 1}, " in done.stderr), done
        said = subprocess.run(check, capture_output=True, text=True)
        assert said.returncode == 0 and f"{len(made)} of {len(made)} rows are proved" in said.stdout, said
    done = run([start[good], end[good]], "--certificate", tmp_path / "none" / "proofs.json")
    assert done.returncode == 2 and "proofs.json: cannot be written" in done.stderr
    done = run([start[good]])
    assert done.returncode == 2 and "two waypoints or more, got 1" in done.stderr
    done = run([start[good]], names=["nonesuch"])
    assert done.returncode == 2 and "path.csv:2: expected 1 numbers" in done.stderr


@pytest.mark.skipif("cuda" not in clearance.Engine.backends(), reason="no CUDA device")
def test_a_device_answers_the_default_columns(urdf):
    device, cpu = (clearance.Engine(arm_scene(urdf), backend=backend, covers="off") for backend in ("cuda", "cpu"))
    arm = cpu.joints("arm")
    start, end = edges_of(arm, 2000)
    for margin in (0.0, 0.01):
        requested = {"joints": arm, "start": start, "end": end, "pairs": PAIRS, "reduce": "any", "margin": margin}
        ours, theirs = device.motions(**requested), cpu.motions(**requested)
        assert ours.backend == "cuda"
        assert np.mean((ours.status == Status.BEYOND) == (theirs.status == Status.BEYOND)) > 0.999, "undecided aside"
        (until, hit), (until_there, hit_there) = ours.first_contact.T, theirs.first_contact.T
        assert np.all(until <= hit_there) and np.all(until_there <= hit), "both hold the time of first contact"
        decided = np.isfinite(hit)
        assert 100 < decided.sum() < 1900 and np.all(hit[decided] - until[decided] <= 2**-10)
        assert np.all(ours.lower <= theirs.upper) and np.all(ours.steps > 0)
    path = device.check_path([start[0], end[0], start[0]], joints=arm, pairs=PAIRS)
    assert path.free == cpu.check_path([start[0], end[0], start[0]], joints=arm, pairs=PAIRS).free


ONE = np.zeros((1, 8))
WRONG = {
    r"start: expected .* got none": {"joints": "arm", "start": None, "end": ONE},
    r"end: expected shape \(1, 8\), as start has, got \(2, 8\)": {
        "joints": "arm",
        "start": ONE,
        "end": np.zeros((2, 8)),
    },
    r"start: expected shape \(K, 8\), one column for each joint, got \(8,\)": {
        "joints": "arm",
        "start": ONE[0],
        "end": ONE,
    },
    r"start: expected a pair \(positions, poses\)": {"joints": "arm", "bodies": ["cup"], "start": ONE, "end": ONE},
    "reduce: motions are reduced by none, min and any": {
        "joints": "arm",
        "start": ONE,
        "end": ONE,
        "reduce": "nearest",
    },
    "fields: motions have no gradient": {"joints": "arm", "start": ONE, "end": ONE, "fields": ["gradient"]},
    "margin": {"joints": "arm", "start": ONE, "end": ONE, "margin": -1.0},
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_arguments_are_named(engine, text):
    with pytest.raises((ValueError, TypeError, clearance.QueryError), match=text):
        engine.motions(**WRONG[text])


def test_columns_of_motions_are_for_motions(engine):
    with pytest.raises(clearance.QueryError, match="fields: time, first_contact and steps are only for motions"):
        engine.distances(fields=["time"])
    with pytest.raises(ValueError, match="path: expected two waypoints or more, got 1"):
        engine.check_path(ONE, joints="arm")


def test_bodies_that_are_not_convex_are_answered_as_they_are(tmp_path):
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]  # an L, 1 m thick
    lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in corners]
    for a, b, c in ((1, 2, 3), (1, 3, 4), (1, 4, 6), (4, 5, 6)):
        lines += [f"f {c} {b} {a}", f"f {a + 6} {b + 6} {c + 6}"]
    for i in range(1, 7):
        j = i % 6 + 1
        lines += [f"f {i} {j} {j + 6}", f"f {i} {j + 6} {i + 6}"]
    path = tmp_path / "l.obj"
    path.write_text("\n".join(lines) + "\n")
    start, end = [1.6, 3, 0.5, 1, 0, 0, 0], [1.6, 1.2, 0.5, 1, 0, 0, 0]  # into the hull, not into the L
    for kind, status in (("solid", Status.OK), ("surface", Status.OK), ("hull", Status.OVERLAP)):
        scene = clearance.Scene()
        scene.add_mesh("shelf", path, mesh_as=kind, pose=[0, 0, 0, 1, 0, 0, 0])
        scene.add_sphere("ball", 0.1, pose=start)
        engine = clearance.Engine(scene, backend="cpu", threads=1, covers="off")
        r = engine.motions(np.array([[start]]), np.array([[end]]), bodies=["ball"])
        assert r.status[0] == status, kind
        assert kind == "hull" or r.lower[0] <= 0.1 <= r.upper[0]
        free = engine.motions(np.array([[start]]), np.array([[end]]), bodies=["ball"], reduce="any", margin=0.09)
        assert (free.status[0] == Status.BEYOND) == (kind != "hull")
