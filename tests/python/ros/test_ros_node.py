"""The ROS 2 package's node on a fake rclpy, and the files of the package."""

import ast
import dataclasses
import importlib
import math
import sys
import time
from types import ModuleType
from types import SimpleNamespace as Message

import pytest

import clearance
from conftest import ROS_MESSAGES, ROS_PACKAGE
from patience import PATIENCE_S, wait_until
from ros_messages import header, interfaces, joints, pose, primitive, scene, thing, trajectory
from scenes import at


@pytest.fixture
def make_node(ros, bridge, monkeypatch):
    """make_node(parameter=value, ...) -> the node itself, on a fake rclpy, and its publications by topic."""
    published = {}

    given = {"url": bridge.daemon.urls["ipc"], "robot": "arm", "within": 0.5}

    class Node:
        def __init__(self, name):
            self.calls = {}

        def declare_parameter(self, name, value):
            return Message(value=given.get(name, value))

        def create_publisher(self, kind, topic, depth):
            return Message(publish=lambda message: published.setdefault(topic, []).append(message))

        def create_subscription(self, kind, topic, call, depth):
            self.calls[topic] = call

        def create_service(self, kind, topic, call):
            self.calls[topic] = call

        def create_timer(self, period, call):
            self.calls["timer"] = call

        def get_logger(self):
            return Message(
                info=lambda text: None, warning=lambda text, **options: published.setdefault("log", []).append(text)
            )

        def get_clock(self):
            return Message(now=lambda: Message(to_msg=lambda: "now"))

    def module(name, **members):
        made = ModuleType(name)
        made.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, made)

    array = lambda: Message(header=Message(stamp=None), status=[])  # noqa: E731
    module("rclpy")
    module("rclpy.node", Node=Node)
    messages, services = interfaces(ROS_MESSAGES)
    module("clearance_msgs")
    module("clearance_msgs.msg", **messages)
    module("clearance_msgs.srv", **dict.fromkeys(services, Message))
    module("diagnostic_msgs")
    module("diagnostic_msgs.msg", DiagnosticArray=array, DiagnosticStatus=Message, KeyValue=Message)
    module("sensor_msgs")
    module("sensor_msgs.msg", JointState=Message)
    module("std_msgs")
    module("std_msgs.msg", Float64=Message)
    module("moveit_msgs")
    module("moveit_msgs.msg", PlanningScene=Message, DisplayTrajectory=Message)

    def make(**parameters):
        given.update(parameters)
        return importlib.import_module("clearance_ros.node").ClearanceNode(), published

    return make


def test_the_node_publishes_what_the_bridge_reports(bridge, make_node):
    node, published = make_node(max_age=PATIENCE_S)
    node.calls["timer"]()
    assert [m.data for m in published.pop("~/clearance")] == [-math.inf], "nothing is known of the robot"
    assert published.pop("~/distances")
    node.calls["joint_states"](Message(header=header(time.time_ns()), name=["joint1"], position=[0.2]))
    node.calls["joint_states"](Message(header=header(time.time_ns()), name=["joint1"], position=[0.2, 0.3]))
    assert published.pop("log") == ["joint_states: 1 names come with 2 positions"], "said, and the node goes on"
    node.calls["planning_scene"](scene([thing("plane", planes=[Message(coef=[0, 0, 1, 0])])]))
    node.calls["timer"]()
    assert published.pop("~/clearance")[0].data == -math.inf and "plane: " in published.pop("~/distances")[0].stale[0]
    node.calls["planning_scene"](scene(is_diff=False))
    node.calls["timer"]()
    report = bridge.report(0.5)
    assert [m.data for m in published["~/clearance"]] == [report.least]
    (message,) = published["~/distances"]
    assert [(p.body_a, p.body_b, p.status, p.lower, p.upper, p.beyond_margin) for p in message.pairs] == [
        (p.a, p.b, clearance.Status[p.status.upper()], p.lower, p.upper, p.lower > 0.02) for p in report.pairs
    ]
    assert message.header.stamp == "now" and message.least == report.least and message.stale == []
    assert ["planes are not supported" in text for text in published["log"]] == [True]
    with clearance.connect(bridge.daemon.urls["ipc"]) as other:
        other.add_body("new", sphere=0.1, pose=at(5))
    node.calls["timer"]()
    assert len(published["~/clearance"]) == 2 and len(published["log"]) == 1, "the query adopts the scene"
    states = [message.status[0] for message in published["/diagnostics"]]
    assert [s.level for s in states] == [b"\3", b"\3", b"\0"], "when it changes"
    assert [s.message.partition(":")[0] for s in states] == ["joint_states", "plane", ""]


