"""Sweeps on this machine: the same rows as in process, byte for byte, for any workers and after any kills."""

import contextlib
import importlib.util
import json
import os
import random
import signal

import numpy as np
import pytest

import clearance
from clearance.sweep import Job, SweepError, prepare, run
from clearance.sweep._job import columns_of
from clearance.sweep._parts import part_name
from clearance.sweep._progress import Progress
from clearance.sweep._run import DEPTH, drive
from clearance.sweep._work import Done, Failed, Part, Worker
from sweeps import (
    InProcess,
    arm_job,
    finish,
    journal_of,
    kill,
    motion_job,
    parts_done,
    result_of,
    start,
    table_of,
    until,
    workers_of,
)

pytestmark = pytest.mark.skipif(
    not importlib.util.find_spec("pyarrow"), reason="pyarrow is not installed; make test-extras EXTRAS=ray has it"
)
LEAST = ["lower", "upper", "distance", "status", "flags", "pair", "pair_lower", "point_a", "point_b", "normal",
         "gradient", "gradient_joints"]  # fmt: skip


def done(job, folder, **options):
    run(Job.from_dict(job, folder), **options)
    return result_of(folder / "result")


def engine_of(folder):
    return clearance.Engine(clearance.Scene.load(folder / "scene.yaml"), threads=1)


# ---- results ---------------------------------------------------------------------------------------------------------


def test_rows_are_those_of_the_engine_in_process(tmp_path, urdf):
    job = arm_job(tmp_path, urdf, answer="least", columns=LEAST, positions=True)
    done(job, tmp_path, workers=2)
    table, engine = table_of(tmp_path / "result"), engine_of(tmp_path)
    assert table["row"].tolist() == list(range(1000))
    joints = engine.joints(job["joints"])
    rows = np.stack([table[f"position_{i}"] for i in range(4)], axis=1)
    assert (rows >= joints.lower).all() and (rows <= joints.upper).all()
    r = engine.distances(job["pairs"], joints=joints, configurations=rows, reduce="min", fields=LEAST)
    assert len(set(r.status.tolist())) > 1
    for name in LEAST:
        column = getattr(r, name)
        held = [table[each] for each in columns_of(name, column.shape[1:])]
        assert np.stack(held, axis=1).tobytes() == column.reshape(1000, -1).tobytes(), name


def test_validity_is_what_check_says(tmp_path, urdf):
    done(arm_job(tmp_path, urdf, margin=[["arm", "*", 0.03]], positions=True), tmp_path, workers=1)
    table = table_of(tmp_path / "result")
    rows = np.stack([table[f"position_{i}"] for i in range(4)], axis=1)
    joints = [f"arm/joint{i}" for i in range(1, 5)]
    pairs = [("arm", "table"), ("arm", "cup")]
    engine, requested = engine_of(tmp_path), {"margin": {("arm", "*"): 0.03}, "pairs": pairs, "joints": joints}
    check = engine.check(rows, **requested)
    assert table["free"].tolist() == check.free.tolist() and 100 < check.free.sum() < 990
    status = engine.distances(configurations=rows, reduce="any", fields="status", **requested).status
    assert table["status"].tolist() == status.tolist() and clearance.Status.OVERLAP in status
    assert np.stack([table["pair_a"], table["pair_b"]], axis=1).tolist() == check.pair.tolist()


