"""Jobs of sweeps: errors of invalid ones, and rows that depend on their number alone."""

import importlib
import itertools
import json
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

import clearance.sweep
from clearance.sweep import Job, JobError
from clearance.sweep._generators import ArrayFile, Box, Grid, Halton, ParquetFile, Uniform
from clearance.sweep._plan import _space, _spec
from clearance.sweep._scenes import pack, unpack
from clearance.sweep._work import Worker, answer
from patience import PATIENCE_S
from sweeps import arm_job, motion_job

EDGES = {"edges": {"of": {"uniform": {"count": 50}}, "nearest": 3}}

# Keys that replace those of a valid job (None removes the key), and the texts of the error, in order.
BAD = {
    "no scene": ({"scene": None}, ["the job: expected one of scene, robot", "none"]),
    "both": ({"robot": {"urdf": "arm.urdf"}}, ["expected one of scene, robot", "scene and robot"]),
    "file": ({"scene": "nothing.yaml"}, ["scene: there is no file", "nothing.yaml"]),
    "scene word": ({"scene": 7}, ["scene: expected a path", "got 7"]),
    "robot": ({"scene": None, "robot": {"srdf": "arm.urdf"}}, ["robot.urdf: is required"]),
    "robot map": ({"scene": None, "robot": "arm.urdf"}, ["robot: expected a map", "'arm.urdf'"]),
    "key": ({"row": {}}, ["row: there is no such key; did you mean 'rows'"]),
    "rows": ({"rows": None}, ["rows: is required"]),
    "rows kind": ({"rows": {"sobol": {"count": 5}}}, ["rows.sobol: there is no such key; there are uniform, halton"]),
    "two kinds": ({"rows": {"uniform": {}, "grid": {}}}, ["rows: expected one of uniform", "uniform and grid"]),
    "count": ({"rows": {"uniform": {"count": 0}}}, ["rows.uniform.count: expected an integer >= 1, got 0"]),
    "no count": ({"rows": {"halton": {}}}, ["rows.halton.count: is required"]),
    "huge": ({"rows": {"uniform": {"count": 1 << 60}}}, ["rows.uniform.count: expected fewer than 2**53 rows"]),
    "seed": ({"rows": {"uniform": {"count": 5, "seed": 1.5}}}, ["rows.uniform.seed: expected an integer, got 1.5"]),
    "near key": ({"rows": {"uniform": {"counts": 5}}}, ["rows.uniform.count: is required"]),
    "grid": ({"rows": {"grid": {"counts": [2, 0]}}}, ["rows.grid.counts[1]: expected an integer >= 1, got 0"]),
    "file kind": ({"rows": {"file": {"path": "a.csv"}}}, ["rows.file.path: expected a file that ends in .npy"]),
    "no file": ({"rows": {"file": {"path": "a.npy"}}}, ["rows.file.path: there is no file"]),
    "nearest": ({"rows": {"edges": {"of": EDGES["edges"]["of"]}}}, ["rows.edges.nearest: is required"]),
    "edges of": ({"rows": {"edges": {"of": EDGES, "nearest": 1}}}, ["rows.edges.of.edges: there is no such key"]),
    "joints": ({"joints": []}, ["joints: expected at least one name"]),
    "joints kind": ({"joints": [1]}, ["joints[0]: expected a string, got 1"]),
    "bodies": ({"joints": None, "bodies": ["cup"]}, ["rows.uniform: draws positions of joints", "expected file"]),
    "limits": ({"limits": {"arm/joint1": [1, 0]}}, ["limits.arm/joint1: expected two finite numbers, lower <= upper"]),
    "limits map": ({"limits": [1, 2]}, ["limits: expected a map of [lower, upper] by joint"]),
    "answer": ({"answer": "leest"}, ["answer: expected 'validity' or 'least', got 'leest'; did you mean 'least'"]),
    "columns": ({"columns": ["free", "normal"]}, ["columns[1]: expected 'free' or 'status'", "got 'normal'"]),
    "twice": ({"columns": ["free", "free"]}, ["columns[1]: 'free' is named twice"]),
    "margin": ({"margin": -1}, ["margin: expected a finite number >= 0, got -1"]),
    "margin list": ({"margin": [["arm", "cup"]]}, ["margin[0]: expected [a, b, metres]"]),
    "margin least": ({"answer": "least", "margin": 0.1}, ["margin: needs answer: validity, or motions"]),
    "cut-off": ({"max_distance": 1.0}, ["max_distance: does not apply to answer: validity"]),
    "steps": ({"max_evaluations": 5}, ["max_evaluations: is only for motions, but these rows are configurations"]),
    "pairs": ({"pairs": [["arm"]]}, ["pairs[0]: expected two names of bodies or groups, got 1"]),
    "part": ({"part_rows": 0}, ["part_rows: expected an integer >= 1, got 0"]),
    "check": ({"check": 1.5}, ["check: expected a number from 0 to 1, got 1.5"]),
    "positions": ({"positions": "yes"}, ["positions: expected True or False, got 'yes'"]),
}  # fmt: skip


