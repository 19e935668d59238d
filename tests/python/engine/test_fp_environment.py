"""Answers in process do not depend on the calling thread's rounding mode and floating-point traps."""

import ctypes
import platform

import numpy as np
import pytest

import clearance
from scenes import random_poses

#: The C library's values of fenv.h: FE_DOWNWARD, FE_UPWARD, FE_TOWARDZERO, FE_INVALID.
NUMBERS = {
    "x86_64": ({"downward": 0x400, "upward": 0x800, "toward_zero": 0xC00}, 1),
    "aarch64": ({"downward": 0x800000, "upward": 0x400000, "toward_zero": 0xC00000}, 1),
}
pytestmark = pytest.mark.skipif(platform.machine() not in NUMBERS, reason="other numbers in fenv.h")
LIBM = ctypes.CDLL("libm.so.6")
COLUMNS = ("distance", "lower", "upper", "status", "flags", "point_a", "point_b", "normal")


def hard_scene():
    """Needles, slabs and grown hulls, many of which touch or overlap, built without the cache."""
    rng = np.random.default_rng(29)
    scene = clearance.Scene()
    for i in range(40):
        shape = rng.normal(size=(10, 3)) * 10.0 ** rng.uniform(-3, 0, 3)
        scene.add_hull(f"body{i}", shape, radius=0.1 if i % 4 == 0 else 0.0)
    scene.add_cylinder("post", 0.1, 0.7)
    scene.add_box("slab", [2.1, 0.3, 1e-5], radius=0.01)
    return scene, random_poses(rng, 42, 0.7)


def answers(poses_of, threads):
    scene, poses = poses_of
    engine = clearance.Engine(scene, backend="cpu", threads=threads, covers="off")
    engine.set_poses(poses)
    found = [engine.scene_revision]
    for options in ({}, {"signed_distance": True}, {"precision": "f32"}, {"rel_tol": 0.0}, {"reduce": "nearest"}):
        r = engine.prepare("distances", fields=("default", "flags", "points", "normal"), **options).run()
        found += [getattr(r, column).tobytes() for column in COLUMNS]
    return [*found, engine.distances(fields="bounds").bounds.tobytes()]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("state", ["downward", "upward", "toward_zero", "traps"])
def test_bits_are_those_of_the_default_state(state, threads):
    directions, invalid = NUMBERS[platform.machine()]
    made = hard_scene()
    expected = answers(made, threads)
    nearest = LIBM.fegetround()
    if state == "traps":
        LIBM.feenableexcept(invalid)
    else:
        assert LIBM.fesetround(directions[state]) == 0
    try:
        seen = answers(made, threads)
        after = LIBM.fegetexcept() if state == "traps" else LIBM.fegetround()
    finally:
        LIBM.fedisableexcept(invalid)
        LIBM.fesetround(nearest)
    assert after == (invalid if state == "traps" else directions[state]), "the caller's state is the caller's"
    for i, (a, b) in enumerate(zip(seen, expected)):
        assert a == b, f"column {i}"


@pytest.mark.parametrize("state", ["downward", "upward"])
def test_scenes_are_the_same(state):
    expected = hard_scene()[0]
    LIBM.fesetround(NUMBERS[platform.machine()][0][state])
    try:
        scene = clearance.Scene()
        for body in range(40):
            vertices, radius = expected.pieces(body)[0]
            scene.add_hull(f"body{body}", vertices, radius=radius)
        scene.add_cylinder("post", 0.1, 0.7)
        seen = [
            scene.pieces("post")[0][0].tobytes(),
            clearance.Engine(scene, backend="cpu", covers="off").pose_revision,
        ]
    finally:
        LIBM.fesetround(0)
    assert seen[0] == expected.pieces("post")[0][0].tobytes()
