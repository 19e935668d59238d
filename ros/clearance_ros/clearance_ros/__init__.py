"""Clearance for ROS 2: bridge.py and planning_scene.py are the logic and need no ROS, node.py is the node."""

try:
    import clearance
except ImportError:  # the client's own wheel, clearance-client
    import clearance_client as clearance  # type: ignore[no-redef]

__all__ = ["clearance"]