@pytest.fixture
def good(tmp_path, urdf):
    return arm_job(tmp_path, urdf)


def with_keys(job, changes):
    return {key: value for key, value in {**job, **changes}.items() if value is not None}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_job_is_told_file_key_and_what_is_allowed(name, good, tmp_path):
    changes, parts = BAD[name]
    Job.from_dict(good, tmp_path, "reach.yaml")  # valid without them
    with pytest.raises(JobError) as caught:
        Job.from_dict(with_keys(good, changes), tmp_path, "reach.yaml")
    text, place = str(caught.value), 0
    assert text.startswith("reach.yaml: ")
    for part in parts:
        assert part in text[place:], text
        place = text.index(part, place) + len(part)


def test_files_that_are_no_jobs(tmp_path):
    (tmp_path / "job.json").write_text("{")
    (tmp_path / "list.json").write_text("[]")
    said = {"job.json": "is not JSON", "list.json": "expected a map, got []", "no.json": "cannot be read: No such file"}
    for name, text in said.items():
        with pytest.raises(JobError) as caught:
            Job.load(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}: ") and text in str(caught.value)


def test_yaml_is_read_and_refused(tmp_path, good):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed; make test-extras EXTRAS=ray has it")
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(good))
    assert Job.load(tmp_path / "job.yaml").said == {key: value for key, value in good.items() if key != "output"}
    (tmp_path / "bad.yaml").write_text("a: [")
    with pytest.raises(JobError, match=r"bad.yaml: is not YAML: .*line 1"):
        Job.load(tmp_path / "bad.yaml")