def test_age_counts_unless_it_is_said_not_to(make_node):
    node, published = make_node()
    node.calls["timer"]()
    assert published["/diagnostics"][0].status[0].level == b"\3", "nothing has come"
    node, published = make_node(max_age=0.0)
    published.clear()
    node.calls["timer"]()
    assert published["~/clearance"][0].data > -math.inf and published["/diagnostics"][0].status[0].level == b"\0"


def test_the_node_shows_that_its_publisher_died(make_node):
    node, published = make_node(max_age=0.02, rate=3)
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    wait_until(lambda: node.calls["timer"]() or published["~/clearance"][-1].data == -math.inf)
    for _ in range(4):
        node.calls["timer"]()
    assert published["~/clearance"][-1].data == -math.inf
    last = published["~/distances"][-1]
    assert last.header.stamp == "now" and any(p.status == p.STALE_POSE for p in last.pairs)
    assert last.least == -math.inf and last.stale == ["arm/joint1: older than 0.02 s"]
    for message in published["/diagnostics"][-2:]:
        (state,) = message.status
        assert message.header.stamp == "now" and state.level == b"\3", "again, though nothing has changed"
        assert state.name == "clearance: inputs and daemon" and state.message == "arm/joint1: older than 0.02 s"
        assert {v.key: v.value for v in state.values}["clearance"] == "-inf"
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    node.calls["timer"]()


def test_the_node_shows_that_its_daemon_died(bridge, make_node):
    node, published = make_node(max_age=PATIENCE_S)
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    node.calls["timer"]()
    assert published["~/clearance"].pop().data > -math.inf
    bridge.daemon.stop()
    shown = len(published["~/distances"])
    for _ in range(2):
        node.calls["timer"]()
    assert [m.data for m in published["~/clearance"]] == [-math.inf] * 2
    assert len(published["~/distances"]) == shown, "no pairs are no answer"
    state = published["/diagnostics"][-1].status[0]
    assert state.level == b"\2" and bridge.daemon.urls["ipc"] in state.message
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))  # is reported, and the node continues
    assert len(published["log"]) == 3


def test_the_node_checks_trajectories(bridge, make_node):
    bridge.client.allow("arm", "arm")  # two of its links always overlap
    node, published = make_node(max_age=PATIENCE_S)
    request = Message(trajectory=trajectory(["joint1"], (0, [0.2]), (1, [0.3])), margin=0.01)
    check = node.calls["~/check_trajectory"](request, Message()).check
    assert (check.result, check.message) == (check.STALE, "joint_states: no position of arm has come")
    node.calls["joint_states"](joints(time.time_ns(), joint1=0.2))
    check = node.calls["~/check_trajectory"](request, Message()).check
    assert check.result == check.FREE and check.margin == 0.01 and check.lower > 0.01
    request.margin = 10.0
    assert node.calls["~/check_trajectory"](request, Message()).check.result == check.COLLISION
    request.margin = -1.0
    assert node.calls["~/check_trajectory"](request, Message()).check.margin == 0.02, "the node's"
    empty = Message(points=[])
    plan = [Message(joint_trajectory=request.trajectory, multi_dof_joint_trajectory=empty)]
    node.calls["display_planned_path"](Message(trajectory=plan))
    node.calls["display_planned_path"](Message(trajectory=plan * 2))
    plan[0].multi_dof_joint_trajectory = Message(points=[1])
    node.calls["display_planned_path"](Message(trajectory=plan))
    results = [(check.result, check.message.partition(":")[0]) for check in published["~/trajectory_check"]]
    assert results[0][0] == check.FREE
    assert results[1:] == [(check.INVALID, "trajectory"), (check.INVALID, "multi_dof_joint_trajectory")]
    bridge.daemon.stop()
    assert node.calls["~/check_trajectory"](request, Message()).check.result == check.INVALID


