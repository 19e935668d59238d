"""try_ros.py BUILD: the ROS 2 node on rclpy itself, with ROS's own messages, executor and middleware, and a daemon.

Packages built by colcon are not on PyPI: the messages of clearance_msgs, whose files ROS's parser reads here, travel as
text in String and GetParameters. Nothing of MoveIt is installed, so planning scenes are tested with fakes only
(tests/python/ros/test_ros_scene.py). BUILD: a build folder.
"""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time
from types import ModuleType

os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "67"}

import rclpy
import rclpy.node
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message, serialize_message
from rosidl_adapter.parser import parse_message_file, parse_service_file
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/python/ros"), str(ROOT / "tests/python"), str(ROOT / "ros/clearance_ros")]

import clearance  # noqa: E402
from patience import PATIENCE_S  # noqa: E402
from ros_messages import interfaces  # noqa: E402

BUILD = pathlib.Path(sys.argv[1]).resolve()
SCENE, MESSAGES = ROOT / "scenes/cell/robot.yaml", ROOT / "ros/clearance_msgs"
STALE, ERROR, OK = b"\3", b"\2", b"\0"


# ---- messages of clearance_msgs as text ------------------------------------------------------------------------------


def text_of(message):
    """A message as JSON, with -inf and nan; a header as its frame and stamp."""

    def fields(value):
        if isinstance(value, Header):
            return {"frame_id": value.frame_id, "sec": value.stamp.sec, "nanosec": value.stamp.nanosec}
        return {name: getattr(value, name) for name in value.__slots__}

    return json.dumps(message, default=fields)


class Carrier(rclpy.node.Node):
    """A node whose publishers and services of clearance_msgs use ROS's own types."""

    def create_publisher(self, kind, topic, depth, **options):
        if kind not in OURS.values():
            return super().create_publisher(kind, topic, depth, **options)
        publisher = super().create_publisher(String, topic, depth)

        class Publisher:
            def publish(_, message):
                assert isinstance(message, kind)
                publisher.publish(String(data=text_of(message)))

        return Publisher()

    def create_service(self, kind, topic, call, **options):
        if kind is not CheckTrajectory:
            return super().create_service(kind, topic, call, **options)

        def answer(request, response):
            raw, margin = request.names
            given = CheckTrajectory.Request(deserialize_message(bytes.fromhex(raw), JointTrajectory), float(margin))
            response.values.append(ParameterValue(string_value=text_of(call(given, CheckTrajectory.Response()).check)))
            return response

        return super().create_service(GetParameters, topic, answer)


class CheckTrajectory:
    class Request:
        def __init__(self, trajectory, margin):
            self.trajectory, self.margin = trajectory, margin

    class Response:
        check = None


def _with_header(message, **given):
    super(type(message), message).__init__(header=Header(), **given)


def install_messages():
    """Makes modules of clearance_msgs, and checks its files with ROS's parser."""
    made, _ = interfaces(MESSAGES)
    fake = made["Distances"]
    made["Distances"] = type("Distances", (fake,), {"__slots__": fake.__slots__, "__init__": _with_header})
    for file in MESSAGES.glob("msg/*.msg"):
        parsed = parse_message_file("clearance_msgs", str(file))
        assert {field.name for field in parsed.fields} == set(made[file.stem].__slots__), file
    service = parse_service_file("clearance_msgs", str(MESSAGES / "srv/CheckTrajectory.srv"))
    assert [field.name for field in service.request.fields] == ["trajectory", "margin"]
    for name, members in (("", {}), (".msg", made), (".srv", {"CheckTrajectory": CheckTrajectory})):
        module = ModuleType(f"clearance_msgs{name}")
        module.__dict__.update(members)
        sys.modules[module.__name__] = module
    return made


OURS = install_messages()
rclpy.node.Node, node_of_ros = Carrier, rclpy.node.Node
from clearance_ros.node import ClearanceNode  # noqa: E402

rclpy.node.Node = node_of_ros


# ---- a robot's side --------------------------------------------------------------------------------------------------


class Robot(rclpy.node.Node):
    """Publishes joint states, and keeps the node's last messages."""

    def __init__(self, names):
        super().__init__("robot")
        self.names, self.latest = names, {}
        self.joints = self.create_publisher(JointState, "joint_states", 10)
        for topic, kind in (("clearance/clearance", Float64), ("clearance/distances", String)):
            self.create_subscription(kind, topic, lambda message, topic=topic: self.latest.update({topic: message}), 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_state, 10)
        self.service = self.create_client(GetParameters, "clearance/check_trajectory")

    def _on_state(self, message):
        self.latest["state"] = message.status[0]

    @property
    def least(self):
        return self.latest["clearance/clearance"].data if "clearance/clearance" in self.latest else None

    @property
    def distances(self):
        """The last message, or an empty one."""
        return json.loads(self.latest["clearance/distances"].data if "clearance/distances" in self.latest else "{}")

    def send(self, positions):
        message = JointState(name=self.names, position=positions)
        message.header.stamp = self.get_clock().now().to_msg()
        self.joints.publish(message)

    def trajectory(self, *rows):
        points = [JointTrajectoryPoint(positions=row) for row in rows]
        for k, point in enumerate(points):
            point.time_from_start.sec = k
        return JointTrajectory(joint_names=self.names, points=points)