def test_motions_and_bodies(tmp_path, urdf):
    job = motion_job(tmp_path, urdf, parts=3)
    done({**job, "columns": ["lower", "upper", "time", "first_contact", "steps"]}, tmp_path, workers=2)
    table, ends = table_of(tmp_path / "result"), np.load(tmp_path / "motions.npy")
    engine = engine_of(tmp_path)
    r = engine.motions(ends[:, 0], ends[:, 1], joints=job["joints"], pairs=job["pairs"], abs_tol=1e-5)
    for name in ("lower", "upper", "time", "steps"):
        assert table[name].tobytes() == getattr(r, name).tobytes(), name
    assert table["first_contact_hit_at"].tobytes() == np.ascontiguousarray(r.first_contact[:, 1]).tobytes()

    poses = np.tile([0.4, 0.3, 0.5, 1, 0, 0, 0], (20, 1)) + 0.1 * np.random.default_rng(1).normal(size=(20, 7))
    np.save(tmp_path / "poses.npy", poses)
    rows = {"file": {"path": "poses.npy"}}
    job = {"scene": "scene.yaml", "bodies": ["cup"], "rows": rows, "answer": "least", "output": "cups"}
    run(Job.from_dict(job, tmp_path), workers=1)
    r = engine.distances(configurations=poses[:, None], bodies=["cup"], reduce="min")
    assert table_of(tmp_path / "cups")["lower"].tobytes() == r.lower.tobytes()


def test_a_robot_without_a_scene_file_and_a_roadmap(tmp_path, urdf):
    pytest.importorskip("scipy", reason="scipy is not installed; make test-extras EXTRAS=ray has it")
    job = arm_job(tmp_path, urdf, rows={"edges": {"of": {"halton": {"count": 200}}, "nearest": 3}}, part_rows=100)
    del job["scene"]
    job["pairs"] = [["arm/fore", "arm/base"], ["arm/flange", "arm/base"]]
    done({**job, "robot": {"urdf": "arm.urdf", "home": {"joint4": -1.5}}}, tmp_path, workers=2)
    table = table_of(tmp_path / "result")
    (edges,) = (tmp_path / "result").glob("edges-*.npy")
    assert len(table["row"]) == len(np.load(edges)) > 200 and 0 < table["free"].sum() < len(table["free"])


def test_the_result_does_not_depend_on_who_made_it(tmp_path, urdf):
    job = arm_job(tmp_path, urdf, check=0.1)
    first = done(job, tmp_path, workers=1)
    assert len(first) == 9  # 8 parts and the manifest
    for workers in (2, 5):
        run(Job.from_dict(job, tmp_path), output=tmp_path / f"by{workers}", workers=workers)
        assert result_of(tmp_path / f"by{workers}") == first
        assert len(set(workers_of(tmp_path / f"by{workers}"))) > 1
    plan = prepare(Job.from_dict(job, tmp_path), tmp_path / "backwards")
    worker = Worker(plan.spec, plan.packed)
    parts = {part_name(part): worker.perform(Part(part)) for part in reversed(range(plan.parts))}
    assert all(isinstance(part, Done) for part in parts.values())
    assert all((plan.spec.folder / name).read_bytes() == first[name] for name in parts)


# ---- kills -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2])
def test_a_run_that_is_killed_five_times_gives_the_bytes_of_one_that_is_not(tmp_path, urdf, seed):
    """kill -9 of the driver, or of a worker and then the driver, after a random number of parts."""
    job = motion_job(tmp_path, urdf, check=0.05)
    (tmp_path / "job.json").write_text(json.dumps(job))
    run(Job.load(tmp_path / "job.json"), output=tmp_path / "undisturbed", workers=2)
    undisturbed = result_of(tmp_path / "undisturbed")
    chance, killed_workers = random.Random(seed), 0
    result = tmp_path / "result"
    for _ in range(5):
        before, lines = parts_done(result), len(journal_of(result))
        process = start(tmp_path / "job.json", "--workers", 2, "--quiet")
        wanted = before + chance.randint(1, 6)
        until(lambda wanted=wanted: parts_done(result) >= wanted, process)
        if chance.random() < 0.5:
            os.kill(workers_of(result, lines)[-1], signal.SIGKILL)
            killed_workers += 1
            wanted = parts_done(result) + 1
            until(lambda wanted=wanted: parts_done(result) >= wanted, process)
        kill(process)
        assert not (result / "manifest.json").exists()  # interrupted in mid-run
    assert 0 < killed_workers < 5
    code, text = finish(start(tmp_path / "job.json", "--workers", 2))
    assert code == 0 and "goes on" in text, text
    assert result_of(result) == undisturbed
    made = [entry["done"]["part"] for entry in journal_of(result) if "done" in entry]
    assert sorted(made) == list(range(40))  # nothing lost, nothing twice
    table, ends = table_of(result), np.load(tmp_path / "motions.npy")
    rows = np.sort(chance.sample(range(len(ends)), 50))
    requested = {"joints": job["joints"], "pairs": job["pairs"], "abs_tol": 1e-5}
    r = engine_of(tmp_path).motions(ends[rows, 0], ends[rows, 1], **requested)
    assert table["lower"][rows].tobytes() == r.lower.tobytes()
    assert table["upper"][rows].tobytes() == r.upper.tobytes()


