"""Every argument of every public call: a wrong type, shape or value raises a TypeError or ValueError that names it."""

import inspect
import math
import operator
import re
from typing import Any

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S
from scenes import IDENTITY

BOOLS = ["yes", "", 1, 0.0, None, np.array([True]), b"\1"]
NUMBERS = ["1.5", b"1", True, np.True_, 1j, np.array("2"), np.ones(2), [1.0], float("nan"), 10**400]
NUMBERS += [np.timedelta64(1, "s"), np.ma.masked, np.ma.array(1.0, mask=True), np.ma.array([1.0], mask=True)]
NUMBERS_FROM_0 = [*NUMBERS, -1]
INTEGERS = ["1", None, 1.5, True, np.True_, np.ones(2, int), 1 << 70]
COUNTS = [*INTEGERS, -1]
WORDS = ["nonesuch", "", 3, None, b"none", ["none"]]
TEXTS = [3, None, b"text", ["text"], "\ud800"]
PATHS = [3, b"path", ["path"], "\ud800", True]
BODIES = ["nonesuch", 1.5, True, -1, 1 << 33, b"cup", ["cup"], np.ones(1)]
#: Masked entries of arrays are invalid, for any value under the mask.
MASKED = [np.ma.masked_equal([[0.0] * 3 + [1] * 4], 0.0), [np.ma.masked_equal([0.0] * 3 + [1] * 4, 0.0)]]
BODY_LISTS = [
    np.ma.masked_equal([0, 1], 1),
    "cup",
    b"cup",
    3,
    ["nonesuch"],
    [1.5],
    [True],
    [-1],
    np.zeros((1, 1), int),
    np.zeros(1),
]
POSE = ["here", 3, [0, 0, 0], ["0"] * 7, [1j] * 7, [[0], [0, 0]], [True] * 7]
POSE += [np.zeros((2, 7)), 2 * np.eye(4), object(), *MASKED]
SIZES = [
    np.ma.masked_equal([1, 2, 0.0], 0.0),
    "123",
    1.0,
    [1, 1],
    [1, 1, "1"],
    [1, True, 1],
    [[1], [2, 3], 4],
    np.ones((3, 3)),
    b"123",
]
TWO = [SIZES[1], *SIZES[5:]] + [[1, "1"], [1, True], [1]]
VERTICES = [
    np.ma.masked_equal([[1, 2, 0.0]], 0.0),
    [np.ma.masked_equal([1, 2, 0.0], 0.0)],
    "abc",
    [[0, 0]],
    [["0"] * 3],
    [[0, 0], [0, 0, 0]],
    [[True] * 3],
    np.zeros(3),
    np.zeros((1, 3), complex),
]
JOINTS = ["nonesuch", b"arm", 3, 1.5, [1.5], ["nonesuch"], [True], [-1], np.zeros(1), np.zeros((1, 1), int)]
POSITIONS = [*MASKED, "here", 3, np.zeros(3), np.zeros((1, 2)), [[1], [2, 3]]]
MARGINS = ["1.5", True, 1j, math.nan, None, [], ["0.1"], [[0.1]], {"cup": 0.1}, {("cup",): 0.1},
           {("nonesuch", "*"): 0.1}, {("cup", "*"): "0.1"}, {("cup", "*"): -0.1}, {("cup", "*"): math.inf},
           {("cup", 1.5): 0.1}]  # fmt: skip
VELOCITIES = ["fast", 3, [1.0, 2.0], [["0"] * 6], {"nonesuch": 0.0}, np.zeros((1, 7)), np.zeros((2, 6)), *MASKED]

_ONE = {"configurations": np.tile(IDENTITY, (1, 1, 1)).astype(float), "bodies": ["cup"]}

