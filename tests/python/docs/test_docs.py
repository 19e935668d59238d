"""Claims of the README and the pages: examples run, links resolve, tables show the result files."""

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S

ROOT = Path(__file__).resolve().parents[3]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))


def code_blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / path).read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture
def daemon(tmp_path):
    """A daemon with its sockets in tmp_path. Provides a function that adapts code to that folder."""

    def place(text):
        assert "/tmp/clearance." in text
        return text.replace("/tmp/clearance.", f"{tmp_path}/clearance.")

    endpoints = place("--shm /tmp/clearance.sock --zmq ipc:///tmp/clearance.ipc").split()
    arguments = [BUILD / "bin/clearanced", "--scene", "scenes/nineteen/scene.yaml", *endpoints]
    read_end, write_end = os.pipe()
    process = subprocess.Popen([*arguments, "--ready-fd", str(write_end)], cwd=ROOT, pass_fds=[write_end])
    os.close(write_end)
    try:
        with os.fdopen(read_end) as ready:
            assert ready.read(), "clearanced ended before it was ready"
        yield place
    finally:
        process.terminate()
        assert process.wait(timeout=PATIENCE_S) == 0


@pytest.fixture
def engine():
    return clearance.Engine(clearance.Scene.load(ROOT / "scenes/nineteen/scene.yaml"))


def run_python(code, *arguments):
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_cpp_program(daemon, engine, tmp_path):
    """Built as a user would, against an installed Clearance, through find_package."""
    code = code_blocks("docs/cpp.md", "cpp")[0]
    prefix, source, build = tmp_path / "prefix", tmp_path / "source", tmp_path / "out"
    source.mkdir()
    (source / "main.cpp").write_text(daemon(code))
    (source / "CMakeLists.txt").write_text(
        textwrap.dedent("""\
        cmake_minimum_required(VERSION 3.22)
        project(example CXX)
        find_package(Clearance REQUIRED)
        add_executable(example main.cpp)
        target_link_libraries(example PRIVATE Clearance::client)
        """)
    )
    for command in (
        ["cmake", "--install", BUILD, "--prefix", prefix],
        ["cmake", "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}"],
        ["cmake", "--build", build],
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert done.returncode == 0, done.stdout + done.stderr
    done = subprocess.run([build / "example"], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    a, b, low, high = re.fullmatch(r"nearest: (\S+) and (\S+), between (\S+) and (\S+) m\n", done.stdout).groups()

    engine.set_poses({"ball": [0.5, 0, 0.3, 1, 0, 0, 0]})
    expected = engine.distances(reduce="min")
    assert [a, b] == [engine.bodies[i].name for i in expected.pairs[0]]
    assert [float(low), float(high)] == pytest.approx([expected.lower[0], expected.upper[0]], rel=1e-5)

    with clearance.connect(daemon("shm:///tmp/clearance.sock")) as client:
        client.set_poses({body.name: [np.nan] * 7 for body in client.bodies})  # as good as none
    done = subprocess.run([build / "example"], capture_output=True, text=True, timeout=PATIENCE_S)
    assert (done.returncode, done.stdout[:10]) == (1, "no answer:"), done.stdout


FRAGMENTS = [("docs/service/security.md", "client.h"), ("docs/cpp.md", "engine.h")]


@pytest.mark.parametrize("page, header", FRAGMENTS)
def test_cpp_fragments_compile(page, header, tmp_path):
    """Against the installed headers; includes that a fragment lacks are prepended."""
    if page == "docs/cpp.md" and not Path("/usr/include/eigen3").exists():
        pytest.skip("no Eigen on this machine")
    for component in ("client_library", "engine_library"):
        command = ["cmake", "--install", BUILD, "--component", component, "--prefix", tmp_path]
        subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE_S)
    blocks = [code for code in code_blocks(page, "cpp") if "int main()" not in code]
    assert blocks
    for code in blocks:
        lines = code.splitlines()
        includes = [f"#include <clearance/{header}>", *(line for line in lines if line.startswith("#include"))]
        body = [line for line in lines if not line.startswith("#include")]
        (tmp_path / "main.cpp").write_text("\n".join([*includes, "int main() {", *body, "}", ""]))
        compiler = ["c++", "-std=c++20", "-fsyntax-only", "-Wall", "-Wno-unused-variable", f"-I{tmp_path}/include"]
        done = subprocess.run(
            [*compiler, "-isystem", "/usr/include/eigen3", tmp_path / "main.cpp"], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr


def test_every_cpp_block_is_compiled_or_anothers():
    pages = {page: code_blocks(page, "cpp") for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))}
    ours = {page for page, codes in pages.items() if [c for c in codes if not c.startswith(("// FCL", "// MoveIt"))]}
    assert ours == {ROOT / page for page, _ in FRAGMENTS}