def test_a_worker_that_is_killed_is_replaced(tmp_path, urdf):
    (tmp_path / "job.json").write_text(json.dumps(motion_job(tmp_path, urdf)))
    process = start(tmp_path / "job.json", "--workers", 2)
    until(lambda: parts_done(tmp_path / "result") >= 2, process)
    os.kill(workers_of(tmp_path / "result")[-1], signal.SIGKILL)
    code, text = finish(process)
    assert code == 0 and "1 workers lost" in text and "signal 9 (SIGKILL)" in text, text
    run(Job.load(tmp_path / "job.json"), output=tmp_path / "undisturbed", workers=2)
    assert result_of(tmp_path / "result") == result_of(tmp_path / "undisturbed")


def test_only_what_is_whole_is_believed(tmp_path, urdf):
    """A part with a changed byte, a missing part, half a line of journal, and a killed worker's remains."""
    job = arm_job(tmp_path, urdf)
    undisturbed, result = done(job, tmp_path, workers=1), tmp_path / "result"
    part = result / "parts" / part_name(3)
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    (result / "parts" / part_name(5)).unlink()
    (result / "parts" / ".part.1-ab.tmp").write_bytes(b"half")
    with open(result / "journal.jsonl", "ab") as journal:
        journal.write(b'{"done": {"part": 1')
    summary = run(Job.from_dict(job, tmp_path), workers=1)
    assert summary.made == 2 and result_of(result) == undisturbed
    assert run(Job.from_dict(job, tmp_path), workers=1).made == 0
    assert result_of(result) == undisturbed


def test_another_job_or_another_run_in_the_folder_is_refused(tmp_path, urdf):
    job = arm_job(tmp_path, urdf)
    done(job, tmp_path, workers=1)
    with pytest.raises(SweepError, match=r"holds the result of another job \(job differ\)"):
        run(Job.from_dict({**job, "margin": 0.01}, tmp_path), workers=1)
    scene = (tmp_path / "scene.yaml").read_text()
    (tmp_path / "scene.yaml").write_text(scene.replace("sphere: 0.05", "sphere: 0.06"))
    with pytest.raises(SweepError, match=r"another job \(scene differ\)"):
        run(Job.from_dict(job, tmp_path), workers=1)
    (tmp_path / "scene.yaml").write_text(scene)
    plan = prepare(Job.from_dict(job, tmp_path))
    from clearance.sweep._journal import Journal

    with contextlib.closing(Journal(plan)), pytest.raises(SweepError, match="another run is writing there"):
        run(Job.from_dict(job, tmp_path), workers=1)


# ---- workers that are wrong ------------------------------------------------------------------------------------------


class Wrong(Worker):
    """Changes the last bit of some number, in parts that it writes or in rows that are recomputed as a check."""

    def perform(self, task):
        import clearance.sweep._work as work

        honest = work.answer

        def answer(*requested):
            columns = honest(*requested)
            columns["lower"] = np.nextafter(columns["lower"], -np.inf)
            return columns

        work.answer = answer
        try:
            return super().perform(task)
        finally:
            work.answer = honest


def plan_of(tmp_path, urdf, **keys):
    return prepare(Job.from_dict(arm_job(tmp_path, urdf, answer="least", **keys), tmp_path))


