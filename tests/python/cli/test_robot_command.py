"""clearance robot: the contents of a URDF, and poses of links for given joint positions."""

import csv
import io
import json
import os
import subprocess

import pytest

from conftest import CLEARANCE, ROOT
from patience import PATIENCE_S

ARM = ROOT / "tests/engine/robot/arm.urdf"
OTHER_SRDF = ROOT / "tests/engine/robot/every_joint.srdf"
EVERY_JOINT = ROOT / "tests/engine/robot/every_joint.urdf"


def run(*arguments):
    return subprocess.run(
        [CLEARANCE, "robot", *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S
    )


def poses(*arguments):
    answer = run("fk", *arguments, "--json")
    assert answer.returncode == 0, answer.stderr
    return {(row["configuration"], row["link"]): row for row in json.loads(answer.stdout)}


def test_inspect_lists_links_joints_and_limits():
    answer = run("inspect", ARM, "--csv")
    assert answer.returncode == 0, answer.stderr
    rows = {row["link"]: row for row in csv.DictReader(io.StringIO(answer.stdout))}
    assert rows["base"]["type"] == "base" and rows["flange"]["type"] == "fixed"
    assert rows["fore"]["parent"] == "elbow" and float(rows["fore"]["upper"]) == -0.07
    assert rows["right_finger"]["position"] == "mimics grip"
    assert "11 links, 10 joints, 8 positions" in run("inspect", ARM).stdout


def test_inspect_warns_and_names_meshes_that_are_not_there():
    answer = run("inspect", EVERY_JOINT, "--srdf", EVERY_JOINT.with_suffix(".srdf"))
    assert answer.returncode == 1
    assert (
        "warning: " + str(EVERY_JOINT.with_suffix(".srdf")) + ':19: disable_collisions: there is no link "tail"'
        in answer.stderr
    )
    assert 'link "slide": collision: mesh "slide.stl": there is no file' in answer.stderr
    assert "1 meshes are missing" in answer.stderr


def test_inspect_finds_packages_as_ros_does(tmp_path):
    urdf = tmp_path / "r.urdf"
    urdf.write_text(
        "<robot name='r'><link name='a'><collision><geometry><mesh filename='package://arm/a.stl'/></geometry>"
        "</collision></link></robot>"
    )
    mesh = tmp_path / "prefix/share/arm/a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.touch()

    def code(*arguments, **variables):
        environment = {k: v for k, v in os.environ.items() if k not in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH")}
        command = [CLEARANCE, "robot", "inspect", urdf, *arguments]
        return subprocess.run(command, env=environment | variables, capture_output=True, timeout=120).returncode

    assert code() == 1
    assert code(AMENT_PREFIX_PATH=str(tmp_path / "prefix")) == 0
    (mesh.parent / "package.xml").write_text("<package><name>arm</name></package>")
    assert code(ROS_PACKAGE_PATH=str(tmp_path)) == 0
    assert code("--packages", f"arm={mesh.parent}") == 0


def test_an_srdf_of_macros_is_refused_and_a_default_counts(tmp_path):
    srdf = tmp_path / "arm.srdf"
    srdf.write_text('<robot name="arm">\n<disable_collisions link1="base" link2="${arm}_hand"/></robot>')
    answer = run("inspect", ARM, "--srdf", srdf)
    assert answer.returncode == 1
    assert f"{srdf}:2: disable_collisions: link2: xacro replaces a part of" in answer.stderr
    srdf.write_text('<robot name="arm"><disable_default_collisions link="base"/></robot>')
    assert "10 disabled pairs" in run("inspect", ARM, "--srdf", srdf).stdout


def test_fk_places_links_and_says_how_far_they_may_be_off(tmp_path):
    straight = poses(ARM)
    assert straight[0, "elbow"]["z"] == pytest.approx(0.333 + 0.316) and straight[0, "elbow"]["y"] == pytest.approx(
        0, abs=1e-10
    )
    turned = poses(ARM, "--set", "joint1=1.5707963267948966", "--set", "grip=0.04", "--radius", 0.1)
    assert turned[0, "fore"]["y"] == pytest.approx(0.0825) and turned[0, "fore"]["x"] == pytest.approx(0, abs=1e-10)
    assert 0 < turned[0, "right_finger"]["error"] < 3e-14 * turned[0, "right_finger"]["reach"]
    assert turned[0, "base"]["error"] == 0
    moved = poses(ARM, "--base", 1, 2, 3, 1, 0, 0, 0)
    assert moved[0, "shoulder"]["z"] == pytest.approx(3.333)
    file = tmp_path / "positions.csv"
    file.write_text("grip,joint1\n0.01,0\n0.04,1.5707963267948966\n")
    rows = poses(ARM, "--positions", file, "--set", "joint2=0", "--radius", 0.1)
    assert rows[1, "left_finger"] == turned[0, "left_finger"] | {"configuration": 1}
    assert rows[0, "left_finger"] != rows[1, "left_finger"]


def test_fk_takes_an_srdfs_states():
    srdf = EVERY_JOINT.with_suffix(".srdf")
    rows = poses(EVERY_JOINT, "--srdf", srdf, "--state", "everything/home")
    assert (rows[0, "cart"]["x"], rows[0, "cart"]["y"], rows[0, "cart"]["z"]) == (2, 4, 3)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["fk", ARM, "--set", "joint9=1"], 'no joint of arm has a position "joint9"'),
        (["fk", ARM, "--set", "joint1=one"], '--set: expected a number, got "one"'),
        (["fk", ARM, "--set", "joint1=nan"], "positions must be numbers up to 1e6"),
        (["fk", ARM, "--set", "joint1"], "expected JOINT=POSITION"),
        (["fk", ARM, "--state", "home"], 'the SRDF has no state "home"'),
        (["fk", ARM, "--base", 0, 0, 0, 0, 0, 0, 0], "--base: expected a pose"),
        (["fk", ARM, "--positions", "{none}"], "{none}: cannot be read"),
        (["inspect", "{none}"], "{none}: No such file or directory"),
        (
            ["inspect", ARM, "--srdf", OTHER_SRDF],
            'this SRDF is for the robot "every_joint", the URDF for "arm"',
        ),
    ],
)
def test_what_is_wrong_is_said(arguments, words, tmp_path):
    none = tmp_path / "none"
    answer = run(*(str(argument).format(none=none) for argument in arguments))
    assert answer.returncode == 1 and words.format(none=none) in answer.stderr, answer.stderr
    assert not answer.stdout


