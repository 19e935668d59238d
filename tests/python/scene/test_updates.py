"""A rejected update changes nothing, over any interface; an accepted one counts its invalid entries."""

import math
import shutil
import subprocess
import time

import numpy as np
import pytest

import clearance
from clearance import QueryError, Status
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S
from robots import ARM_YAML
from scenes import at

PROGRAM = "clearance" if INSTALLED else str(BUILD / "bin" / "clearance")
CLOUD = "  - {name: cloud, points: [], static: true}\n"
NAN = math.nan
MASKED = np.ma.array(at(9), mask=[1, 0, 0, 0, 0, 0, 0])


@pytest.fixture
def scene(tmp_path, urdf):
    shutil.copy(urdf, tmp_path / "arm.urdf")
    path = tmp_path / "scene.yaml"
    path.write_text(ARM_YAML.replace("robots:", CLOUD + "robots:"))
    return path


def state_of(front):
    """All state that updates can change."""
    bodies = [(*s.pose, s.status, s.parent, s.stamp_ns) for s in front.body_states()]
    joints = [(s.position, s.status, s.stamp_ns) for s in front.joint_states()]
    r = front.distances([("cloud", "cup")], fields=["lower", "upper"])
    return repr((bodies, joints, r.snapshot_revision, r.lower[0, 0], r.upper[0, 0]))


def rejected(front):
    """Calls whose first entry is valid, and their exceptions."""
    later = time.time_ns() + 3600 * 10**9
    sheared = np.eye(4)
    sheared[0, 1] = 0.5
    poses, joints, points = front.set_poses, front.set_joints, front.set_points
    two = {"cup": at(9), "cloud": at(9)}
    return {
        "unknown body": (lambda: poses({"cup": at(9), "nobody": at(0)}), ValueError, "no body is named 'nobody'"),
        "few numbers": (lambda: poses({"cup": at(9), "table": [1, 2]}), ValueError, r"poses\['table'\]"),
        "not rigid": (lambda: poses({"table": at(9), "cup": sheared}), ValueError, "not a rigid transform"),
        "too many rows": (
            lambda: poses(np.array([at(9), at(8)]), ["cup"]),
            ValueError,
            "one pose for each of 1 bodies",
        ),
        "masked pose": (lambda: poses({**two, "cup": MASKED}), ValueError, r"poses\['cup'\].*masked"),
        "masked poses": (lambda: poses(MASKED[None], ["cup"]), ValueError, "poses: .*masked"),
        "words": (lambda: poses({"cup": ["1"] * 7}), TypeError, r"poses\['cup'\]: expected numbers"),
        "objects": (lambda: poses(np.array([[None] * 7]), ["cup"]), TypeError, "got an array of object"),
        "a link": (lambda: poses({"cup": at(9), "arm/fore": at(0)}), QueryError, "is a link placed by joints"),
        "stamp below 0": (lambda: poses({"cup": at(9)}, stamp_ns=-1), QueryError, "stamp_ns: -1 is below 0"),
        "stamp ahead": (lambda: poses({"cup": at(9)}, stamp_ns=later), QueryError, "ahead of this machine's clock"),
        "unknown joint": (lambda: joints({"arm/joint1": 1.0, "arm/joint9": 1.0}), ValueError, "no joint is named"),
        "joint named twice": (lambda: joints({"arm/joint1": 1.0, 0: 0.5}), QueryError, "'arm/joint1' is named twice"),
        "few positions": (lambda: joints([1.0, 0.5], joints="arm"), ValueError, r"expected shape \(8,\)"),
        "masked position": (lambda: joints({"arm/joint1": MASKED[0]}), ValueError, "masked"),
        "masked positions": (lambda: joints(np.ma.masked_equal([1.0] * 7 + [9], 9), "arm"), ValueError, "masked"),
        "position a word": (lambda: joints({"arm/joint1": 1.0, "arm/joint2": "1"}), TypeError, "expected a number"),
        "joint stamp": (
            lambda: joints({"arm/joint1": 1.0}, stamp_ns=later),
            QueryError,
            "ahead of this machine's clock",
        ),
        "a point of NaN": (
            lambda: points("cloud", [[1, 0, 0], [NAN, 0, 0]]),
            QueryError,
            "point 1 has the coordinate nan",
        ),
        "four columns": (lambda: points("cloud", [[1, 0, 0, 0]]), ValueError, r"expected shape \(N, 3\)"),
        "masked points": (lambda: points("cloud", np.ma.masked_equal([[1.0, 0, 9]], 9)), ValueError, "masked"),
        "radius": (lambda: points("cloud", [[1, 0, 0]], radius=-1.0), QueryError, "radius"),
        "no cloud": (lambda: points("cup", [[1, 0, 0]]), QueryError, "'cup' is not a point cloud"),
        "a bad grasp": (lambda: front.attach("cup", "arm/palm", [NAN, *at(0)[1:]]), QueryError, "is not usable"),
    }