def driven(plan, size, make):
    pool = InProcess(size, make)
    return drive(plan, lambda: pool, Progress(None)), pool


@pytest.mark.parametrize("size, wrong, said", [
    (4, 0, "machine 0 stands alone among "),
    (4, 2, "machine 2 stands alone among "),
    (2, 1, "machine 0 wrote it, machine 1 computed it again|machine 1 wrote it, machine 0 computed it again"),
])  # fmt: skip
def test_a_machine_that_answers_otherwise_is_named(tmp_path, urdf, size, wrong, said):
    plan = plan_of(tmp_path, urdf, check=0.05)

    def make(number):
        return (Wrong if number == wrong else Worker)(plan.spec, plan.packed)

    with pytest.raises(SweepError, match=said) as caught:
        driven(plan, size, make)
    assert "rows computed again differ from the written ones: row " in str(caught.value)
    # Its parts are not accepted, and are recomputed by the workers that take over.
    summary, _ = driven(plan, 2, lambda number: Worker(plan.spec, plan.packed))
    assert summary.made > 0
    other = prepare(Job.from_dict(arm_job(tmp_path, urdf, answer="least", check=0.05), tmp_path), tmp_path / "other")
    driven(other, 1, lambda number: Worker(other.spec, other.packed))
    assert result_of(plan.output) == result_of(other.output)


def test_a_share_of_all_rows_is_asked_again_by_another(tmp_path, urdf):
    plan = plan_of(tmp_path, urdf, check=0.05)
    summary, _ = driven(plan, 3, lambda number: Worker(plan.spec, plan.packed))
    assert summary.checked == sum(len(plan.spec.checked(part)) for part in range(8)) == 54
    entries = journal_of(plan.output)
    makers = {entry["done"]["part"]: entry["by"] for entry in entries if "done" in entry}
    checks = {entry["checked"]: entry["by"] for entry in entries if "checked" in entry}
    assert sorted(checks) == list(range(8)) and all(makers[part] != by for part, by in checks.items())
    # Without a share nothing is checked; with one machine it checks its own rows.
    plan = plan_of(tmp_path, urdf, output="none")
    assert driven(plan, 2, lambda number: Worker(plan.spec, plan.packed))[0].checked == 0


class Sleepless:
    """Does nothing, immediately, which leaves only the driver's work."""

    def __init__(self, fails=lambda part: None):
        self.fails = fails

    def perform(self, task):
        return self.fails(task.part) or Done(task.part, 1, 0, "")


def test_few_tasks_are_under_way_however_many_parts_there_are(tmp_path, urdf):
    plan = plan_of(tmp_path, urdf, part_rows=1)
    summary, pool = driven(plan, 3, lambda number: Sleepless())
    assert summary.made == 1000 and pool.most_tasks == 3 * DEPTH


def test_a_part_over_which_workers_die_ends_the_run(tmp_path, urdf):
    plan = plan_of(tmp_path, urdf)

    def dies(part):
        if part == 4:
            raise SystemExit("out of memory")

    with pytest.raises(SweepError, match=r"part 4: 3 workers were lost over it; the last, machine .*: out of memory"):
        driven(plan, 2, lambda number: Sleepless(dies))
    assert 4 not in [entry["done"]["part"] for entry in journal_of(plan.output) if "done" in entry]


def test_what_would_fail_everywhere_is_not_tried_again(tmp_path, urdf):
    plan = plan_of(tmp_path, urdf)

    def failing(part):
        return Failed("part 2, on machine 1: no space left") if part == 2 else None

    with pytest.raises(SweepError, match="part 2, on machine 1: no space left"):
        driven(plan, 2, lambda number: Sleepless(failing))


def test_progress_has_rate_and_time_left():
    progress = Progress(None)
    progress.start(10_000_000, 2_000_000)
    progress.add(1_000_000)
    assert progress.text(50.0) == "3,000,000 of 10,000,000 rows, 20,000 rows/s, 6 min left"
