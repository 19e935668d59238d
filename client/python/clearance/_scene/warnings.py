"""Warnings about bodies that are added to a scene."""

from __future__ import annotations

from typing import Any

from .._errors import MeshWarning, PoseWarning, RobotWarning, warn

_NAMED_IN_WARNING = 5


def warn_of_files(scene: Any) -> None:
    """Warns of each entry of a scene file that is valid but probably a mistake."""
    for text in scene.warnings():
        warn(text, PoseWarning)


def warn_of_robots(scene: Any, first: int) -> None:
    for text in scene.robot_warnings(first):
        warn(text, RobotWarning)


def warn_of_meshes(scene: Any, first: int) -> None:
    """Warns once for all bodies from `first` on whose meshes are probably taken for the wrong kind."""
    found = scene.mesh_warnings(first)
    if not found:
        return
    text = "; ".join(f"{name}: {what}" for name, what in found[:_NAMED_IN_WARNING])
    if len(found) > _NAMED_IN_WARNING:
        text = f"{len(found)} bodies: {text}; and {len(found) - _NAMED_IN_WARNING} more"
    warn(text, MeshWarning)