#: Invalid values of each argument of a query.
QUERY = {
    "pairs": [7, "cup", b"ab", [1.5, 2.5], [("cup", True)], [("cup",)], [{"cup": 1, "ball": 2}],
              [{"cup", "ball"}], ("cupp", "*"), [("cup", -1)], np.zeros((2, 2)), np.zeros(3, int), np.array([[0, -1]]),
              np.array(3), [np.array(3)], np.ma.masked_equal([[0, 1]], 1)],
    "configurations": [*POSE[:-4], *MASKED, 2 * np.eye(4)[None, None], np.zeros((1, 7)), np.zeros((0, 1, 7)),
                       np.zeros((1, 3, 7))],
    "bodies": BODY_LISTS,
    "joints": JOINTS,
    "reduce": WORDS,
    "margin": MARGINS,
    "max_distance": [*NUMBERS, None],
    "abs_tol": [*NUMBERS, None],
    "rel_tol": NUMBERS_FROM_0,
    "signed_distance": BOOLS,
    "fields": ["lowr", b"lower", 3.5, True, [], ["lower", 3], 1 << 26, -1],
    "timeout_s": NUMBERS_FROM_0,
}  # fmt: skip
#: Of options that only prepared queries take.
PREPARED = {
    "precision": WORDS,
    "max_results": COUNTS,
    "max_pose_age_ns": INTEGERS,
    "speed_errors": ["x", 3, [[0.1]], [True]],
}
#: Of such options of a client.
PREPARED_BY_A_CLIENT = {"copy": BOOLS, "deadline_ns": INTEGERS}
OF_A_BODY = {"parent": BODIES, "static": BOOLS, "pose": POSE}
#: Further invalid values of a body of a scene.
DOUBTS = {
    "uncertainty": [0.1, "angle", [0.1], {"turn": 0.1}, {3: 1.0}, *({"angle": x} for x in NUMBERS)],
    "padding": [*NUMBERS, None],
    "max_speed": [*NUMBERS, None],
}

#: Invalid values of motions of one body.
ENDS = [None, "x", 3, [], [IDENTITY], [[[1, 2, 3]]]]

#: Of a call that moves no joints.
MEANWHILE = [3, "cup", {}, [IDENTITY], {"cup": 3}, {"cup": [IDENTITY]}]

