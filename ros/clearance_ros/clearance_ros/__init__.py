"""Clearance beside ROS 2: bridge.py and planning_scene.py are the logic and need no ROS, node.py is the node."""
