"""The extension modules as files: their exported symbols and their dependencies."""

import ast
import graphlib
import importlib.util
import pathlib
import re
import subprocess
import sys

import pytest

import clearance
from patience import PATIENCE_S

FOLDER = pathlib.Path(clearance.__file__).parent
MODULES = sorted(path for path in FOLDER.glob("_*.so"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name.split(".")[0])
def test_only_the_init_function_is_exported(path):
    listing = subprocess.run(["nm", "-D", "--defined-only", path], check=True, capture_output=True, text=True).stdout
    symbols = [line.split()[-1] for line in listing.splitlines()]
    assert symbols == ["PyInit_" + path.name.split(".")[0]]


def test_there_are_modules():
    names = {path.name.split(".")[0] for path in MODULES}
    assert "_client" in names
    assert ("_engine" in names) == (importlib.util.find_spec("clearance._engine") is not None)


def test_the_client_needs_none_of_the_engines_libraries():
    path = importlib.util.find_spec("clearance._client").origin
    needed = subprocess.run(["readelf", "-d", path], check=True, capture_output=True, text=True).stdout
    names = re.findall(r"NEEDED.*\[(.*?)\]", needed)
    assert any(name.startswith("libstdc++") for name in names)
    assert not [name for name in names if re.search("assimp|qhull|yaml|gomp", name)]


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_the_package_loads_no_engine():
    out = run(
        "import clearance, sys; clearance.connect; print([m for m in sys.modules if m.startswith('clearance._')])"
    )
    assert "clearance._client" in out and "clearance._engine" not in out
    out = run("import clearance; clearance.connect; print(open('/proc/self/maps').read())")
    assert "_client" in out and "assimp" not in out and "qhull" not in out


@pytest.mark.parametrize("order", [
    ["numpy", "lcm", "clearance._client", "clearance._engine"],
    ["clearance._engine", "clearance._client", "lcm", "numpy"],
])  # fmt: skip
def test_lives_in_one_process_with_others(order, tmp_path):
    """LCM's own module contains another copy of liblcm and glib than ours."""
    for name in ("lcm", "clearance._engine"):
        if importlib.util.find_spec(name) is None:
            order = [other for other in order if other != name]
    code = "import importlib\n" + "".join(f"importlib.import_module({name!r})\n" for name in order)
    code += f"""
import numpy, threading, clearance
try:
    clearance.connect("ipc://{tmp_path}/none", 0.05)
except clearance.ConnectionError as error:
    print("refused:", error)
"""
    if "lcm" in order:
        code += """
import lcm
try:
    bus = lcm.LCM("memq://")
    got = []
    bus.subscribe("X", lambda channel, data: got.append(data))
    bus.publish("X", b"abc")
    bus.handle_timeout(300000)
    assert got == [b"abc"], got
    print("lcm works")
except RuntimeError as error:
    print("no lcm:", error)
"""
    if "clearance._engine" in order:
        code += """
scene = clearance.Scene()
scene.add_sphere("a", 1, pose=[0, 0, 0, 1, 0, 0, 0])
scene.add_sphere("b", 1, pose=[3, 0, 0, 1, 0, 0, 0])
print(clearance.Engine(scene).distances().distance)
"""
    out = run(code)
    assert "refused:" in out
    if "lcm" in order:
        assert "lcm works" in out
    if "clearance._engine" in order:
        assert "[[1.]]" in out


def test_client_only_install_says_so(tmp_path):
    """A package folder without the engine's module."""
    folder = tmp_path / "clearance"
    folder.mkdir()
    for path in FOLDER.iterdir():
        if not path.name.startswith(("_engine.", "__pycache__")):
            (folder / path.name).symlink_to(path.resolve())
    code = f"""
import sys; sys.path.insert(0, {str(tmp_path)!r})
import clearance
assert clearance.__file__.startswith({str(tmp_path)!r})
clearance.connect, clearance.Client, clearance.wire.MAGIC
try:
    clearance.Engine
except ImportError as error:
    print(error)
"""
    assert "clearance.Engine is not there: this is a client-only install" in run(code)


def package_modules(root):
    """The package's modules by name, and the stubs of its compiled ones."""
    folder = root / "client" / "python"
    modules = {}
    for path in sorted((folder / "clearance").rglob("*.py*")):
        if path.suffix in (".py", ".pyi"):
            parts = path.relative_to(folder).with_suffix("").parts
            modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return modules


def imported_modules(name, path, modules):
    """The package's modules that one of them imports, at any place and also for types alone."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*up, *([node.module] if node.module else [])])
            submodules = {f"{base}.{alias.name}" for alias in node.names} & set(modules)
            found.update(submodules, [base] if len(submodules) < len(node.names) else [])
    return (found & set(modules)) - {name}


def test_no_module_imports_one_that_imports_it(root):
    modules = package_modules(root)
    imports = {name: imported_modules(name, path, modules) for name, path in modules.items()}
    assert len(modules) > 50 and sum(map(len, imports.values())) > 250
    assert "clearance._scene.scene" in imports["clearance"]  # within `if TYPE_CHECKING`
    tuple(graphlib.TopologicalSorter(imports).static_order())  # raises CycleError, which names the cycle


def test_unknown_attribute():
    with pytest.raises(AttributeError, match="module 'clearance' has no attribute 'Enigne'"):
        clearance.Enigne


def test_dev_link_makes_a_venv_import_a_build(root, tmp_path):
    """Effect of `make build` on .venv: one line in one file, written once."""
    import venv

    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    build = tmp_path / "build"
    (build / "python" / "clearance_here").mkdir(parents=True)
    (build / "python" / "clearance_here" / "__init__.py").write_text("")
    command = [python, root / "client" / "python" / "dev_link.py", build / "python"]
    environment = {"PATH": "/usr/bin:/bin"}
    first = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
    assert f"imports come from {build / 'python'}" in first
    link = next((tmp_path / "venv").rglob("clearance_dev.pth"))
    before = link.stat().st_mtime_ns
    assert subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout == ""
    assert link.stat().st_mtime_ns == before
    subprocess.run([python, "-c", "import clearance_here"], check=True, env=environment)