def test_mistakes_on_the_command_line():
    assert run("inspect").returncode == 2
    for option, value in (("--packages", "panda"), ("--packages", "panda="), ("--packages", "=folder")):
        answer = run("inspect", ARM, option, value)
        assert answer.returncode == 2 and f"--packages: expected NAME=FOLDER, got {value}" in answer.stderr
    assert "clearance robot" in run("--help").stdout


def test_pairs_says_what_is_proved_and_writes_an_srdf_that_is_read_again(tmp_path):
    srdf = tmp_path / "arm.srdf"
    answer = run("pairs", ARM, "--samples", 200, "--steps", 2000, "--write", srdf, "--csv")
    assert answer.returncode == 0, answer.stderr
    found = {frozenset((r["link_a"], r["link_b"])): r["finding"] for r in csv.DictReader(io.StringIO(answer.stdout))}
    assert found[frozenset(("wrist", "palm"))] == "adjacent"
    assert found[frozenset(("fore", "palm"))] == "always"  # the palm's ball reaches into the forearm's box
    assert found[frozenset(("wrist", "left_finger"))] == "never"
    assert found[frozenset(("base", "flange"))] == "sometimes"
    written = srdf.read_text()
    assert 'reason="Never: proved"' in written or 'reason="Always: proved"' in written
    assert "samples" not in written
    again = run("inspect", ARM, "--srdf", srdf)
    assert again.returncode == 0, again.stderr
    disabled = sum(finding in ("adjacent", "never", "always") for finding in found.values())
    assert f"{disabled} disabled pairs" in again.stdout


def test_pairs_within_a_margin(tmp_path):
    srdf = tmp_path / "arm.srdf"
    answers = {}
    for margin in (0, 0.05):
        answer = run("pairs", ARM, "--samples", 200, "--steps", 2000, "--margin", margin, "--write", srdf, "--csv")
        assert answer.returncode == 0, answer.stderr
        rows = csv.DictReader(io.StringIO(answer.stdout))
        answers[margin] = {(r["link_a"], r["link_b"]): r["finding"] for r in rows}
    nearer = {pair for pair, finding in answers[0].items() if finding == "never" and answers[0.05][pair] != "never"}
    assert nearer, "the margin matters"
    assert {pair for pair, finding in answers[0.05].items() if finding == "never"} < {
        pair for pair, finding in answers[0].items() if finding in ("never", "never_seen")
    }
    always = {pair for pair, finding in answers[0.05].items() if finding == "always"}
    written = srdf.read_text()
    assert always and not [f for f in always if f'link1="{f[0]}" link2="{f[1]}"' in written]
    assert 'reason="Never: proved, within 0.05 m"' in written and "Always" not in written
    assert run("pairs", ARM, "--margin", -1).returncode == 2


def test_pairs_refuses_what_slides_without_end(tmp_path):
    urdf = tmp_path / "cart.urdf"
    urdf.write_text(
        "<robot name='cart'><link name='floor'><collision><geometry><box size='1 1 1'/></geometry></collision></link>"
        "<link name='cart'/><link name='arm'><collision><geometry><sphere radius='0.1'/></geometry></collision></link>"
        "<joint name='on' type='planar'><parent link='floor'/><child link='cart'/><axis xyz='0 0 1'/></joint>"
        "<joint name='up' type='continuous'><parent link='cart'/><child link='arm'/></joint></robot>"
    )
    answer = run("pairs", urdf)
    assert answer.returncode == 1
    assert 'joint "on/x" slides without limits' in answer.stderr
