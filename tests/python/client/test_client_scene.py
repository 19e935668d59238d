"""A client that changes a daemon's scene, or may not: attachments, bodies added and removed, reloads, keys."""

import subprocess

import numpy as np
import pytest

import clearance
from clearance.wire import ErrorCode
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S
from scenes import at

PROGRAM = "clearance" if INSTALLED else str(BUILD / "bin" / "clearance")


def test_attachments_of_another_client(ipc):
    ours = clearance.connect(ipc.urls["ipc"], timeout_s=PATIENCE_S)
    theirs = clearance.connect(ipc.urls["ipc"], timeout_s=PATIENCE_S)
    before = ours.distances(pairs=("ball", "*"))
    done = theirs.attach("ball", "gripper", at(0, 0.3, 0))
    assert theirs.scene_revision == done.scene_revision != ours.scene_revision
    assert theirs.bodies[theirs.body_id("ball")].parent == theirs.body_id("gripper")
    after = ours.distances(pairs=("ball", "*"))  # adopts the scene, in which its ids mean the same
    assert after.scene_revision == done.scene_revision and after.lower.shape[1] < before.lower.shape[1]
    with pytest.raises(clearance.QueryError, match="the scene has changed since this answer"):
        before.pairs
    theirs.attach("ball", None)
    ours.refresh()
    assert ours.bodies[ours.body_id("ball")].parent is None
    assert ours.distances(pairs=("ball", "*")).lower.shape == before.lower.shape
    with pytest.raises(clearance.QueryError):
        theirs.attach("table", "gripper")


def test_bodies_come_and_go(start_daemon, cell, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "bodies:\n  - {name: gripper, sphere: 0.1, pose: [0,0,0, 1,0,0,0]}\n  - "
        "{name: wall, box: [1,1,1], pose: [5,0,0, 1,0,0,0]}\n"
    )
    daemon = start_daemon(scene, ["ipc"])
    with clearance.connect(daemon.urls["ipc"]) as client:
        before = client.distances().scene_revision
        mug = client.add_body("mug", box=[0.2, 0.2, 0.2], parent="gripper", pose=at(1, 0, 0))
        assert (mug.body, mug.body_count) == (2, 3) and mug.scene_revision != before
        assert [body.name for body in client.bodies] == ["gripper", "wall", "mug"]
        r = client.distances(pairs=("mug", "wall"))
        assert r.distance[0, 0] == pytest.approx(5 - 0.5 - 1 - 0.1)
        client.set_poses({"gripper": at(1, 0, 0)})
        assert client.distances(pairs=("mug", "wall")).distance[0, 0] == pytest.approx(2.4)
        client.add_body("tip", np.zeros((1, 3)), radius=0.5, pose=at(0, 0, 3))
        assert client.distances(pairs=("tip", "gripper")).distance[0, 0] == pytest.approx(np.sqrt(10) - 0.6)
        two = [{shape: (0.1, 0.5)} for shape in ("capsule", "cylinder", "cone")]
        for shape in ({"sphere": 0.1}, *two, {"ellipsoid": (0.1, 0.2, 0.3)}, {"half_space": True}):
            client.add_body("part", **shape)
            client.remove_body("part")

        with pytest.raises(clearance.QueryError, match="is already that of a body"):
            client.add_body("mug", sphere=1.0)
        with pytest.raises(clearance.QueryError, match="was loaded with the scene"):
            client.remove_body("wall")
        with pytest.raises(ValueError, match="capsule, cylinder, cone, ellipsoid, half_space, points, got none"):
            client.add_body("thing")
        with pytest.raises(ValueError, match=r"box: expected three numbers, got \[1, 2\]"):
            client.add_body("thing", box=[1, 2])
        with pytest.raises(ValueError, match=r"vertices: expected shape \(V, 3\)"):
            client.add_body("thing", [[1, 2]])
        client.remove_body("tip")
        assert client.remove_body("mug").body_count == 2
        assert client.distances().scene_revision == before


