"""Octomaps in scene files, compared with the occupied leaves according to liboctomap.

octomaps/*.bt and *.ot were written by liboctomap 1.9.7, and *.txt are the centres of the voxels that it reports
occupied in them, after OcTree::expand().
"""

import pathlib

import numpy as np
import pytest

import clearance

FILES = pathlib.Path(__file__).parent / "octomaps"


def from_voxels(points, centres, edge):
    """The distance of each point from the nearest box, with more digits than float64."""
    off = np.abs(points.astype(np.longdouble)[:, None] - centres.astype(np.longdouble)) - np.longdouble(edge) / 2
    return np.sqrt((np.maximum(off, 0) ** 2).sum(2)).min(1)


def load(folder, body):
    (folder / "scene.yaml").write_text(f"bodies:\n  - {body}\n")
    return clearance.Scene.load(folder / "scene.yaml", allow_outside=True)


@pytest.mark.parametrize(
    ("name", "leaves", "edge"),
    [("map.bt", "map.txt", 0.1), ("likely.ot", "map.txt", 0.1), ("colours.ot", "colours.txt", 0.25)],
)
def test_an_octomap_is_its_occupied_voxels(tmp_path, name, leaves, edge):
    centres = np.loadtxt(FILES / leaves)
    scene = load(tmp_path, f"{{name: map, octomap: {FILES / name}, unknown: free, pose: [0,0,0, 1,0,0,0]}}")
    assert scene.bodies[0].is_cloud and scene.source("map").endswith("(octomap)")
    exact = edge == 0.25  # a power of two: nothing is rounded
    assert (scene.bodies[0].model_error == 0) == exact and scene.bodies[0].model_error < 1e-6
    rng = np.random.default_rng(2)
    within = rng.choice(centres, 20) + rng.uniform(-0.3, 0.3, (20, 3)) * edge
    points = np.concatenate([rng.uniform(-2, 2.5, (380, 3)), within])
    scene.add_sphere("probe", 1e-3)
    engine = clearance.Engine(scene, backend="cpu", covers="off")
    poses = np.concatenate([points, np.tile([1.0, 0, 0, 0], (400, 1))], axis=1)[:, None]
    r = engine.distances(pairs=[("map", "probe")], bodies=["probe"], configurations=poses)
    exact_value = from_voxels(points, centres, edge) - np.longdouble(1e-3)
    assert (exact_value < 0).sum() > 5 and (exact_value > 0.01).sum() > 200
    assert (r.lower[:, 0] <= np.maximum(exact_value, 0)).all() and (r.upper[:, 0] >= exact_value).all()
    apart = exact_value > 0.01
    assert ((r.upper - r.lower)[apart, 0] <= 1e-6 * exact_value[apart] + 4 * scene.bodies[0].model_error).all()
    assert (r.status[exact_value < -1e-4] == clearance.Status.OVERLAP).all()


def test_a_map_is_grown_and_replaced_and_saved(tmp_path):
    scene = load(tmp_path, f"{{name: map, octomap: {FILES / 'map.bt'}, unknown: free, radius: 0.02, static: true}}")
    scene.add_sphere("probe", 0.1, pose=[5, 0, 0, 1, 0, 0, 0])
    scene.save(tmp_path / "saved")
    again = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    a, b = (clearance.Engine(s, backend="cpu", covers="off") for s in (scene, again))
    assert a.distances().lower == b.distances().lower and a.distances().upper == b.distances().upper
    assert scene.bodies[0].model_error == again.bodies[0].model_error > 0
    exact_value = from_voxels(np.array([[5.0, 0, 0]]), np.loadtxt(FILES / "map.txt"), 0.1)[0] - np.longdouble(0.12)
    assert a.distances().lower[0, 0] <= exact_value <= a.distances().upper[0, 0]
    a.set_points("map", [[0, 0, 0]])
    assert a.distances().lower[0, 0] == pytest.approx(5 - 0.05 - 0.12)


def test_a_map_without_an_occupied_voxel_is_nothing(tmp_path):
    head = (FILES / "map.bt").read_bytes()
    (tmp_path / "free.bt").write_bytes(head[: head.index(b"data") + 5] + b"\x00\x00")
    (tmp_path / "none.bt").write_bytes(b"# Octomap OcTree binary file\nid OcTree\nsize 0\nres 0.5\ndata\n")
    for name, edge in (("free.bt", 0.1), ("none.bt", 0.5)):
        scene = load(tmp_path, f"{{name: map, octomap: {name}, unknown: free, radius: 0.25, pose: [0,0,0, 1,0,0,0]}}")
        scene.add_sphere("probe", 0.1, pose=[5, 0, 0, 1, 0, 0, 0])
        scene.save(tmp_path / name.replace(".bt", ""))
        again = clearance.Scene.load(tmp_path / name.replace(".bt", "") / "scene.yaml")
        for one in (scene, again):
            engine = clearance.Engine(one, backend="cpu", covers="off")
            r = engine.distances(pairs=[("map", "probe")])
            assert r.status[0, 0] == clearance.Status.BEYOND and r.lower[0, 0] == np.inf
            engine.set_points("map", [[0, 0, 0]])
            assert engine.distances().lower[0, 0] == pytest.approx(5 - edge / 2 - 0.25 - 0.1, abs=1e-6)


def spoilt(change):
    content = (FILES / "map.bt").read_bytes()
    return change(content)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.bt", spoilt(lambda c: c[:-1]), "it ends before its tree does"),
        ("a.bt", spoilt(lambda c: c[: c.index(b"data")]), "it ends within its header"),
        (
            "a.bt",
            spoilt(lambda c: c.replace(b"id OcTree", b"id OcTreeStamped")),
            'the tree "OcTreeStamped" is not read',
        ),
        ("a.bt", spoilt(lambda c: c.replace(b"res 0.1", b"res -1")), "res: expected metres above 0"),
        ("a.bt", spoilt(lambda c: c.replace(b"res 0.1", b"res one")), "expected the edge of a voxel"),
        ("a.bt", spoilt(lambda c: c.replace(b"# Octomap", b"# Octopus")), "it does not begin as an octomap"),
        ("a.bt", spoilt(lambda c: c[: c.index(b"data") + 5]), "it ends before its tree does"),
        ("a.bt", spoilt(lambda c: c[: c.index(b"data") + 5]) + b"\x02\x00", "are more than 20000000 voxels"),
        ("a.bt", spoilt(lambda c: c[: c.index(b"data") + 5]) + b"\x03\x00" * 17, "deeper than 16 levels"),
        ("a.xyz", b"0 0 0\n", "expected .bt or .ot"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, name, content, text):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(clearance.SceneError, match=text):
        load(tmp_path, f"{{name: map, octomap: {name}, unknown: free}}")


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ("", 'an octomap needs the key "unknown"'),
        (", unknown: occupied", "not yet: unknown: occupied"),
        (", unknown: perhaps", "expected free"),
        (", unknown: free, voxel: 0.1", "only points of a file"),
    ],
)
def test_what_is_unknown_is_a_choice(tmp_path, keys, text):
    with pytest.raises(clearance.SceneError, match=text):
        load(tmp_path, f"{{name: map, octomap: {FILES / 'map.bt'}{keys}}}")
    with pytest.raises(clearance.SceneError, match="only an octomap has this key"):
        load(tmp_path, "{name: map, box: 1, unknown: free}")
