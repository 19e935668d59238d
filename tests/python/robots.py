"""A scene with an arm of eight joints of all kinds."""

import numpy as np

import clearance
from scenes import at

#: The same as arm_scene(), for a daemon in a folder with arm.urdf.
ARM_YAML = (
    "bodies:\n  - {name: table, box: [1, 1, 0.1], static: true, pose: [0.5, 0, -0.1, 1, 0, 0, 0]}\n"
    "  - {name: cup, sphere: 0.05, pose: [0.4, 0.3, 0.5, 1, 0, 0, 0]}\n"
    "robots:\n  - {name: arm, urdf: arm.urdf, home: {joint4: -1.5}}\n"
)


def arm_scene(urdf, **options):
    scene = clearance.Scene()
    scene.add_box("table", [1, 1, 0.1], static=True, pose=at(0.5, 0, -0.1))
    scene.add_sphere("cup", 0.05, pose=at(0.4, 0.3, 0.5))
    scene.add_robot("arm", urdf, **{"home": {"joint4": -1.5}, **options})
    return scene


def rows_of(arm, count, seed=1):
    """(count, J) positions within the limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(arm.lower, arm.upper, (count, len(arm)))