def test_what_is_not_known_of_an_added_body_is_in_its_answers(start_daemon, tmp_path):
    (tmp_path / "scene.yaml").write_text("bodies: [{name: wall, box: [1, 1, 1], static: true}]\n")
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    uncertainties = {"uncertainty": {"position": 0.1, "angle": 0.02}, "padding": 0.3}
    scene = clearance.Scene()
    scene.add_box("wall", [1, 1, 1], static=True)
    scene.add_body("crate", box=[0.2, 0.2, 0.2], pose=at(3), **uncertainties)
    expected = clearance.Engine(scene, threads=1).distances(pairs=("crate", "wall"))
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        client.add_body("crate", box=[0.2, 0.2, 0.2], pose=at(3), **uncertainties)
        answer = client.distances(pairs=("crate", "wall"))
        assert (answer.lower, answer.upper) == (expected.lower, expected.upper)
        assert answer.lower < 3 - 0.5 - 0.1 - 0.4 < answer.upper
        client.add_body("walker", sphere=0.1, pose=at(0, 4), max_speed=1.0)
        walker = client.distances(pairs=("walker", "wall"))
        assert walker.lower < 3.4 - 1e-7 and walker.upper >= 3.4, "its pose has an age"
        for wrong, text in [
            ({"uncertainty": {"angle": 4}}, "uncertainty.angle: expected 0 to 3.2 radians, got 4"),
            ({"uncertainty": {"position": -1}}, "uncertainty.position: expected a number of metres >= 0, got -1"),
            ({"padding": -0.1}, "padding: expected a number of metres >= 0, got -0.1"),
            ({"max_speed": np.inf}, "max_speed: expected a number of metres a second >= 0, got inf"),
        ]:
            with pytest.raises(clearance.QueryError, match=text):
                client.add_body("odd", sphere=0.1, **wrong)
        assert len(client.bodies) == 3


def test_a_mesh_is_added_as_what_it_is(start_daemon, tmp_path):
    (tmp_path / "scene.yaml").write_text("bodies: [{name: wall, box: [1, 1, 1], static: true}]\n")
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    two = np.concatenate([vertices, vertices + 5]), np.concatenate([triangles, triangles + 4])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        client.add_body("solid", mesh=(vertices, triangles), mesh_as="solid", parent="wall", pose=at(3))
        client.add_body("surface", mesh=(vertices, triangles[:2]), mesh_as="surface", pose=at(3), padding=0.1)
        client.add_body("hull", mesh=(vertices, triangles), pose=at(3))
        client.add_body("found out", mesh=two, pose=at(3))
        assert [(body.triangle_count, body.is_solid) for body in client.bodies] == [
            (0, False), (4, True), (2, False), (0, False), (8, True)
        ]  # fmt: skip
        scene = clearance.Scene()
        scene.add_box("wall", [1, 1, 1], static=True)
        scene.add_body("solid", mesh=(vertices, triangles), mesh_as="solid", parent="wall", pose=at(3))
        scene.add_body("surface", mesh=(vertices, triangles[:2]), mesh_as="surface", pose=at(3), padding=0.1)
        scene.add_body("hull", mesh=(vertices, triangles), pose=at(3))
        scene.add_body("found out", mesh=two, pose=at(3))
        assert client.distances().scene_revision == scene.revision
        for mesh, text in [
            ((vertices, triangles[:3]), "the mesh encloses no volume: the edge from .* belongs to no other triangle"),
            ((vertices, [[0, 1, 4]]), "triangle 0 names the vertex 4, and there are 4"),
            ((vertices, np.tile(triangles, (10001, 1))), "40004 triangles are more than the 40000"),
        ]:
            with pytest.raises(clearance.QueryError, match=text):
                client.add_body("odd", mesh=mesh, mesh_as="solid")
        assert client.distances(pairs=("surface", "wall"), signed_distance=True).upper[0, 0] == pytest.approx(2.4)


