"""The node: joint_states and planning scenes in, distances out. Its logic is in bridge.py."""

import math
import os

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from . import clearance
from .bridge import ERROR, OK, STALE, Bridge, level_of


class ClearanceNode(Node):
    """Parameters: url; robot; margin, within [m]; rate [1/s]; max_age [s; 0 ignores age].

    Subscribes to joint_states and planning_scene (or monitored_planning_scene, remapped). Publishes ~/clearance, the
    certified lower bound of the least distance in metres, or -inf if an input is missing or older than max_age, or if
    the daemon does not answer; ~/distances, a status for each pair that may be near; and /diagnostics, the state of
    inputs and daemon, on change and every second.
    """

    def __init__(self):
        super().__init__("clearance")
        url = self.declare_parameter("url", "").value or os.environ.get("CLEARANCE_URL", "")
        if not url:
            raise ValueError("parameter url: expected that of a daemon, such as ipc:///run/clearance/clearance.ipc")
        self._margin = float(self.declare_parameter("margin", 0.02).value)
        self._within = float(self.declare_parameter("within", 0.25).value)
        self._max_age = float(self.declare_parameter("max_age", 1.0).value)
        self._bridge = Bridge(clearance.connect(url), self.declare_parameter("robot", "").value)
        self._least = self.create_publisher(Float64, "~/clearance", 10)
        self._distances = self.create_publisher(DiagnosticArray, "~/distances", 10)
        self.create_subscription(JointState, "joint_states", self._guarded(self._bridge.on_joints), 10)
        try:
            from moveit_msgs.msg import PlanningScene
        except ImportError:
            self.get_logger().info("moveit_msgs is not installed: planning scenes are not followed")
        else:
            self.create_subscription(PlanningScene, "planning_scene", self._guarded(self._on_scene), 10)
        self._state = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._rate = float(self.declare_parameter("rate", 50.0).value)
        self._reported, self._ticks = None, 0
        self.create_timer(1.0 / self._rate, self._guarded(self._publish))
        self._said = {}

    def _guarded(self, act):
        """Reports a bad message, or a daemon that is gone or rejects it; the next message is tried again."""

        def call(*message):
            try:
                try:
                    act(*message)
                except clearance.ClearanceError as error:
                    self._bridge.recover(error)
                    raise
            except (clearance.ClearanceError, ValueError) as error:
                self.get_logger().warning(str(error), throttle_duration_sec=1.0)

        return call

    def _on_scene(self, message):
        self._bridge.scene.on_scene(message)
        for name, why in self._bridge.scene.left_out.items():
            if self._said.get(name) != why:
                self.get_logger().warning(f"{name}: {why}")
        self._said = dict(self._bridge.scene.left_out)

    def _publish(self):
        try:
            report = self._bridge.report(self._within, self._max_age)
        except clearance.ClearanceError as error:
            if getattr(error, "code", None) != clearance.wire.ErrorCode.WRONG_SCENE:  # else recoverable
                self._least.publish(Float64(data=-math.inf))
                self._say(ERROR, str(error), -math.inf, 0)
            raise
        self._least.publish(Float64(data=report.least))
        self._distances.publish(
            self._array(
                _status(
                    level_of(pair, self._margin),
                    f"{pair.a} - {pair.b}",
                    pair.status,
                    lower=repr(pair.lower),
                    upper=repr(pair.upper),
                )
                for pair in report.pairs
            )
        )
        self._say(STALE if report.stale else OK, "; ".join(report.stale), report.least, report.stamp_ns)

    def _say(self, level, text, least, stamp):
        """Publishes the state of the node when it changes, and once per second."""
        self._ticks += 1
        if (level, text) == self._reported and self._ticks < self._rate:
            return
        self._reported, self._ticks = (level, text), 0
        state = _status(level, "clearance: inputs and daemon", text, clearance=repr(least), stamp_ns=str(stamp))
        self._state.publish(self._array([state]))

    def _array(self, statuses):
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status.extend(statuses)
        return message


def _status(level, name, message, **values):
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(level=bytes([level]), name=name, message=message, values=pairs)


def main():
    rclpy.init()
    node = ClearanceNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
