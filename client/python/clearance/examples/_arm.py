"""An arm of three links on a table, next to a box, for the examples."""

from __future__ import annotations

import pathlib
import tempfile
from typing import Any

import clearance

#: Result of an example: its scene, the engine, and (N, 2, 3) lines, in metres, for a picture.
Shown = tuple[clearance.Scene, clearance.Engine, Any]

_LINK = """<link name="{name}"><collision><origin xyz="0.2 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.03" length="0.34"/></geometry></collision></link>
<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="{x} 0 0"/>
  <axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
_LINKS = (
    ("upper", "turn", "base", "0", "0 0 1"),
    ("fore", "lift", "upper", "0.4", "0 1 0"),
    ("hand", "bend", "fore", "0.4", "0 1 0"),
)


def arm_scene() -> clearance.Scene:
    """A scene with the robot "arm" (joints turn, lift, bend), a table and a box."""
    links = "".join(
        _LINK.format(name=name, joint=joint, parent=parent, x=x, axis=axis) for name, joint, parent, x, axis in _LINKS
    )
    scene = clearance.Scene()
    with tempfile.TemporaryDirectory() as folder:
        urdf = pathlib.Path(folder) / "arm.urdf"
        urdf.write_text(f'<robot name="arm"><link name="base"/>{links}</robot>', encoding="utf-8")
        scene.add_robot("arm", urdf, static=True, base=[0, 0, 0.5, 1, 0, 0, 0])
    scene.add_box("table", [1.6, 1.6, 0.04], static=True, pose=[0.5, 0, -0.02, 1, 0, 0, 0])
    scene.add_box("box", [0.2, 0.2, 0.7], static=True, pose=[0.7, 0.5, 0.35, 1, 0, 0, 0])
    return scene