#: Of both front ends: call -> (valid arguments, invalid values of each argument).
SHAPES = {
    "radius": [*NUMBERS, None], "sphere": ["1.5", True, [1.0], 1j, np.ones(2)],
    "vertices": [*VERTICES, np.zeros((0, 3))], "box": SIZES, "capsule": TWO, "cylinder": TWO,
    "mesh_as": [*WORDS, "solid"],
    "mesh": [3, "m", [1], ([[0, 0, 0]],), ([[0, 0, 0]], [[0.5, 1, 2]]), ([["0", 0, 0]], [[0, 0, 0]])],
    "cone": TWO, "ellipsoid": SIZES, "half_space": BOOLS, "points": VERTICES, "voxel": [*NUMBERS, None],
}  # fmt: skip
FRONT = {
    "wait_covers": ({}, {"timeout_s": NUMBERS_FROM_0}),
    "distances": ({}, QUERY),
    "submit": ({}, QUERY),
    "body_id": ({}, {"name": [*BODIES, None]}),
    "pair_table": ({}, {"pairs": QUERY["pairs"], "bodies": BODY_LISTS}),
    "set_poses": ({"poses": {"cup": IDENTITY}}, {
        "poses": [{"cup": bad} for bad in POSE] + [{"nonesuch": IDENTITY}, {1.5: IDENTITY}, *POSE, None],
        "bodies": BODY_LISTS, "stamp_ns": INTEGERS, "sequence": INTEGERS, "velocities": VELOCITIES}),
    "joints": ({}, {"group": [*JOINTS, None]}),
    "set_joints": ({"positions": {}}, {
        "positions": [*POSITIONS, None, {"nonesuch": 0.0}, {1.5: 0.0}, {7: 0.0}], "joints": JOINTS,
        "stamp_ns": INTEGERS, "sequence": INTEGERS, "velocities": VELOCITIES}),
    "set_points": ({"body": "cup", "xyz": [[0, 0, 0]]}, {
        "body": [*BODIES, None], "xyz": VERTICES, "radius": NUMBERS, "stamp_ns": INTEGERS, "sequence": INTEGERS}),
    "attach": ({"child": "cup", "parent": "gripper"}, {
        "child": [*BODIES, None], "parent": BODIES, "pose": POSE,
        "allow": ["cup", b"cup", 3, None, ["nonesuch"], [1.5], [True], [-1], np.zeros((1, 1))]}),
    "check": ({}, {
        name: QUERY[name] for name in ("configurations", "margin", "pairs", "bodies", "joints", "timeout_s")}),
    "motions": ({"bodies": ["cup"], "start": [[IDENTITY]], "end": [[IDENTITY]]}, {
        "start": ENDS, "end": ENDS, "max_evaluations": COUNTS, "abs_tol": NUMBERS, "meanwhile": MEANWHILE,
        **{name: QUERY[name] for name in (
            "joints", "bodies", "pairs", "reduce", "margin", "max_distance", "rel_tol", "fields", "timeout_s")}}),
    "check_path": ({"bodies": ["cup"], "path": [[IDENTITY], [IDENTITY]]}, {
        "path": [*ENDS, [[IDENTITY]]], "max_evaluations": COUNTS, "meanwhile": MEANWHILE,
        **{name: QUERY[name] for name in ("joints", "bodies", "pairs", "margin", "timeout_s")}}),
    "allow": ({"a": "cup", "b": "gripper"}, {"a": [*BODIES, None], "b": [*BODIES, None]}),
    "forbid": ({"a": "cup", "b": "gripper"}, {"a": [*BODIES, None], "b": [*BODIES, None]}),
    "certificate": ({}, {"rows": [3, "01", b"01", [1.5], ["0"], [True], [-1]]}),
    "add_body": ({"name": "mug", "sphere": 0.1}, {"name": TEXTS, **SHAPES, **OF_A_BODY, **DOUBTS}),
    "replace": ({"name": "cup", "sphere": 0.1}, {"name": TEXTS, **SHAPES}),
    "remove_body": ({}, {"name": TEXTS}),
}  # fmt: skip
CLIENT: dict[str, tuple[dict, dict]] = {
    "reload": ({}, {"timeout_s": [*NUMBERS_FROM_0, None]}),
    "wait_for_poses": ({"stamp_ns": 1}, {
        "stamp_ns": [*COUNTS, 0], "of": [*BODIES, None, ""], "timeout_s": [*NUMBERS, None, "", 11, -1]}),
    "ping": ({}, {"payload": ["text", 3, None, [1]]}),
}  # fmt: skip
SCENE = {
    "add_hull": ({"name": "x", "vertices": [[0, 0, 0]]},
                 {"name": TEXTS, "vertices": VERTICES, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_points": ({"name": "x", "points": [[0, 0, 0]]}, {
        "name": TEXTS, "points": VERTICES, "voxel": [*NUMBERS, None], "radius": [*NUMBERS, None],
        "requires_pose": BOOLS,
        **OF_A_BODY, **DOUBTS}),
    "add_mesh": ({"name": "x", "path": "x.obj"}, {
        "name": TEXTS, "path": [*PATHS, None], "scale": [*SIZES[:2], *SIZES[3:], None, True], "mesh_as": WORDS,
        "up": WORDS, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_body": FRONT["add_body"],
    "add_box": ({"name": "x", "size": [1, 1, 1]},
                {"name": TEXTS, "size": SIZES, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_sphere": ({"name": "x", "radius": 1}, {"name": TEXTS, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_capsule": ({"name": "x", "radius": 1, "length": 1},
                    {"name": TEXTS, "radius": NUMBERS, "length": NUMBERS, **OF_A_BODY, **DOUBTS}),
    "add_cylinder": ({"name": "x", "radius": 1, "length": 1},
                     {"name": TEXTS, "radius": NUMBERS, "length": NUMBERS, **OF_A_BODY, **DOUBTS}),
    "add_cone": ({"name": "x", "radius": 1, "length": 1},
                 {"name": TEXTS, "radius": NUMBERS, "length": NUMBERS, **OF_A_BODY, **DOUBTS}),
    "add_ellipsoid": ({"name": "x", "radii": [1, 1, 1]},
                      {"name": TEXTS, "radii": SIZES, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_half_space": ({"name": "x"}, {"name": TEXTS, "radius": [*NUMBERS, None], **OF_A_BODY, **DOUBTS}),
    "add_robot": ({"name": "x", "urdf": "x.urdf"}, {
        "name": TEXTS, "urdf": [*PATHS, None], "srdf": PATHS, "base": POSE, "parent": BODIES, "static": BOOLS,
        "packages": [3, "p", {3: "x"}, {"p": 3}, ["p"]], "geometry": WORDS,
        "mesh_as": [*WORDS, {3: "hull"}, {"l": "hul"}, {"l": 3}],
        "home": [3, ["j"], {3: 1.0}, {"j": "1"}, {"j": True}, {"j": float("nan")}],
        "padding": [*NUMBERS, None, {3: 0.1}, {"l": "1"}],
        "uncertainty": [3, "l", ["l"], {3: {}}, {"l": 0.1}, {"l": {"turn": 0.1}}, {"l": {"angle": "1"}}]}),
    "add_group": ({"name": "g", "bodies": ["cup"]}, {"name": TEXTS, "bodies": BODY_LISTS}),
    "ignore": ({"a": "cup", "b": "gripper"}, {"a": [*BODIES, None], "b": [*BODIES, None]}),
    "save": ({}, {"folder": [*PATHS, None]}),
    **{call: ({}, {"body": [*BODIES, None, 99]}) for call in ("initial_pose", "source", "pieces", "display_mesh")},
}  # fmt: skip
#: Of functions and classes.
PUBLIC = {
    "Engine": ({}, {
        "scene": [None, "scene.yaml", 3], "backend": WORDS, "covers": WORDS, "threads": [*INTEGERS, -1],
        "max_rows": COUNTS, "device_memory": COUNTS, "device_fallback": BOOLS,
        "devices": [3, "01", b"01", [1.5], ["0"], [True], [-1]]}),
    "connect": ({"url": "ipc:///nowhere"}, {
        "url": [*TEXTS, "http://localhost", [], ["ipc:///nowhere", 3]], "timeout_s": [*NUMBERS_FROM_0, None],
        "server_key": PATHS, "key": PATHS, "hang_s": NUMBERS_FROM_0, "service_class": WORDS}),
    "Scene.load": ({"path": "scene.yaml"}, {"path": [*PATHS, None], "allow_outside": BOOLS}),
    "Scene.load_urdf": ({"urdf": "x.urdf"}, {
        "urdf": [*PATHS, None], "name": [text for text in TEXTS if text is not None]}),
    "pose7_from_matrix": ({}, {"matrix": ["here", 3, None, np.zeros((3, 3)), [["0"] * 4] * 4, 2 * np.eye(4)]}),
}  # fmt: skip

HELPFUL = (
    r"expected .*(got|numpy reports)|named|no body|at least one|expected \[0, 0, 0, 1\]|is 0 to|unknown bits|not a url"
)


def complaints(call, right, arguments, leave_out=()):
    """The invalid values that were accepted, or rejected with an unhelpful message."""
    all_of_them = inspect.signature(call).parameters.values()
    parameters = {p.name for p in all_of_them if p.kind is not p.VAR_KEYWORD} - set(leave_out)
    assert set(arguments) == parameters, "an argument is missing from the table"
    for argument, bad in arguments.items():
        fixed = {name: value for name, value in right.items() if name != argument}
        if argument in ("vertices", "mesh", "box", "capsule", "cylinder", "cone", "ellipsoid", "points"):
            fixed.pop("sphere", None)
        if argument == "bodies" and "configurations" in arguments:
            fixed.update(_ONE)
        if argument == "configurations":
            fixed["bodies"] = ["cup"]
        if argument == "bodies" and "stamp_ns" in arguments:
            fixed["poses"] = np.array([IDENTITY])
        for value in bad:
            passed = {**fixed, argument: value}
            try:
                call(**passed)
            except (TypeError, ValueError) as error:
                text = str(error)
                named = re.match(rf"{argument}(\[[^\]]*\])*: ", text) or (argument == "url" and "is not a url" in text)
                if type(error) in (TypeError, ValueError) and named and re.search(HELPFUL, text):
                    continue
                yield f"{argument}={value!r}: {type(error).__name__}: {text}"
            except Exception as error:
                yield f"{argument}={value!r}: {type(error).__name__}: {error}"
            else:
                yield f"{argument}={value!r}: taken"


def public_methods(a_class):
    return {name for name, method in inspect.getmembers(a_class, callable) if not name.startswith("_")
            and len(inspect.signature(method).parameters) > 1}  # fmt: skip


@pytest.fixture(scope="module")
def scene_of_the_cell(cell):
    return clearance.Scene.load(cell)


@pytest.fixture(params=["engine", "client"])
def front(request, scene_of_the_cell, start_daemon, cell):
    if request.param == "engine":
        return clearance.Engine(scene_of_the_cell)
    return clearance.connect(start_daemon(cell, ["ipc"]).urls["ipc"], timeout_s=PATIENCE_S)


def documented(call):
    """The descriptions of a call's arguments in its docstring, by name."""
    found, last = {}, []
    for line in inspect.cleandoc(call.__doc__).splitlines():
        if match := re.match(r"(\w+(?:, \w+)*): (.*)", line):
            last = [match[2]]
            found.update((name, last) for name in match[1].split(", "))
        elif line.startswith("    "):
            last.append(line.strip())
    return {name: " ".join(lines) for name, lines in found.items()}


@pytest.mark.parametrize(
    "name", ["distances", "check", "motions", "check_path", "check_stop", "free_scale", "plan", "prepare"]
)
@pytest.mark.parametrize("front", [clearance.Engine, clearance.Client])
def test_docstrings_of_queries_state_each_default(front, name):
    call = getattr(front, name)
    described = documented(call)
    parameters = [
        p for p in inspect.signature(call).parameters.values() if p.name != "self" and p.kind != p.VAR_KEYWORD
    ]
    assert len(parameters) <= {"distances": 12, "motions": 14}.get(name, 13)
    for parameter in parameters:
        text = described[parameter.name]
        assert parameter.default is parameter.empty or re.search("default|as in", text, re.I), parameter.name


def test_every_argument_of_both_fronts(front):
    calls = {**FRONT, **(CLIENT if isinstance(front, clearance.Client) else {})}
    elsewhere = {
        "prepare",
        "free_scale",
        "plan",
        "explain_path",
        "check_stop",
        "explain_stop",
    }  # below; files of their own
    named = public_methods(type(front)) - elsewhere
    assert named == set(calls), "a call is missing from the table"
    scene_revision, snapshot = front.scene_revision, front.distances().snapshot_revision
    wrong = [f"{name}: {text}" for name, (right, arguments) in calls.items()
             for text in complaints(getattr(front, name), right, arguments)]  # fmt: skip
    assert not wrong, "\n".join(wrong)
    for value in NUMBERS_FROM_0:
        with pytest.raises((TypeError, ValueError), match="timeout: expected a number"):
            front.submit(reduce="min").result(timeout=value)
    after = front.distances()
    assert (front.scene_revision, after.snapshot_revision) == (scene_revision, snapshot), "nothing of it was applied"


def test_every_argument_of_a_prepared_query(front):
    options: dict[str, Any] = {**QUERY, **PREPARED}
    del options["configurations"]  # an input of run()
    if isinstance(front, clearance.Client):
        options |= PREPARED_BY_A_CLIENT
    for argument, bad in options.items():
        for value in bad:
            with pytest.raises((TypeError, ValueError), match=argument):
                front.prepare("distances", **{argument: value})
    calls = {"distances": (), "check": (), "motions": ("start", "end"), "check_path": ("path",), "free_scale": (),
             "check_stop": ("velocities",)}  # fmt: skip
    for call, inputs in calls.items():
        for unknown in ("sined", "positions", "out", "warm", *inputs):
            with pytest.raises(TypeError, match=rf"{call}.*'{unknown}'"):
                front.prepare(call, **{unknown: 1})


def test_every_argument_of_a_scene(scene_of_the_cell):
    assert public_methods(clearance.Scene) == {*SCENE, "load", "load_urdf"}
    count = len(scene_of_the_cell)
    wrong = [f"{name}: {text}" for name, (right, arguments) in SCENE.items()
             for text in complaints(getattr(scene_of_the_cell, name), right, arguments)]  # fmt: skip
    assert not wrong, "\n".join(wrong)
    assert len(scene_of_the_cell) == count


def test_every_argument_of_public_functions(scene_of_the_cell):
    wrong = []
    for name, (right, arguments) in PUBLIC.items():
        call = operator.attrgetter(name)(clearance)
        right = {"scene": scene_of_the_cell} if name == "Engine" else right
        wrong += [f"{name}: {text}" for text in complaints(call, right, arguments, leave_out={"what"})]
    assert not wrong, "\n".join(wrong)


def test_what_is_as_good_is_taken(engine):
    exact = engine.distances(signed_distance=True, max_distance=2.0)
    for true, two, seven in ((np.True_, np.float32(2), np.int64(7)), (True, np.array(2), np.array(7))):
        query = engine.prepare("distances", signed_distance=true, max_distance=two, max_results=seven)
        assert np.array_equal(query.run().upper, exact.upper)
    engine.set_poses({"link1": [0, 0, 1, 1, 0, 0, 0]}, stamp_ns=np.int64(3))
    assert engine.body_states()[1].pose.tolist() == [0, 0, 1, 1, 0, 0, 0]


@pytest.mark.parametrize("argument, word, meant", [
    ("reduce", "nearst", "nearest"), ("reduce", "MIN", "min"),
    ("precision", "F32", "f32"), ("fields", "distnce", "distance"), ("pairs", [("lnk1", "*")], "link1"),
    ("call", "distnces", "distances"),
])  # fmt: skip
def test_near_misses_are_suggested(engine, argument, word, meant):
    with pytest.raises(ValueError, match=f"did you mean '{meant}'"):
        engine.prepare(**{argument: word})
