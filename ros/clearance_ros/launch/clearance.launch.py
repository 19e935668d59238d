"""Launches the bridge for a running daemon: ros2 launch clearance_ros clearance.launch.py robot:=panda"""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

ARGUMENTS = {
    "url": ("", "of the daemon; empty: CLEARANCE_URL"),
    "robot": ("", "the robot of the scene whose joints joint_states has; empty: names there are whole"),
    "frame": ("", "the world's frame in planning scenes; empty: world, or the robot's root link at its origin"),
    "margin": ("0.02", "metres: warn of pairs that may be nearer"),
    "within": ("0.25", "metres: publish pairs that may be nearer"),
    "rate": ("50.0", "answers a second, at most"),
    "max_age": ("1.0", "seconds: an older input leaves no distance; 0: age does not count"),
}


def generate_launch_description():
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in ARGUMENTS.items()
    ]
    parameters = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    return LaunchDescription(
        [*declared, Node(package="clearance_ros", executable="bridge", name="clearance", parameters=[parameters])]
    )
