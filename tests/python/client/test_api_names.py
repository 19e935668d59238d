"""The public names of C++ and Python: the same but for the tables below."""

import re
from pathlib import Path

import pytest

import clearance

ROOT = Path(__file__).resolve().parents[3]

#: Headers of the C++ classes, and their Python classes.
CLASSES = {
    "Engine": ("engine/api/engine.h", clearance.Engine),
    "Client": ("client/client.h", clearance.Client),
    "Scene": ("engine/api/scene.h", clearance.Scene),
    "Result": ("wire/api/result.h", clearance.Result),
    "Check": ("wire/api/check.h", clearance.Check),
    "PathCheck": ("wire/api/check.h", clearance.PathCheck),
    "Joints": ("wire/api/scene_info.h", clearance.Joints),
    "PathPlan": ("planner/planner.h", clearance.PathPlan),
    "PathReport": ("planner/path_report.h", clearance.PathReport),
    "StopCheck": ("planner/stop_check.h", clearance.StopCheck),
}
#: C++ name: Python name, for the same thing.
OTHER_NAMES = {
    "body": "body_id",
    "scene": "bodies",
    "pair": "pairs",
    "pairs": "pair_table",
    "set_timeout": "timeout_s",
    "warnings": "load",  # Python warns while it loads
    "outcome": "reason",
    "edges": "motions",
    "blocked": "check",
}
#: Names that only C++ has, with the reason.
CPP_ONLY = {
    "Engine": {
        "group": "names of groups are accepted wherever selectors are",
        "prepare_path": "prepare('check_path')",
    },
    "Client": {
        "group": "as of an Engine",
        "prepare_path": "as of an Engine",
        "Duration": "a type",
        "wait_for_poses": "an option of queries",
    },
    "Result": {
        "info": "all properties at once",
        "bytes": "of a column",
        "rows": "the length of columns",
        "joints": "the shape of gradient_joints",
        "epoch": "of the client",
    },
    "Joints": {"size": "len()", "limits": "`lower` and `upper`"},
    "PathPlan": {"found": "bool()"},
    "StopCheck": {"control_points": "the shape of path"},
}
#: Names that only Python has, with the reason.
PYTHON_ONLY = {
    "Engine": {
        "groups": "in scene()",
        "scene_revision": "in scene()",
        "pose_revision": "in results of updates",
        "plan_on_device": "device queries take arrays of PyTorch and JAX",
        "explain_stop": "a table, not for control loops",
    },
    "Client": {
        "groups": "in scene()",
        "scene_revision": "in scene()",
        "backend": "in scene()",
        "close": "the destructor",
        "explain_stop": "as of an Engine",
    },
    "Scene": {
        "add_body": "add_* by a word",
        "load_urdf": "load()",
        **dict.fromkeys(("display_mesh", "ignored", "initial_pose", "pieces", "source"), "for viewers and tools"),
    },
    "Result": {
        "nonsmooth": "not smooth_radius() > 0",
        "columns": "numpy arrays by name",
        "neighbours": "numpy",
        "reduce": "the shape of columns depends on it",
        "compact": "a format",
        **dict.fromkeys(("names", "pair_names", "to_pandas", "to_arrow"), "pandas and Arrow"),
    },
    "Check": {"result": "its columns are members", "pair_names": "as of a Result"},
    "PathCheck": {"pair_names": "as of a Result"},
    "Joints": {"lower": "in `limits`", "upper": "in `limits`"},
    "PathPlan": dict.fromkeys(("clearance", "certificate"), "motions() and certificate() of the path"),
}
#: Headers whose function templates take an Engine or a Client as their first argument, as Python's methods do.
FUNCTIONS = ("planner/planner.h", "planner/path_report.h", "planner/stop_check.h")


def cpp_names(name: str, header: str) -> set[str]:
    """Returns the public members of a class in an installed header."""
    text = re.sub(r"//[^\n]*", "", (ROOT / header).read_text())
    body = re.search(rf"^(?:class|struct)(?: CLEARANCE_API)? {name} \{{\n(.*?)^\}};", text, re.M | re.S)
    assert body, f"{header} has no {name}"
    public = body[1].split("private:")[0]
    functions = re.findall(r"^  [^\s{}][^(\n]*?\b(\w+)\(", public, re.M)
    members = re.findall(r"^  [^\s{}(][^(\n]*?\b(\w+)(?: = [^;\n]*|\{[^;\n]*\})?;", public, re.M)
    texts = [(ROOT / header).read_text() for header in FUNCTIONS] if name in ("Engine", "Client") else []
    free = [found for text in texts for found in re.findall(r"\b(\w+)\(Queried& ", text)]
    return {found for found in (*functions, *members, *free) if found not in (name, "operator", "bool", "default")}


def python_names(cls: type) -> set[str]:
    fields = getattr(cls, "__dataclass_fields__", {})
    slots = getattr(cls, "__slots__", ())
    return {name for name in (*dir(cls), *fields, *slots) if not name.startswith("_")}


@pytest.mark.parametrize("name", CLASSES)
def test_cpp_has_what_python_has(name):
    header, cls = CLASSES[name]
    theirs = cpp_names(name, header)
    theirs |= {OTHER_NAMES[known] for known in theirs if known in OTHER_NAMES}
    assert len(theirs) > 2
    assert python_names(cls) - theirs - set(PYTHON_ONLY.get(name, ())) == set()


@pytest.mark.parametrize("name", CLASSES)
def test_python_has_what_cpp_has(name):
    header, cls = CLASSES[name]
    ours = python_names(cls)
    missing = {found for found in cpp_names(name, header) if not {found, OTHER_NAMES.get(found)} & ours}
    assert missing - set(CPP_ONLY.get(name, ())) == set()
