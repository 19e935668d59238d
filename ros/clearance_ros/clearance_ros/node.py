"""The node: joint_states and planning scenes in, distances out. Its logic is in bridge.py."""

import dataclasses
import math
import os

import rclpy
from clearance_msgs.msg import Distances, PairDistance, TrajectoryCheck
from clearance_msgs.srv import CheckTrajectory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from . import clearance
from .bridge import ERROR, OK, STALE, Bridge, level_of
from .trajectory import INVALID, Check, check_trajectory, trajectory_of


class ClearanceNode(Node):
    """Parameters: url; robot; frame (the world's); margin, within [m]; rate [1/s]; max_age [s; 0 ignores age].

    Subscribes to joint_states and planning_scene (or monitored_planning_scene, remapped). Publishes ~/clearance, the
    certified lower bound of the least distance in metres, or -inf if an input is missing or older than max_age, or if
    the daemon does not answer; ~/distances, the pairs that may be near; and /diagnostics, the state of inputs and
    daemon, on change and every second.
    Checks planned trajectories, as they will be executed: those of display_planned_path, with results on
    ~/trajectory_check, and those of the service ~/check_trajectory.
    """

    def __init__(self):
        super().__init__("clearance")
        url = self.declare_parameter("url", "").value or os.environ.get("CLEARANCE_URL", "")
        if not url:
            raise ValueError("parameter url: expected that of a daemon, such as ipc:///run/clearance/clearance.ipc")
        self._margin = float(self.declare_parameter("margin", 0.02).value)
        self._within = float(self.declare_parameter("within", 0.25).value)
        self._max_age = float(self.declare_parameter("max_age", 1.0).value)
        robot, frame = (self.declare_parameter(name, "").value for name in ("robot", "frame"))
        self._bridge = Bridge(clearance.connect(url), robot, frame)
        self._least = self.create_publisher(Float64, "~/clearance", 10)
        self._distances = self.create_publisher(Distances, "~/distances", 10)
        self._checks = self.create_publisher(TrajectoryCheck, "~/trajectory_check", 10)
        self.create_service(CheckTrajectory, "~/check_trajectory", self._on_request)
        self.create_subscription(JointState, "joint_states", self._guarded(self._bridge.on_joints), 10)
        try:
            from moveit_msgs.msg import DisplayTrajectory, PlanningScene
        except ImportError:
            self.get_logger().info("moveit_msgs is not installed: planning scenes are not followed")  # nor are plans
        else:
            self.create_subscription(PlanningScene, "planning_scene", self._guarded(self._on_scene), 10)
            self.create_subscription(DisplayTrajectory, "display_planned_path", self._on_plan, 10)
        self._state = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._rate = float(self.declare_parameter("rate", 50.0).value)
        self._reported, self._ticks = None, 0
        self.create_timer(1.0 / self._rate, self._guarded(self._publish))
        self._said = []

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
        missing = self._bridge.scene.missing()
        for text in missing:
            if text not in self._said:
                self.get_logger().warning(text)
        self._said = missing

    def _on_plan(self, display):
        """Checks a planned trajectory, and publishes whether it is free, or where and why not."""
        try:
            self._checks.publish(self._checked(trajectory_of(display), self._margin))
        except ValueError as error:
            self._checks.publish(_message(Check(INVALID, str(error), self._margin)))

    def _on_request(self, request, response):
        margin = self._margin if request.margin < 0 else request.margin
        response.check = self._checked(request.trajectory, margin)
        return response

    def _checked(self, trajectory, margin):
        """Never raises for a daemon that does not answer: the trajectory is then not free."""
        given = self._bridge, trajectory, margin, self._max_age
        try:
            try:
                check = check_trajectory(*given)
            except clearance.ClearanceError as error:
                if not self._bridge.recover(error):  # which raises if the daemon is gone
                    raise
                check = check_trajectory(*given)
        except clearance.ClearanceError as error:
            check = Check(INVALID, str(error), margin)
        if check.result:
            self.get_logger().warning(f"trajectory: {check.message}")
        return _message(check)

    def _publish(self):
        try:
            report = self._bridge.report(self._within, self._max_age)
        except clearance.ClearanceError as error:
            if getattr(error, "code", None) != clearance.wire.ErrorCode.WRONG_SCENE:  # else recoverable
                self._least.publish(Float64(data=-math.inf))
                self._say(ERROR, str(error), -math.inf, 0)
            raise
        self._least.publish(Float64(data=report.least))
        message = Distances(least=report.least, stale=report.stale)
        message.header.stamp = self.get_clock().now().to_msg()
        message.pairs = [
            PairDistance(
                body_a=pair.a,
                body_b=pair.b,
                status=int(clearance.Status[pair.status.upper()]),
                beyond_margin=level_of(pair, self._margin) == OK,
                lower=pair.lower,
                upper=pair.upper,
            )
            for pair in report.pairs
        ]
        self._distances.publish(message)
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


def _message(check):
    fields = dataclasses.asdict(check)
    return TrajectoryCheck(**{**fields, "joint_names": list(check.joint_names), "positions": list(check.positions)})


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