#: Errors that only a scene can show.
BAD_WITH_SCENE = {
    "joint": ({"joints": ["arm/joint9"]}, "joints: group[0]: no joint is named 'arm/joint9'; did you mean"),
    "limits": ({"limits": {"arm/joint7": [0, 1]}}, "limits.arm/joint7: is not a joint of this job; there are arm/j"),
    "pairs": ({"pairs": ["arm", "cap"]}, "pairs[0][1]: no body or group is named 'cap'; did"),
    "grid": ({"rows": {"grid": {"counts": [3, 3]}}}, "grid.counts: expected one for each of 4 joints, got 2"),
    "body": ({"joints": None, "bodies": ["cap"], "rows": {"file": {"path": "poses.npy"}}}, "bodies: name: no body is"),
    "width": ({"rows": {"file": {"path": "poses.npy"}}}, "rows.file: expected floating-point rows of 4 numbers"),
    "nearest": ({"rows": {"edges": {"of": {"uniform": {"count": 3}}, "nearest": 3}}}, "nearest: expected fewer than"),
    "output": ({"output": "scene.yaml"}, "scene.yaml is not a folder"),
    "no output": ({"output": None}, "output: is required"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_WITH_SCENE)
def test_a_job_that_does_not_fit_its_scene_is_told(name, good, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed; make test-extras EXTRAS=ray has it")
    pytest.importorskip("scipy", reason="scipy is not installed; make test-extras EXTRAS=ray has it")
    np.save(tmp_path / "poses.npy", np.tile([0, 0, 0, 1.0, 0, 0, 0], (5, 1)))
    changes, text = BAD_WITH_SCENE[name]
    with pytest.raises(JobError) as caught:
        clearance.sweep.prepare(Job.from_dict(with_keys(good, changes), tmp_path, "reach.yaml"))
    assert str(caught.value).startswith("reach.yaml: ") and text in str(caught.value)


def test_a_scene_whose_bounds_grow_with_age_is_refused(good, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed; make test-extras EXTRAS=ray has it")
    job = Job.from_dict(good, tmp_path, "reach.yaml")
    scene = (tmp_path / "scene.yaml").read_text()
    (tmp_path / "scene.yaml").write_text(scene.replace("sphere: 0.05", "sphere: 0.05, max_speed: 1"))
    with pytest.raises(JobError, match="'cup' has max_speed"):
        clearance.sweep.prepare(job)


def test_the_command_says_what_is_wrong_with_a_job(tmp_path, good):
    (tmp_path / "job.json").write_text(json.dumps({**good, "answer": "all"}))
    done = subprocess.run(
        [sys.executable, "-m", "clearance.sweep", str(tmp_path / "job.json")], capture_output=True, text=True
    )
    assert done.returncode == 2 and not done.stdout
    assert done.stderr.startswith(f"clearance sweep: {tmp_path / 'job.json'}: answer: expected 'validity' or 'least'")


def test_the_wheels_command_runs_it_as_python(tmp_path, root, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(root / "client/python"))
    programs = importlib.import_module("_clearance_programs")
    monkeypatch.setattr(sys, "argv", ["clearance", "sweep", str(tmp_path / "none.json")])
    with pytest.raises(SystemExit) as end:
        programs.clearance()
    assert end.value.code == 2 and "none.json: the job cannot be read" in capsys.readouterr().err


# ---- rows ------------------------------------------------------------------------------------------------------------

BOX = Box(np.array([-1.0, 0.0, 2.0]), np.array([1.0, 0.5, 2.0]))
RANDOM_ACCESS = [Uniform(BOX, 5000, 7), Halton(BOX, 5000, 3), Grid(BOX, (20, 25, 10))]


@pytest.mark.parametrize("rows", RANDOM_ACCESS, ids=lambda rows: type(rows).__name__)
def test_a_row_depends_on_its_number_alone(rows):
    assert rows.count == 5000 and rows.width == 3 and not rows.motions
    whole = rows.at(np.arange(5000))
    assert whole.shape == (5000, 3) and (whole >= BOX.lower).all() and (whole <= BOX.upper).all()
    rng = np.random.default_rng(1)
    for _ in range(20):
        index = rng.integers(0, 5000, rng.integers(1, 300))
        assert rows.at(index).tobytes() == whole[index].tobytes()
    assert len(np.unique(whole[:, :2], axis=0)) == (500 if isinstance(rows, Grid) else 5000)


def test_uniform_is_split_mix_64():
    """By Python integers: the finaliser twice, of the seed and of the count."""
    gamma, bits = 0x9E3779B97F4A7C15, (1 << 64) - 1

    def mixed(z):
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & bits
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB & bits
        return z ^ (z >> 31)

    # The generator itself, checked with its published first numbers for the seed 1234567.
    assert [mixed(1234567 + (i + 1) * gamma & bits) for i in range(2)] == [6457827717110365317, 3203168211198807973]
    unit = Uniform(Box(np.zeros(2), np.ones(2)), 1 << 50, 99)
    far = (1 << 50) - 1
    for row, joint in itertools.product((0, 1, 123456789, far), (0, 1)):
        number = mixed(mixed(99 + gamma & bits) + (2 * row + joint + 1) * gamma & bits)
        assert unit.at(np.array([row]))[0, joint] == (number >> 11) * 2.0**-53
    values = unit.at(np.arange(100000)).ravel()
    assert abs(values.mean() - 0.5) < 0.005 and abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 0.01


def test_halton_is_the_radical_inverse():
    unit = Halton(Box(np.zeros(5), np.ones(5)), 10**12, 0)
    for row in (0, 1, 2, 1000, 10**9, 10**12 - 1):
        for prime, value in zip((2, 3, 5, 7, 11), unit.at(np.array([row, 5]))[0]):
            exact, scale, rest = Fraction(0), Fraction(1), row + 1
            while rest:
                rest, digit = divmod(rest, prime)
                scale /= prime
                exact += digit * scale
            assert abs(Fraction(float(value)) - exact) <= exact * Fraction(1, 1 << 53)


def test_a_grid_is_every_combination_with_both_limits():
    grid = Grid(BOX, (3, 2, 1))
    assert grid.at(np.arange(6)).tolist() == [list(row) for row in itertools.product((-1, 0, 1), (0, 0.5), (2,))]


def test_rows_of_files(tmp_path):
    rows = np.random.default_rng(2).normal(size=(100, 2, 3))
    np.save(tmp_path / "rows.npy", rows)
    index = np.array([99, 3, 3, 50])
    assert ArrayFile(tmp_path / "rows.npy", 3, True, "rows").at(index).tobytes() == rows[index].tobytes()
    pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed; make test-extras EXTRAS=ray has it")
    import pyarrow.parquet as pq

    table = pa.table({name: rows[:, 0, i] for i, name in enumerate("xyz")} | {"word": ["a"] * 100})
    pq.write_table(table, tmp_path / "rows.parquet", row_group_size=7)
    file = ParquetFile(tmp_path / "rows.parquet", 3, False, "rows", ["z", "x", "y"])
    assert file.at(index).tobytes() == rows[index, 0][:, [2, 0, 1]].tobytes()
    with pytest.raises(JobError, match="no column 'q'; there are x, y, z, word"):
        ParquetFile(tmp_path / "rows.parquet", 1, False, "rows", ["q"])
    with pytest.raises(JobError, match="column 'word' is string"):
        ParquetFile(tmp_path / "rows.parquet", 1, False, "rows", ["word"])
    with pytest.raises(JobError, match="expected 2 columns, got 3: x, y, z"):
        ParquetFile(tmp_path / "rows.parquet", 2, False, "rows", ["x", "y", "z"])


def test_edges_are_those_of_the_nearest(tmp_path):
    pytest.importorskip("scipy", reason="scipy is not installed; make test-extras EXTRAS=ray has it")
    from clearance.sweep._edges import Edges, write_edges

    nodes = Uniform(BOX, 300, 4)
    places = nodes.at(np.arange(300))
    far = np.linalg.norm(places[:, None] - places, axis=2)
    order = np.argsort(far, axis=1)[:, 1:5]
    near = {tuple(sorted((i, int(j)))) for i in range(300) for j in order[i] if far[i, j] <= 0.15}
    assert 300 < len(near) < 1200  # some beyond the radius, some named by both of their nodes
    write_edges(nodes, 4, 0.15, tmp_path / "edges.npy", "rows.edges")
    edges = Edges(nodes, tmp_path / "edges.npy")
    assert [tuple(pair) for pair in np.load(tmp_path / "edges.npy").tolist()] == sorted(near)
    pairs = np.array(sorted(near))
    assert edges.motions and edges.at(np.arange(edges.count)).tobytes() == places[pairs].tobytes()


def test_bits_of_rows_depend_neither_on_covers_nor_on_the_batch(tmp_path, urdf):
    made = arm_job(tmp_path, urdf, answer="least")
    packed, index = pack(clearance.Scene.load(tmp_path / "scene.yaml")), np.arange(400)
    with_covers = clearance.Engine(unpack(packed), threads=1)
    assert with_covers.wait_covers(PATIENCE_S)
    for tolerance in ({}, {"abs_tol": 0.02}, {"rel_tol": 0.05}):
        job = Job.from_dict({**made, **tolerance}, tmp_path)
        space = _space(job, with_covers)
        spec = _spec(job, job.rows.rows(space, tmp_path), space, tmp_path)
        engine = Worker(spec, packed).engine
        first = bits_of(engine, spec, index)
        assert engine.wait_covers(PATIENCE_S)
        np.testing.assert_array_equal(bits_of(engine, spec, index), first)
        np.testing.assert_array_equal(bits_of(engine, spec, index[7:8]), first[7:8])
        differs = (bits_of(with_covers, spec, index) != first).any()
        assert differs == bool(tolerance), "covers answer at wide tolerances alone"


def test_rows_of_validity_have_all_covers(tmp_path, urdf):
    made = motion_job(tmp_path, urdf, parts=1, part_rows=400, margin=0.03, max_evaluations=1)
    job = Job.from_dict({**made, "answer": "validity"}, tmp_path)
    packed, index = pack(clearance.Scene.load(tmp_path / "scene.yaml")), np.arange(400)
    without = clearance.Engine(unpack(packed), threads=1, covers="off")
    space = _space(job, without)
    spec = _spec(job, job.rows.rows(space, tmp_path), space, tmp_path)
    worker = Worker(spec, packed).engine
    first = answer(worker, spec, index)
    assert worker.stats()["engine.covers"] > 0 and worker.wait_covers(0)
    assert (first["free"] != answer(without, spec, index)["free"]).sum() > 10, "covers decide what is unresolved"
    for rows in (index, index[7:8]):
        again = answer(worker, spec, rows)
        for name, column in again.items():
            np.testing.assert_array_equal(column, first[name][rows], err_msg=name)


@pytest.mark.parametrize("keys, states", [({}, 256), ({"answer": "least"}, 3)])
def test_few_states_of_validity_are_enough_for_covers(tmp_path, urdf, monkeypatch, keys, states):
    job = Job.from_dict(arm_job(tmp_path, urdf, **keys), tmp_path)
    packed = pack(clearance.Scene.load(tmp_path / "scene.yaml"))
    engine = clearance.Engine(unpack(packed), threads=1, covers="off")
    space, counts, distances = _space(job, engine), [], engine.distances

    def counting(**requested):
        counts.append(len(requested["configurations"]))
        return distances(**requested)

    monkeypatch.setattr(engine, "distances", counting)
    spec = _spec(job, job.rows.rows(space, tmp_path), space, tmp_path)
    few, all_rows = answer(engine, spec, np.arange(5, 8)), answer(engine, spec, np.arange(300))
    assert counts == [states, 300]
    for name, column in few.items():
        np.testing.assert_array_equal(column, all_rows[name][5:8], err_msg=name)


def bits_of(engine, spec, index):
    columns = answer(engine, spec, index)
    return np.stack([columns["lower"], columns["upper"]], axis=1).view(np.uint64)
