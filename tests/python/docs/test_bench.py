"""bench/run.py has every benchmark, and runs its table's commands; pages show the results."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "bench"))

import harness
import run
import write_pages
from harness import ROOT


@pytest.mark.parametrize("name", run.SUITES)
def test_what_a_suite_names_is_there(name):
    suite = run.SUITES[name]
    cmake = "".join(path.read_text() for path in [ROOT / "CMakeLists.txt", *(ROOT / "bench").glob("*/CMakeLists.txt")])
    targets = suite.targets.split()
    if suite.program.startswith("build/bin/"):
        assert Path(suite.program).name in targets
    else:
        assert (ROOT / suite.program).is_file()
    assert not [target for target in targets if not re.search(rf"add_(?:executable|custom_target)\({target}\b", cmake)]
    assert not suite.packages or (ROOT / suite.packages).is_file()
    assert not suite.python or (ROOT / suite.python / "requirements.txt").is_file()
    assert not suite.draw or hasattr(write_pages.PICTURES[suite.draw], "draw")
    files = [file for file in suite.files() if not file.startswith("out/")]
    assert not [file for file in files if not (ROOT / file).is_file()]


def test_every_benchmark_in_python_is_a_suite():
    programs = {str(path.relative_to(ROOT)) for path in (ROOT / "bench").glob("*/bench*.py")}
    parts = {path for path in programs if path.startswith("bench/gpu/")} | {"bench/latency/bench_python.py"}
    assert programs - parts == {suite.program for suite in run.SUITES.values() if suite.program.endswith(".py")}


def test_the_list_has_every_suite_and_its_files(capsys):
    run.show_suites()
    listed = capsys.readouterr().out
    for name, suite in run.SUITES.items():
        assert re.search(rf"^  {name} +{re.escape(suite.what)}\n +{re.escape(' '.join(suite.files()))}$", listed, re.M)


@pytest.fixture
def checkout(tmp_path):
    """A repository with the runner, in which every program it starts writes its arguments to the file calls, and a
    CSV file of one row where --csv names one.
    """
    (tmp_path / "bench/robots").mkdir(parents=True)
    for file in ("bench/run.py", "bench/environment.py", "bench/harness.py", "bench/robots/requirements.txt"):
        shutil.copy(ROOT / file, tmp_path / file)
    fakes = [".venv/bin/python", "build/robots/venv/bin/python", "build/bin/clearance-broad", "tools/build.sh"]
    for name in (*fakes, "tools/setup.sh"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            f'#!/bin/sh\necho "{name} $*" >>calls\ncase "$*" in *--fail*) exit 7;; esac\n'
            'while [ $# -gt 1 ]; do [ "$1" = --csv ] && printf "a\\n1\\n" >"$2"; shift; done; true\n'
        )
        path.chmod(0o755)
    shutil.copy(ROOT / "bench/robots/requirements.txt", tmp_path / "build/robots/venv/installed")
    git = ["git", "-C", tmp_path, "-c", "user.name=test", "-c", "user.email=test@localhost"]
    for command in (["init", "-q"], ["add", "bench"], ["commit", "-q", "-m", "The runner"]):
        subprocess.run([*git, *command], check=True)
    return tmp_path


def bench(checkout, *words):
    command = [sys.executable, "bench/run.py", *words]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    calls = checkout / "calls"
    return done, calls.read_text().splitlines() if calls.exists() else []


def test_a_suite_builds_measures_and_rewrites_pages(checkout):
    done, calls = bench(checkout, "rrt", "--rounds", "5")
    assert done.returncode == 0, done.stderr
    assert calls == [
        "tools/setup.sh ",
        "tools/build.sh release product",
        "build/robots/venv/bin/python bench/robots/bench_rrt.py --csv docs/results/rrt.csv --rounds 5",
        ".venv/bin/python bench/write_pages.py --draw robots",
    ]


def test_pages_are_written_where_a_suite_has_some(checkout):
    done, calls = bench(checkout, "changes", "pages")
    assert done.returncode == 0, done.stderr
    assert calls[2:] == [
        ".venv/bin/python bench/load/bench_changes.py --csv docs/results/changes.csv",
        "tools/setup.sh ",
        ".venv/bin/python bench/write_pages.py",
    ]


def test_a_quick_run_leaves_results_and_pages(checkout):
    done, calls = bench(checkout, "--quick", "broad")
    assert done.returncode == 0, done.stderr
    assert calls[1:] == [
        "tools/build.sh release clearance-broad",
        f"build/bin/clearance-broad --csv out/bench/broad.csv {run.SUITES['broad'].quick}",
    ]
    assert not (checkout / "docs").exists()


def test_suites_that_fail_are_named(checkout):
    done, calls = bench(checkout, "broad", "changes", "--fail")
    assert done.returncode == 1 and done.stderr.endswith("bench: failed: broad changes\n"), done.stderr
    assert re.findall(r"^bench: (\w+) +(\w+) +0\.\d minutes$", done.stdout, re.M) == [
        ("broad", "failed"),
        ("changes", "failed"),
    ]
    assert not [call for call in calls if "write_pages" in call]
    shutil.rmtree(checkout / "build/bin")
    done, _ = bench(checkout, "broad")
    assert done.returncode == 1 and "clearance-broad" in done.stderr, done.stderr


def test_a_suite_after_one_that_fails_is_run(checkout):
    (checkout / "build/bin/clearance-broad").unlink()
    done, calls = bench(checkout, "broad", "changes")
    assert done.returncode == 1 and done.stderr.endswith("bench: failed: broad\n"), done.stderr
    assert "changes      done " in done.stdout and calls[-1].endswith("--csv docs/results/changes.csv")


def test_results_have_date_commit_and_minutes(checkout):
    file = checkout / "docs/results/broad.csv"
    assert bench(checkout, "broad", "--fail")[0].returncode == 1 and not file.exists()
    for _ in range(2):  # the second stamp replaces the first
        assert bench(checkout, "broad")[0].returncode == 0
        first, *rest = file.read_text().splitlines()
        assert re.fullmatch(r"# measured \d{4}-\d\d-\d\d, commit [0-9a-f]{8}\+, 0\.\d minutes, .+ x\d+", first)
        assert rest == ["a", "1"]
    assert harness.read(file) == ("", [{"a": "1"}])
    listed = bench(checkout, "list")[0].stdout
    assert f"docs/results/broad.csv docs/notes/performance.md\n{'':15}{first[2:]}\n" in listed
    assert bench(checkout, "broad", "--fail")[0].returncode == 1 and file.read_text().splitlines()[0] == first


def test_no_suite_of_that_name(checkout):
    for words in (["nonsense"], ["--quick"], ["all", "rrt"]):
        done, calls = bench(checkout, *words)
        assert done.returncode == 2 and "there are all, list, pages, latency" in done.stderr, done.stderr
        assert not calls


@pytest.mark.parametrize("task", ["test", "sanitize", "certify", "bench", "several", "report"])
def test_every_gpu_task_names_its_targets(task):
    done = subprocess.run(["bash", "tools/gpu.sh", "programs", task], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.split(), done.stderr


def test_no_gpu_task_of_that_name():
    done = subprocess.run(["bash", "tools/gpu.sh", "programs", "nonsense"], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and "expected test, certify" in done.stderr


def test_rows_come_back_from_a_file(tmp_path, capsys):
    rows = harness.shown({"a": i, **({"b": "x, y"} if i else {})} for i in range(2))
    assert capsys.readouterr().out == "a 0\na 1  b x, y\n"
    path = tmp_path / "new/rows.csv"
    harness.write(rows, path, "5 rounds")
    assert path.read_text() == '# 5 rounds\na,b\n0,\n1,"x, y"\n'
    assert harness.read(path) == ("5 rounds", [{"a": "0", "b": ""}, {"a": "1", "b": "x, y"}])
    harness.write(rows, None)
    assert harness.grouped([{"a": 1, "b": 2}, {"a": 1, "b": 3}], "a") == {1: [{"a": 1, "b": 2}, {"a": 1, "b": 3}]}


@pytest.fixture
def pages():
    return {page: page.read_text() for page in (ROOT / "docs").rglob("*.md")}


def test_a_figure_that_is_not_of_the_results_is_replaced(pages):
    page = ROOT / "docs/performance.md"
    assert write_pages.filled(pages) == pages
    spoilt = {**pages, page: re.sub(r"(?m)^\| Panda \| free \| [\d.]+", "| Panda | free | 0.001", pages[page], count=1)}
    assert spoilt != pages and write_pages.filled(spoilt) == pages


def test_markers_and_claims_that_nobody_knows_are_refused(pages):
    page = ROOT / "docs/tradeoff.md"
    with pytest.raises(SystemExit, match="tradeoff_models"):
        write_pages.filled({**pages, page: pages[page].replace("<!-- table tradeoff_models -->", "")})
    assert write_pages.broken_claims(pages) == []
    with pytest.raises(SystemExit, match="faster still"):
        write_pages.broken_claims({**pages, page: pages[page] + "<!-- claim faster still -->"})
