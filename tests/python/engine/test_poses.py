"""Matrices to poses."""

import numpy as np
import pytest

import clearance
from clearance import pose7_from_matrix
from clearance._poses import as_pose7


def matrix_of(pose):
    """Independent of the package: M(q) / |q|^2."""
    x, y, z, w, a, b, c = pose
    n = w * w + a * a + b * b + c * c
    m = np.eye(4)
    m[:3, :3] = np.array([
        [w * w + a * a - b * b - c * c, 2 * (a * b - w * c), 2 * (a * c + w * b)],
        [2 * (a * b + w * c), w * w - a * a + b * b - c * c, 2 * (b * c - w * a)],
        [2 * (a * c - w * b), 2 * (b * c + w * a), w * w - a * a - b * b + c * c],
    ]) / n  # fmt: skip
    m[:3, 3] = x, y, z
    return m


def rotation_matrix(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return matrix_of([0, 0, 0, np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def test_round_trip_of_random_rotations():
    rng = np.random.default_rng(7)
    q = rng.normal(size=(2000, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    poses = np.concatenate([rng.normal(size=(2000, 3)), q], axis=1)
    matrices = np.array([matrix_of(pose) for pose in poses])
    back = pose7_from_matrix(matrices)
    largest = np.abs(q).argmax(axis=1)
    assert all((largest == i).sum() > 100 for i in range(4)), "every branch was taken"
    assert np.array_equal(back[:, :3], poses[:, :3])
    assert (back[:, 3] >= 0).all()
    same = np.minimum(np.abs(back[:, 3:] - q).max(axis=1), np.abs(back[:, 3:] + q).max(axis=1))
    assert same.max() < 1e-15


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 3)])
@pytest.mark.parametrize("off", [0.0, 1e-15, -1e-12, 1e-9, 1e-6])
def test_half_turns_lose_nothing(axis, off):
    m = rotation_matrix(axis, np.pi + off)
    assert np.abs(matrix_of(pose7_from_matrix(m)) - m).max() < 1e-15


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-5])
def test_small_turns_lose_nothing(angle):
    m = rotation_matrix((1, 2, -3), angle)
    assert np.abs(matrix_of(pose7_from_matrix(m)) - m).max() < 2e-16


def test_matrix_from_float32_becomes_the_nearest_rotation():
    rng = np.random.default_rng(8)
    for _ in range(200):
        exact = rotation_matrix(rng.normal(size=3), rng.uniform(0, 2 * np.pi))
        rounded = exact.astype(np.float32)
        r = matrix_of(pose7_from_matrix(rounded))[:3, :3]
        u, _, vt = np.linalg.svd(rounded[:3, :3].astype(np.float64))
        assert np.abs(r - u @ vt).max() < 1e-13  # the polar factor


def test_shapes():
    eye = np.broadcast_to(np.eye(4), (3, 2, 4, 4))
    assert pose7_from_matrix(eye).shape == (3, 2, 7)
    assert as_pose7(eye, "x").shape == (3, 2, 7)
    assert as_pose7(np.eye(4).tolist(), "x").tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert as_pose7(np.zeros((0, 4, 4)), "x").shape == (0, 7)


def test_contiguous_float64_is_not_copied():
    a = np.zeros((5, 2, 7))
    assert as_pose7(a, "x") is a
    b = np.zeros((5, 2, 8))[..., :7]
    assert as_pose7(b, "x") is not b and as_pose7(b, "x").flags.c_contiguous
    big_endian = np.arange(7, dtype=">f8")
    assert as_pose7(big_endian, "x").dtype == np.float64 and as_pose7(big_endian, "x")[3] == 3


@pytest.mark.parametrize("change, why", [
    (lambda m: m[0].__setitem__(slice(0, 3), m[0, :3] * 1.01), r"not a rotation"),
    (lambda m: m.__setitem__((slice(0, 3), 0), -m[:3, 0]), r"mirrors"),
    (lambda m: m.__setitem__((3, 0), 0.5), r"its last row is \[0.5, 0.0, 0.0, 1.0\]"),
    (lambda m: m.__setitem__((3, 3), 0), r"expected \[0, 0, 0, 1\]"),
    (lambda m: m.__setitem__((slice(0, 3), slice(0, 3)), 0), r"not a rotation"),
])  # fmt: skip
def test_non_rigid_matrix_is_refused(change, why):
    m = np.array([rotation_matrix((1, 2, 3), 0.3)] * 3)
    change(m[1])
    with pytest.raises(ValueError, match=r"configurations\[1\]: not a rigid transform: " + ".*" + why):
        as_pose7(m, "configurations")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_matrix_becomes_a_bad_pose(value):
    m = np.array([np.eye(4)] * 2)
    m[1, 0, 3] = value
    poses = pose7_from_matrix(m)
    assert np.isnan(poses[1]).all() and poses[0].tolist() == [0, 0, 0, 1, 0, 0, 0]


@pytest.mark.parametrize("value, error, text", [
    (np.zeros(6), ValueError,
     r"p: expected poses of 7 numbers \[x, y, z, qw, qx, qy, qz\] or \(4, 4\) matrices, got shape \(6,\)"),
    (np.zeros((3, 4)), ValueError, r"got shape \(3, 4\)"),
    (1.0, ValueError, r"got shape \(\)"),
    (["a"] * 7, TypeError, r"p: expected numbers, got an array of <U1"),
    ([[1, 2], [3]], TypeError, r"p: expected numbers"),
    (np.zeros(7, dtype=complex), TypeError, r"p: expected numbers, got an array of complex128"),
    ([True] * 7, TypeError, r"p: expected numbers, got an array of bool"),
    (None, TypeError, r"p: expected numbers"),
])  # fmt: skip
def test_wrong_shapes_and_types(value, error, text):
    with pytest.raises(error, match=text):
        as_pose7(value, "p")


def test_least_distances_do_not_pass_over_a_body_without_a_pose():
    scene = clearance.Scene()
    scene.add_box("robot", [0.2, 0.2, 0.2], pose=[0, 0, 0, 1, 0, 0, 0])
    scene.add_box("far", [0.1, 0.1, 0.1], pose=[3, 0, 0, 1, 0, 0, 0], static=True)
    scene.add_sphere("person", 0.3)
    engine = clearance.Engine(scene, covers="off")
    start, end = [[[0, 0, 0, 1, 0, 0, 0]]], [[[0.1, 0, 0, 1, 0, 0, 0]]]

    def answers():
        yield engine.distances(reduce="min")
        yield engine.distances(reduce="nearest", fields=["lower", "status"])
        yield engine.distances(pairs=("robot", "*"), reduce="min", fields=["lower", "status"])
        yield engine.motions(start, end, bodies=["robot"])
        yield engine.motions(start, end, bodies=["robot"], reduce="any", fields=["lower", "status"])

    for r in answers():
        assert set(np.ravel(r.status)) == {clearance.Status.NO_POSE} and np.all(r.lower == -np.inf)
    engine.set_poses({"person": [np.nan, 0, 1, 1, 0, 0, 0]})
    for r in answers():
        assert set(np.ravel(r.status)) == {clearance.Status.BAD_POSE} and np.all(r.lower == -np.inf)
    engine.set_poses({"person": [0, 2, 0, 1, 0, 0, 0]})
    for r in answers():
        assert clearance.Status.BAD_POSE not in np.ravel(r.status) and np.all(r.lower > 0)