def test_a_rejected_update_changes_nothing(front):
    front.set_poses({"cup": at(0.4, 0.3, 0.5)}, stamp_ns=2000)
    front.set_joints({"arm/joint1": 0.25}, stamp_ns=2000)
    front.set_points("cloud", [[0.4, 0.3, 1.5]], stamp_ns=2000)
    before = state_of(front)
    calls = rejected(front)
    calls["late pose"] = (lambda: front.set_poses({"cup": at(9)}, stamp_ns=1000), QueryError, "is older than 2000")
    calls["late joint"] = (lambda: front.set_joints({1: 0.1, 0: 0.1}, stamp_ns=1000), QueryError, "is older than 2000")
    calls["late points"] = (lambda: front.set_points("cloud", [], stamp_ns=1000), QueryError, "is older than 2000")
    for name, (call, error, text) in calls.items():
        with pytest.raises(error, match=text):
            call()
        assert state_of(front) == before, name


def test_what_is_accepted_is_counted_and_bad_bodies_have_no_answer(front):
    done = front.set_poses({"cup": at(NAN), "table": at(1)})
    assert (done.applied, done.bad, done.fixed, done.unknown) == (0, 1, 1, 0)
    assert front.body_states()[front.body_id("cup")].status == Status.BAD_POSE
    r = front.distances([("cup", "table")])
    assert r.status[0, 0] == Status.BAD_POSE and r.lower[0, 0] == -math.inf
    done = front.set_poses(np.array([[0, 0, 1, 0, 0, 0, 0.0]]), ["cup"])
    assert (done.applied, done.bad) == (0, 1), "a quaternion of zeros is no rotation"
    front.set_poses({"cup": at(1), front.body_id("cup"): at(2)})
    assert front.body_states()[front.body_id("cup")].pose.tolist() == at(2), "of several poses the last one counts"
    done = front.set_poses(np.array([at(1), at(2)], float), np.array([front.body_id("cup"), 999], np.uint32))
    assert (done.applied, done.bad, done.unknown) == (1, 0, 1)
    assert front.body_states()[front.body_id("cup")].pose.tolist() == at(1)
    for value in (NAN, math.inf, 1.1e6):
        done = front.set_joints({"arm/joint1": value, "arm/joint2": 0.5})
        assert (done.applied, done.bad) == (1, 1)
        assert [s.status for s in front.joint_states()[:2]] == [Status.BAD_POSE, Status.OK]


def run(daemon, *words, text=None):
    command = [PROGRAM, *map(str, words), "--connect", daemon.urls["shm"]]
    done = subprocess.run(command, capture_output=True, text=True, input=text)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def daemon(start_daemon, scene):
    return start_daemon(scene, ["shm"])


