"""tools/extras.sh runs the extended checks, and with --changed only those that a change affects."""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
NAMES = [
    "client_install",
    "wheels",
    "deb",
    "arm",
    "coal",
    "mujoco",
    "drake",
    "ompl",
    "ros",
    "jax",
    "torch",
    "viewer",
    "examples",
    "site",
    "ray",
    "fuzz",
    "robots",
    "races",
    "kernels",
    "prove",
]


@pytest.fixture
def checkout(tmp_path):
    """A repository with the script and, in place of the programs it calls, ones that record their calls."""
    (tmp_path / "tools").mkdir()
    for name in ("extras.sh", "extras_packages.sh", "step.sh"):
        shutil.copy(ROOT / "tools" / name, tmp_path / "tools")
    for name in ("tools/build.sh", "tools/setup.sh", "bin/nvcc", ".venv/bin/python"):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#!/bin/sh\necho "{name} $*" >>calls\ncase "$*" in *venv*) exit 7;; esac\n')
        file.chmod(0o755)
    (tmp_path / ".gitignore").write_text("calls\nout\n")
    git(tmp_path, "init", "-q", "-b", "main")
    commit(tmp_path, "engine/cuda/pair.cu", "first")
    commit(tmp_path, ".ci/passed", git(tmp_path, "rev-parse", "HEAD"))
    return tmp_path


def git(folder, *arguments):
    name = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *name, *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout


def commit(folder, path, text):
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    (folder / path).write_text(text)
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", text)


def extras(folder, *arguments):
    path = f"{folder}/bin:/usr/bin:/bin"
    done = subprocess.run(
        ["bash", "tools/extras.sh", *arguments], cwd=folder, capture_output=True, text=True, env={"PATH": path}
    )
    calls = folder / "calls"
    return done, calls.read_text() if calls.exists() else ""


def test_a_change_runs_what_depends_on_it(checkout):
    commit(checkout, "engine/cuda/pair.cu", "second")
    commit(checkout, "notes/page.md", "third")
    done, calls = extras(checkout, "--changed")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "differ from" in done.stdout and "(first), the last that passed CI\n" in done.stdout
    for name in NAMES:
        assert (f"{name}: nothing of it has changed" in done.stdout) == (name not in ("arm", "kernels")), done.stdout
    assert calls == "tools/build.sh gpus kernels\n"


def test_what_is_run_before_a_release_is_named(checkout):
    commit(checkout, "server/app/clearanced.service.in", "second")
    commit(checkout, "tools/root.sh", "third")
    done, calls = extras(checkout, "--changed", "wheels", "deb")
    assert done.returncode == 0 and not calls, done.stdout + done.stderr
    assert "wheels: has changed; run tools/extras.sh wheels before a release" in done.stdout
    assert "deb: has changed" in done.stdout


def test_what_is_not_committed_counts(checkout):
    commit(checkout, "notes/page.md", "second")
    (checkout / "engine/cuda/new.cuh").write_text("")
    done, calls = extras(checkout, "--changed")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "(first)" in done.stdout and calls == "tools/build.sh gpus kernels\n"


def test_a_change_of_no_folder_of_theirs_runs_nothing(checkout):
    commit(checkout, "notes/page.md", "second")
    done, calls = extras(checkout, "--changed")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("nothing of it has changed") == len(NAMES) and not calls


@pytest.mark.parametrize(
    "passed, why",
    [
        ("", "There is no .ci/passed"),
        (
            "0123456789abcdef0123456789abcdef01234567\n",
            "The commit of .ci/passed, 0123456789abcdef0123456789abcdef01234567",
        ),
    ],
)
def test_without_the_commit_that_passed_all_are_run(checkout, passed, why):
    (checkout / ".ci/passed").write_text(passed)
    done, calls = extras(checkout, "--changed")
    assert why in done.stdout and "all extras count as changed" in done.stdout
    assert done.returncode != 0 and "client_install ..." in done.stdout, done.stdout  # the first check fails
    assert "venv" in calls


def test_a_commit_of_another_history_is_compared_all_the_same(checkout):
    git(checkout, "checkout", "-q", "--orphan", "rewritten")
    commit(checkout, "engine/cuda/pair.cu", "second")
    done, calls = extras(checkout, "--changed")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "(first)" in done.stdout and "no ancestor of HEAD" in done.stdout
    assert calls == "tools/build.sh gpus kernels\n"


def test_what_would_take_too_long_is_left_out_and_named(checkout):
    commit(checkout, "engine/cuda/pair.cu", "second")
    done, calls = extras(checkout, "--changed", "--minutes", "0")
    assert done.returncode == 0 and not calls, done.stdout + done.stderr
    assert done.stdout.endswith('Left out, for want of time: run make test-extras EXTRAS="kernels"\n')
    done, calls = extras(checkout, "--changed", "--minutes", "1000")
    assert (done.returncode, calls) == (0, "tools/build.sh gpus kernels\n"), done.stderr


def test_names(checkout):
    done, calls = extras(checkout, "kernels")
    assert (done.returncode, calls) == (0, "tools/build.sh gpus kernels\n"), done.stderr
    done, _ = extras(checkout, "kernel")
    assert done.returncode == 1 and "no extra 'kernel'; there are " + " ".join(NAMES) in done.stderr


def imported(file):
    """The modules of its package that a Python file imports, as paths without suffix."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = file.parents[node.level - 1]
            names = [node.module.replace(".", "/")] if node.module else [alias.name for alias in node.names]
            yield from (folder / name for name in names)


@pytest.mark.parametrize("extra", ["coal", "mujoco", "drake"])
def test_adapters_depend_on_what_they_import(extra):
    script = (ROOT / "tools/extras.sh").read_text()
    shared = " ".join(re.findall(r'^adapters\+?="(.*)"$', script, re.M)).split()
    (line,) = re.findall(rf'^  "{extra} +\d+  \$adapters (.*)"$', script, re.M)
    paths = [ROOT / path for path in shared + line.split()]
    assert all(path.exists() for path in paths)
    package = ROOT / "client/python/clearance"
    own = [ROOT / path for path in line.split() if path.startswith("client/")] + [*(package / "_adapters").glob("*.py")]
    modules = {module for file in own for module in imported(file)}
    assert len(modules) > 5
    for module in modules:
        assert any(path.with_suffix("") in (module, *module.parents) for path in paths), f"{extra}: {module}"