class World:
    """The daemon, the node and the robot, in one executor."""

    def __init__(self, folder):
        self.url = f"ipc://{folder}/clearance.ipc"
        self.daemon = self._start()
        self.client = clearance.connect(self.url)
        self.client.allow("arm/wrist_1", "arm/flange")
        names = [state.name.partition("/")[2] for state in self.client.joint_states()]
        parameters = {"url": self.url, "robot": "arm", "max_age": 2.0, "margin": 0.02, "rate": 20.0}
        arguments = [word for name, value in parameters.items() for word in ("-p", f"clearance:{name}:={value}")]
        rclpy.init(args=["--ros-args", *arguments])
        self.node, self.robot = ClearanceNode(), Robot(names)
        self.executor = SingleThreadedExecutor()
        for node in (self.node, self.robot):
            self.executor.add_node(node)

    def _start(self):
        read, write = os.pipe()
        command = [BUILD / "bin/clearanced", "--scene", SCENE, "--zmq", self.url, "--log-level", "warn"]
        process = subprocess.Popen([*command, "--ready-fd", str(write)], pass_fds=[write])
        os.close(write)
        with os.fdopen(read) as ready:
            assert ready.read(), "clearanced ended before it was ready"
        return process

    def spin_until(self, condition, what, each=lambda: None):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}: {self.robot.latest}"
            each()
            self.executor.spin_once(timeout_sec=0.05)

    def check(self, trajectory, margin, positions):
        """Calls the service, while joint states arrive."""
        raw = serialize_message(trajectory).hex()
        future = self.robot.service.call_async(GetParameters.Request(names=[raw, repr(margin)]))
        self.spin_until(future.done, "the service", lambda: self.robot.send(positions))
        return json.loads(future.result().values[0].string_value)

    def close(self):
        self.daemon.kill()
        self.daemon.wait()
        rclpy.try_shutdown()


def try_node(world):
    robot = world.robot
    check = OURS["TrajectoryCheck"]
    world.spin_until(lambda: robot.least is not None and "state" in robot.latest, "the first answer")
    assert robot.least == -math.inf and robot.latest["state"].level == STALE, robot.latest
    assert "no position of arm has come" in robot.latest["state"].message

    home = [state.position for state in world.client.joint_states()]
    there = [home[0] + 0.1, *home[1:]]
    world.spin_until(lambda: robot.least not in (None, -math.inf), "a distance", lambda: robot.send(there))
    world.spin_until(lambda: robot.latest["state"].level == OK, "the state", lambda: robot.send(there))
    r = world.client.distances(("*", "*"), reduce="min")
    assert robot.least == r.lower[0], (robot.least, r.lower)
    world.spin_until(lambda: robot.distances.get("least") == robot.least, "its pairs", lambda: robot.send(there))
    near = world.client.distances(("*", "*"), reduce="within", max_distance=0.25, fields=("default", "pair"))
    rows = sorted(zip(near.lower.tolist(), near.upper.tolist(), near.status.tolist()))
    have = [(pair["lower"], pair["upper"], pair["status"]) for pair in robot.distances["pairs"]]
    assert sorted(have) == rows and len(rows) > 3
    assert robot.distances["header"]["sec"] > 0

    world.spin_until(robot.service.service_is_ready, "the service")
    found = world.check(robot.trajectory(there, home), 0.01, there)
    assert found["result"] == check.FREE and found["lower"] > 0.01, found
    found = world.check(robot.trajectory(there, [home[0] + 1.5, *home[1:]]), 0.01, there)
    assert found["result"] == check.COLLISION and "arm/gripper" in found["body_a"] + found["body_b"], found
    assert found["joint_names"] == robot.names and len(found["positions"]) == len(robot.names)
    found = world.check(robot.trajectory(there), -1.0, there)
    assert found["margin"] == 0.02, "the node's"
    found = world.check(JointTrajectory(), 0.01, there)
    assert found["result"] == check.INVALID and found["message"], found

    robot.joints.publish(JointState(name=robot.names[:1], position=[0.1, 0.2]))  # is reported, and the node continues
    world.spin_until(lambda: robot.least == -math.inf, "stale joints")
    world.spin_until(lambda: robot.latest["state"].level == STALE, "the stale state")
    assert "older than 2 s" in robot.latest["state"].message
    world.spin_until(lambda: robot.distances["least"] == -math.inf, "its stale pairs")
    assert robot.distances["stale"]
    world.spin_until(lambda: robot.least > -math.inf, "fresh joints", lambda: robot.send(there))

    world.daemon.kill()
    world.daemon.wait()
    world.spin_until(lambda: robot.latest["state"].level == ERROR, "the error", lambda: robot.send(there))
    world.spin_until(lambda: robot.least == -math.inf, "no distance without a daemon")
    assert world.url in robot.latest["state"].message
    found = world.check(robot.trajectory(there, home), 0.01, there)
    assert found["result"] == check.INVALID, found


def main():
    with tempfile.TemporaryDirectory() as folder:
        world = World(folder)
        try:
            try_node(world)
        finally:
            world.close()
    print("the node runs on rclpy: states, distances, trajectories, stale joints, a daemon that ends")


if __name__ == "__main__":
    main()