def test_a_command_that_is_rejected_changes_nothing(daemon):
    position = "expected JOINT=POSITION, a position from -1e6 to 1e6, radians or metres"
    good = "arm/joint1=0.5"
    cases: list[tuple[list, int, str]] = [
        (["joints", "--set", good, "--set", f"arm/joint2={bad}"], 2, f'{position}, got "{bad}"')
        for bad in ("nan", "inf", "-inf", "1e7", "1e999", "", "x", "0.1 ", "0,1")
    ]
    with clearance.connect(daemon.urls["shm"], timeout_s=PATIENCE_S) as client:
        before = state_of(client)
        for words, code, text in [
            *cases,
            (["joints", "--set", good, "--set", "arm/joint2"], 2, position),
            (["joints", "--set", good, "--set", "arm/none=1"], 2, 'there is no joint "arm/none"'),
            (["joints", "--set", good, "--set", "arm/joint1=1"], 1, "'arm/joint1' is named twice"),
            (["scene", "move", "cup", "nan", 0, 0], 2, "POSE: expected finite numbers"),
            (["scene", "move", "cup", 0, 0, 0, 0, 0, 0, 0], 2, "a quaternion with a norm from 1e-06 to 1e+06, got 0"),
            (["scene", "move", "cup", 0, 0, 0, "1e7", 0, 0, 0], 2, "got 1e+07"),
            (["scene", "move", "table", 0, 0, 0], 1, '"table" is static'),
            (["scene", "move", "arm/fore", 0, 0, 0], 1, "is a link placed by joints"),
            (["scene", "move", "cup", 0, 0, "inf", "--parent", "arm/palm"], 2, "POSE: expected finite numbers"),
            (["scene", "points", "cloud", "-"], 2,
             'standard input:2: expected 3 numbers, metres, with white space between them, got "0,4,0"'),
        ]:  # fmt: skip
            said = run(daemon, *words, text="1 0 0\n0,4,0\n")
            assert said[0] == code and text in said[1], (words, said)
            assert state_of(client) == before, words
        code, text = run(daemon, "scene", "points", "cloud", "-", text="1 0 0\nnan 0 0\n")
        assert code == 2 and 'got "nan"' in text and "radians" not in text and state_of(client) == before
        assert run(daemon, "scene", "points", "cloud", "-", text="\ufeff1 0 0\r\n")[0] == 0
        assert run(daemon, "joints", "--set", good)[0] == 0
        assert client.joint_states()[0].position == 0.5


def test_a_position_beyond_limits_is_set_with_a_warning(daemon):
    code, text = run(daemon, "joints", "--set", "arm/joint2=-45", "--set", "arm/joint4=-135", "--set", "arm/joint1=0")
    assert code == 0 and "warning: beyond joint limits: arm/joint2 = -45 (-1.76 to 1.76), arm/joint4 = -135" in text
    assert "in degrees they would be within" in text and "arm/joint1" not in text
    code, text = run(daemon, "joints", "--set", "arm/grip=2", "--set", "arm/joint2=0", "--set", "arm/joint4=-1")
    assert code == 0 and "arm/grip = 2 (0 to 0.04)" in text and "degrees" not in text


HOME = [0, 0, 0, -1.5, 0, 0, 0, 0]