def test_a_cloud_is_added_and_replaced(start_daemon, tmp_path):
    (tmp_path / "scene.yaml").write_text("bodies: [{name: wall, box: [1, 1, 1], static: true}]\n")
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    points = np.random.default_rng(4).uniform(-0.4, 0.4, (3000, 3)).astype(np.float32)
    clouds = {
        "seen": {"points": points, "radius": 0.01, "pose": at(2, 0.1, 0.2), "uncertainty": {"position": 0.02}},
        "voxels": {"points": points[:50], "voxel": 0.05, "pose": at(0, 2)},
        "nothing": {"points": [], "pose": at(0, 0, 2)},
        "held": {"points": points, "parent": "seen", "pose": at(0.5)},
    }
    scene = clearance.Scene()
    scene.add_box("wall", [1, 1, 1], static=True)
    for name, cloud in clouds.items():
        scene.add_body(name, **cloud)
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        for name, cloud in clouds.items():
            client.add_body(name, **cloud)
        assert [body.is_cloud for body in client.bodies] == [False, True, True, True, True]
        engine = clearance.Engine(scene, threads=1)
        for step in ("added", "replaced"):
            ours, theirs = (who.distances(pairs=("wall", "*")) for who in (engine, client))
            assert (ours.lower == theirs.lower).all() and (ours.upper == theirs.upper).all(), step
            assert np.isfinite(ours.upper[0]).tolist() == [True, True, step == "replaced", True]
            for who in (engine, client):
                assert who.set_points("nothing", points[:10]).applied == 10
        client.add_body("ball", sphere=0.1, pose=at(9))  # another edit keeps the received points
        later = client.distances(pairs=("wall", "*"))
        assert (later.upper[0, :4] == ours.upper[0]).all()
        client.remove_body("nothing")
        for wrong, error in [
            ({"points": [[0, 0, np.nan]]}, "point 0 has the coordinate nan"),
            ({"points": points, "voxel": -1.0}, "voxel"),
            ({"points": np.zeros((80_001, 3))}, "80001 points are more than the 80000 .*limit max-added-points"),
        ]:
            with pytest.raises(clearance.QueryError, match=error):
                client.add_body("odd", **wrong)
        with pytest.raises(ValueError, match=r"voxel: expected 0 where there are no points, got 0\.1"):
            client.add_body("odd", sphere=0.1, voxel=0.1)


def test_keys(start_daemon, cell, tmp_path, monkeypatch):
    keys = tmp_path / "keys"
    keys.mkdir(mode=0o700)

    def keygen(file):
        return subprocess.run([PROGRAM, "keygen", file], check=True, stdout=subprocess.PIPE, text=True).stdout.strip()

    keygen(keys / "server.key")
    (keys / "authorized").write_text(f"{keygen(tmp_path / 'probe.key')} query probe\n")
    keygen(tmp_path / "stranger.key")
    url = start_daemon(cell, ["tcp"], "--keys", str(keys)).urls["tcp"]
    server = keys / "server.key.pub"

    with clearance.connect(url, server_key=server, key=tmp_path / "probe.key") as client:
        assert client.distances(reduce="min").upper.shape == (1,)
        with pytest.raises(clearance.RequestError, match='needs the right "poses"; this client has query') as rejected:
            client.set_poses({"cup": at(0, 0, 3)})
        assert rejected.value.code == ErrorCode.FORBIDDEN
    with pytest.raises(clearance.ConnectionError, match="rejects this client's key"):
        clearance.connect(url, server_key=server, key=tmp_path / "stranger.key")
    with pytest.raises(clearance.ConnectionError, match="needs keys"):
        clearance.connect(url)
    monkeypatch.setenv("CLEARANCE_SERVER_KEY", str(server))
    with pytest.raises(ValueError, match="key is missing"):
        clearance.connect(url)
    monkeypatch.setenv("CLEARANCE_KEY", str(tmp_path / "probe.key"))
    assert clearance.connect(url).bodies


def test_reload(start_daemon, tmp_path):
    scene = tmp_path / "scene.yaml"
    ball = "bodies:\n  - {name: ball, sphere: 1, pose: [0,0,0, 1,0,0,0]}\n"
    scene.write_text(ball)
    daemon = start_daemon(scene, ["ipc"])
    with clearance.connect(daemon.urls["ipc"]) as client:
        before = client.distances().scene_revision
        scene.write_text(ball + "  - {name: box, box: [1, 1, 1], pose: [3,0,0, 1,0,0,0]}\n")
        changed = client.reload()
        assert changed.body_count == 2 and changed.scene_revision != before
        assert client.distances(pairs=("ball", "box")).distance[0, 0] == pytest.approx(1.5)

        scene.write_text("bodies: [{name: ball, sphere: -1}]")
        with pytest.raises(clearance.RequestError, match=r"scene.yaml:1: bodies\[0\]") as rejected:
            client.reload()
        assert rejected.value.code == ErrorCode.RELOAD_FAILED
        assert client.distances().scene_revision == changed.scene_revision
