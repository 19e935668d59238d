"""The node: joint_states and planning scenes in, distances out. All that it decides is in bridge.py."""

import os

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from . import clearance
from .bridge import Bridge, level_of


class ClearanceNode(Node):
    """Parameters: url; robot; margin, within [m]; rate [1/s]; max_age [s; 0: age does not count].

    Subscribes to joint_states and planning_scene (or monitored_planning_scene, remapped). Publishes ~/clearance, the
    certified lower bound of the least distance in metres, and ~/distances, a status for each pair that may be near.
    """

    def __init__(self):
        super().__init__("clearance")
        url = self.declare_parameter("url", "").value or os.environ.get("CLEARANCE_URL", "")
        if not url:
            raise ValueError("parameter url: expected that of a daemon, such as ipc:///run/clearance/clearance.ipc")
        self._margin = float(self.declare_parameter("margin", 0.02).value)
        self._within = float(self.declare_parameter("within", 0.25).value)
        self._max_age = float(self.declare_parameter("max_age", 0.0).value)
        self._bridge = Bridge(clearance.connect(url), self.declare_parameter("robot", "").value)
        self._least = self.create_publisher(Float64, "~/clearance", 10)
        self._distances = self.create_publisher(DiagnosticArray, "~/distances", 10)
        self.create_subscription(JointState, "joint_states", self._guarded(self._bridge.on_joints), 10)
        try:
            from moveit_msgs.msg import PlanningScene
        except ImportError:
            self.get_logger().info("moveit_msgs is not there: planning scenes are not followed")
        else:
            self.create_subscription(PlanningScene, "planning_scene", self._guarded(self._on_scene), 10)
        self.create_timer(1.0 / float(self.declare_parameter("rate", 50.0).value), self._guarded(self._publish))
        self._said = {}

    def _guarded(self, act):
        """A bad message, and a daemon that is gone or refuses, is said; the next message is tried again."""

        def call(*message):
            try:
                act(*message)
            except (clearance.ClearanceError, ValueError) as error:
                if isinstance(error, clearance.ClearanceError):
                    self._bridge.recover(error)
                self.get_logger().warning(str(error), throttle_duration_sec=1.0)

        return call

    def _on_scene(self, message):
        self._bridge.scene.on_scene(message)
        for name, why in self._bridge.scene.left_out.items():
            if self._said.get(name) != why:
                self.get_logger().warning(f"{name}: {why}")
        self._said = dict(self._bridge.scene.left_out)

    def _publish(self):
        report = self._bridge.report(self._within, self._max_age)
        self._least.publish(Float64(data=report.least))
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        for pair in report.pairs:
            values = {"lower": repr(pair.lower), "upper": repr(pair.upper)}
            message.status.append(
                DiagnosticStatus(
                    level=bytes([level_of(pair, self._margin)]),
                    name=f"{pair.a} - {pair.b}",
                    message=pair.status,
                    values=[KeyValue(key=key, value=value) for key, value in values.items()],
                )
            )
        self._distances.publish(message)


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