def path_file(tmp_path, *rows, names=range(1, 8)):
    text = ",".join([*(f"arm/joint{i}" for i in names), "arm/grip"]) + "\n"
    file = tmp_path / "path.csv"
    file.write_text(text + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return file


def test_exit_codes_of_path(daemon, tmp_path):
    free = [*HOME[:6], 0.5, 0]
    pairs = ["--pairs", "cup,arm/palm"]
    assert run(daemon, "path", path_file(tmp_path, HOME, free), *pairs)[0] == 0
    code, text = run(daemon, "path", path_file(tmp_path, HOME, free), "--margin", "9", *pairs)
    assert code == 1 and "are within 9 m at t = 0" in text
    for row, text in [
        (["nan", *HOME[1:]], 'got "nan"'),
        (HOME[1:], "expected 8 numbers"),
    ]:
        code, said = run(daemon, "path", path_file(tmp_path, HOME, row), *pairs)
        assert code == 2 and "path.csv:3" in said and text in said
    assert run(daemon, "path", path_file(tmp_path, HOME), *pairs)[0] == 2, "one waypoint is no path"
    assert run(daemon, "path", tmp_path / "nowhere.csv")[0] == 2
    file = path_file(tmp_path, HOME, free)
    code, text = run(daemon, "path", file, "--margin", "inf")
    assert code == 2 and "margin" in text, "what the daemon refuses is an error, not a path that is not free"
    assert run(daemon, "path", file, "--pairs", "cup,nobody")[0] == 2
    assert run(daemon, "path", file, "--certificate", tmp_path / "no" / "folder", *pairs)[0] == 2
    daemon.stop()
    assert run(daemon, "path", file)[0] == 3


def test_a_path_beyond_limits_names_joint_limit_and_waypoint(daemon, tmp_path):
    pairs = ["--pairs", "cup,table"]
    beyond = [*HOME[:7], 0.05]
    file = path_file(tmp_path, HOME, [3.0, *HOME[1:]], beyond)
    code, text = run(daemon, "path", file, *pairs)
    assert (
        code == 1
        and "free" not in text.replace(str(tmp_path), "")
        and text.splitlines()
        == [
            f"clearance: {file}:3: waypoint 1: arm/joint1 at 3 is beyond its upper limit 2.9 by 0.1",
            f"{file}:4: waypoint 2: arm/grip at 0.05 is beyond its upper limit 0.04 by 0.01",
        ]
    )
    code, text = run(daemon, "path", file, "--margin", "9", *pairs)
    assert code == 1 and "are within 9 m" in text and "arm/grip at 0.05 is beyond" in text
    degrees = [0, -45, 0, -135, 0, 90, 45, 0]
    code, text = run(daemon, "path", path_file(tmp_path, HOME, degrees), *pairs)
    assert code == 1 and "arm/joint2 at -45 is beyond its lower limit -1.76 by 43.24" in text
    assert text.rstrip().endswith("; in degrees they would be within: positions are in radians")
    proof = tmp_path / "proof.json"
    assert run(daemon, "path", file, "--certificate", proof, *pairs)[0] == 1 and proof.stat().st_size > 100


def test_text_files_may_have_a_byte_order_mark_and_are_no_utf_16(daemon, tmp_path):
    file = path_file(tmp_path, HOME, HOME)
    text = file.read_text()
    pairs = ["--pairs", "cup,table"]
    for encoding in ("utf-8", "utf-8-sig"):
        file.write_text(text.replace("\n", "\r\n"), encoding)
        assert run(daemon, "path", file, *pairs)[0] == 0
    for encoding, why in [("utf-16", "the text is UTF-16; save it as UTF-8"), ("utf-16-le", "got a NUL byte")]:
        file.write_text(text, encoding)
        code, said = run(daemon, "path", file, *pairs)
        assert code == 2 and str(file) in said and why in said
    (tmp_path / "hull").write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "utf-8-sig")
    assert run(daemon, "scene", "add", "wedge", "--vertices", tmp_path / "hull")[0] == 0
    (tmp_path / "hull").write_text("0 0 0\n", "utf-16")
    code, said = run(daemon, "scene", "add", "two", "--vertices", tmp_path / "hull")
    assert code == 2 and f"--vertices {tmp_path / 'hull'}: the text is UTF-16" in said


def test_robot_positions_may_have_a_byte_order_mark(urdf, tmp_path):
    rows = tmp_path / "rows.csv"
    said = {}
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        rows.write_text("joint1,joint2\n0.1,0.2\n", encoding)
        command = [PROGRAM, "robot", "fk", urdf, "--positions", str(rows), "--csv"]
        done = subprocess.run(command, capture_output=True, text=True)
        said[encoding] = done.returncode, done.stdout, done.stderr
    assert said["utf-8"][0] == 0 and said["utf-8-sig"] == said["utf-8"]
    assert said["utf-16"][0] == 1 and f"{rows}: the text is UTF-16" in said["utf-16"][2]