@pytest.mark.parametrize("error", ["WRONG_SCENE", "NEW_EPOCH"])
def test_a_daemon_that_goes_during_recovery_leaves_no_verdict(bridge, make_node, monkeypatch, error):
    node, published = make_node(max_age=PATIENCE_S)
    code = clearance.wire.ErrorCode[error]
    kind = clearance.NewEpoch if error == "NEW_EPOCH" else clearance.RequestError

    def changed(*given):
        raise kind(code, "it has changed")

    monkeypatch.setattr(sys.modules["clearance_ros.node"], "check_trajectory", changed)
    request = Message(trajectory=trajectory(["joint1"], (0, [0.2]), (1, [0.3])), margin=0.01)
    check = node.calls["~/check_trajectory"](request, Message()).check
    assert (check.result, check.message) == (check.INVALID, "it has changed"), "again, after the recovery"
    bridge.daemon.stop()
    check = node.calls["~/check_trajectory"](request, Message()).check
    assert check.result == check.INVALID and bridge.daemon.urls["ipc"] in check.message
    plan = [Message(joint_trajectory=request.trajectory, multi_dof_joint_trajectory=Message(points=[]))]
    node.calls["display_planned_path"](Message(trajectory=plan))
    assert [check.result for check in published["~/trajectory_check"]] == [check.INVALID]


def test_the_frame_of_the_world_is_a_parameter(bridge, make_node):
    ball = lambda frame: thing("ball", primitives=[(primitive(2, 0.05), pose(4))], frame=frame)  # noqa: E731
    node, published = make_node(frame="map")
    node.calls["planning_scene"](scene([ball("world")]))
    assert published["log"] == ["ball: header.frame_id: expected map, got 'world'"]
    node.calls["planning_scene"](scene([ball("map")]))
    bridge.client.refresh()
    assert "ball" in {body.name for body in bridge.client.bodies}


def test_the_interfaces_are_whole(ros):
    """Constants are those of the code, and each file is built."""
    made, services = interfaces(ROS_MESSAGES)
    assert {n: getattr(made["PairDistance"], n) for n in clearance.Status.__members__} == clearance.Status.__members__
    for name in ("FREE", "COLLISION", "UNPROVED", "LIMITS", "STALE", "INVALID"):
        assert getattr(made["TrajectoryCheck"], name) == getattr(ros.trajectory, name)
    assert set(made["TrajectoryCheck"].__slots__) == {field.name for field in dataclasses.fields(ros.trajectory.Check)}
    assert services == {
        "CheckTrajectory": [
            {"trajectory": ("trajectory_msgs/JointTrajectory", False), "margin": ("float64", False)},
            {"check": ("TrajectoryCheck", False)},
        ]
    }
    text = (ROS_MESSAGES / "CMakeLists.txt").read_text()
    for file in (*ROS_MESSAGES.glob("*/*.msg"), *ROS_MESSAGES.glob("*/*.srv")):
        assert f'"{file.relative_to(ROS_MESSAGES)}"' in text, file


def test_the_package_is_whole():
    """The files that ROS needs exist, and the node imports no other ROS package than those of package.xml."""
    text = (ROS_PACKAGE / "package.xml").read_text()
    tree = ast.parse((ROS_PACKAGE / "clearance_ros" / "node.py").read_text())
    modules = {
        node.module.partition(".")[0] for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level
    }
    for name in modules:
        assert f"<exec_depend>{name}</exec_depend>" in text, name
    assert {"rclpy", "moveit_msgs", "sensor_msgs"} <= modules
    for name in ("setup.py", "setup.cfg", "resource/clearance_ros", "launch/clearance.launch.py"):
        assert (ROS_PACKAGE / name).exists()