def test_the_client_of_ones_own(daemon, engine, tmp_path):
    (code,) = code_blocks("docs/service/wire.md", "python")
    printed = [line.split() for line in run_python(code, daemon("ipc:///tmp/clearance.ipc")).splitlines()]
    expected = engine.distances(reduce="nearest")
    names = np.array([body.name for body in engine.bodies])
    assert [(a, b) for a, b, _ in printed] == [tuple(pair) for pair in names[expected.pairs[0]]]
    np.testing.assert_allclose([float(d) for _, _, d in printed], expected.distance[0], atol=5e-7)


def test_links_lead_somewhere():
    pages = [
        ROOT / name
        for name in subprocess.run(
            ["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.split()
    ] or list(ROOT.glob("*.md"))
    checked = 0
    for page in pages:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.relative_to(ROOT)} links to {target}, which is not there"
            checked += 1
    assert checked > 10


def test_nothing_is_installed_from_an_index_by_our_names():
    """`clearance` and `clearance-client` are unregistered on PyPI: any registered package of that name would be
    installed.
    """
    by_name = re.compile(
        r"""pip3? install(?: [^\n`]*?)?["' ]clearance(?:-client)?(?:\[|["'\s`]|$)|\bclearance\[\w+\]""", re.MULTILINE
    )
    # A folder of files in place of an index.
    offline = re.compile(r"pip install --no-index --find-links dist clearance(?:-client)?(?=\s|$)")
    assert offline.search((ROOT / "docs/install.md").read_text())
    assert by_name.search("pip install clearance-client  # here") and by_name.search('pip install "clearance[view]"')
    assert not by_name.search("pip install dist/clearance_client-*.whl") and not by_name.search('"WHEEL[view]"')
    kinds = {".md", ".py", ".pyi", ".cpp", ".h", ".toml", ".xml", ".sh", ".ipynb", ".txt", ".in"}
    folders = ["cli", "client", "docs", "inspect", "ros", "server", "tools"]
    files = [ROOT / "README.md", ROOT / "pyproject.toml"]
    files += [file for folder in folders for file in (ROOT / folder).rglob("*") if file.suffix in kinds]
    assert len(files) > 100
    assert not [str(file) for file in files if by_name.search(offline.sub("", file.read_text()))]


def test_scripts_that_commands_name_are_there():
    named = set()
    for file in ("Makefile", ".ci/run", "bench/run.py", "tools/gpu.sh", "CONTRIBUTING.md"):
        text = (ROOT / file).read_text()
        named |= set(re.findall(r"(?:^|[\s`\"@(])((?:tools|bench|tests)/[\w/]+\.(?:py|sh|txt))", text))
    assert len(named) > 10
    assert not [name for name in named if not (ROOT / name).exists()]


def test_every_page_is_listed():
    docs = ROOT / "docs"
    index = (docs / "README.md").read_text()
    pages = [page.relative_to(docs).as_posix() for page in docs.rglob("*.md") if page.name != "README.md"]
    missing = [page for page in pages if f"({page})" not in index]
    assert not missing, f"docs/README.md does not list {missing}"


def test_tables_are_those_of_the_result_files():
    command = [sys.executable, "bench/write_pages.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("front", ["engine", "client"])
def test_the_example_of_the_python_page(front, start_daemon):
    text = (ROOT / "docs/python.md").read_text()
    code = re.search(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)[1]
    if front == "client":
        url = start_daemon(ROOT / "scenes/cell/scene.yaml", ["shm"]).urls["shm"]
        code = re.sub(
            r"^engine = .*\n# (client = .*)\"shm:[^\"]*\"(\)).*$", rf'engine = \1"{url}"\2', code, flags=re.MULTILINE
        )
        assert url in code and "\nengine.add_body" in code
    run_python(code + "\nassert r.upper.shape == (100,) and r.pairs.shape == (100, 2)")
