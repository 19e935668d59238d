"""Bodies of points: created, replaced in this process and through every transport, and rejected."""

import importlib.util
import time

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S

SCENE = """
bodies:
  - {name: cloud, points: [], radius: 0.01, pose: [0,0,0, 1,0,0,0]}
  - {name: live, points: [], requires_pose: true}
  - {name: voxels, points: points.xyz, voxel: 0.5, pose: [0,0,50, 1,0,0,0]}
  - {name: ground, height_field: ground.npy, cell: 0.5, pose: [0,0,-50, 1,0,0,0]}
  - {name: ball, sphere: 0.5, pose: [10,0,0, 1,0,0,0]}
"""


@pytest.fixture
def scene_file(tmp_path):
    (tmp_path / "points.xyz").write_text("# x y z\n0 0 0\n1 0 0 255 0 0\n")
    heights = np.zeros((5, 7), np.float32)
    heights[2, 3] = 2
    np.save(tmp_path / "ground.npy", heights)
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def gap(who, other="ball", body="cloud"):
    """The bounds of a body's distance to the given accuracy, or None if there is no distance."""
    answer = who.distances(pairs=[(body, other)])
    if answer.status[0, 0] != clearance.Status.OK:
        return None
    assert answer.lower[0, 0] <= answer.upper[0, 0] <= answer.lower[0, 0] + 1e-4
    return answer.lower[0, 0], answer.upper[0, 0]


def expect(bounds, distance):
    assert bounds is not None and bounds[0] <= distance <= bounds[1], (bounds, distance)


def exact(points, radius):
    """The least distance to the ball, exact up to the last digits."""
    return np.sqrt(((points.astype(np.longdouble) - [10, 0, 0]) ** 2).sum(1)).min() - 0.5 - radius


def check_updates(who):
    rng = np.random.default_rng(7)
    assert who.distances(pairs=[("cloud", "ball")]).status[0, 0] == clearance.Status.BEYOND  # no points yet
    assert who.distances(pairs=[("live", "ball")]).status[0, 0] == clearance.Status.NO_POSE  # no pose yet
    for n, radius in ((1, None), (5000, 0.02), (30000, 0.0)):
        points = rng.normal(size=(n, 3)).astype(np.float32)
        done = who.set_points("cloud", points, radius)
        assert done.applied == n
        low, high = gap(who)
        exact_value = float(exact(points, 0.01 if radius is None else radius))
        assert low - 1e-12 <= exact_value <= high + 1e-12
    who.set_points("cloud", [])
    assert who.distances(pairs=[("cloud", "ball")]).status[0, 0] == clearance.Status.BEYOND
    who.set_points("live", np.array([[1.0, 0, 0]]))
    assert gap(who, body="live") is None
    who.set_poses({"live": [0, 0, 1, 1, 0, 0, 0]})
    expect(gap(who, body="live"), np.sqrt(82.0) - 0.5)
    with pytest.raises(clearance.QueryError, match="'ball' is not a point cloud"):
        who.set_points("ball", points)
    with pytest.raises(clearance.QueryError, match="point 1 has the coordinate nan"):
        who.set_points("cloud", [[0, 0, 0], [0, np.nan, 0]])
    with pytest.raises(ValueError, match=r"expected shape \(N, 3\)"):
        who.set_points("cloud", [[0, 0]])
    with pytest.raises(ValueError, match="clouds"):
        who.set_points("clouds", points)


def test_in_this_process(scene_file):
    engine = clearance.Engine(clearance.Scene.load(scene_file), backend="cpu", covers="off")
    assert [body.is_cloud for body in engine.bodies] == [True, True, True, False, False]
    check_updates(engine)
    expect(gap(engine, body="voxels", other="ground"), np.sqrt(97.75**2 + 0.25**2 + 0.75**2))  # from the peak
    engine.set_points("voxels", [[0, 0, 0.125]])
    expect(gap(engine, body="voxels", other="ball"), np.sqrt(9.75**2 + 49.875**2) - 0.5)


def test_through_every_transport(scene_file, start_daemon, kind):
    daemon = start_daemon(scene_file, [kind])
    with clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        assert [body.is_cloud for body in client.bodies] == [True, True, True, False, False]
        check_updates(client)
        assert client.stats()["points.updates"] == 5
        assert client.stats()["engine.points"] == 1 + 2


def test_what_is_too_much_is_refused(scene_file, start_daemon):
    daemon = start_daemon(scene_file, ["ipc"], "--limit", "max-body-points=1000", "--limit", "max-client-points=2500")
    url = daemon.urls["ipc"]
    with clearance.connect(url, timeout_s=PATIENCE_S) as client:
        points = np.zeros((1001, 3), np.float32)
        with pytest.raises(clearance.QueryError, match=r"1001 points of one body .*limit max-body-points"):
            client.set_points("cloud", points)
        client.set_points("cloud", points[:1000])
        client.set_points("voxels", points[:1000])
        with pytest.raises(clearance.QueryError, match=r"3000 points of this client.*limit max-client-points"):
            client.set_points("cloud", points[:1000])
        client.set_points("cloud", [])
        client.set_points("cloud", points[:900])
        assert client.stats()["engine.points"] == 1900


def test_stamps_and_age_are_those_of_poses(scene_file, start_daemon):
    daemon = start_daemon(scene_file, ["ipc"])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        client.set_points("cloud", [[0, 0, 0]], stamp_ns=2000, sequence=4)
        with pytest.raises(clearance.QueryError, match="is older than 2000"):
            client.set_points("cloud", [[1, 0, 0]], stamp_ns=1000, sequence=5)
        answer = client.distances(pairs=[("cloud", "ball")])
        assert answer.snapshot_stamp_ns == 2000 and answer.snapshot_sequence == 4
        assert answer.pose_age_ns is not None and answer.pose_age_ns >= 0
        expect(gap(client), 9.5 - 0.01)


def test_a_reload_keeps_them(scene_file, start_daemon):
    daemon = start_daemon(scene_file, ["ipc"])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        client.set_points("cloud", [[2, 0, 0]])
        client.reload()
        expect(gap(client), 7.5 - 0.01)


@pytest.mark.parametrize(
    "line, text",
    [
        ("{name: c, points: none.ply}", 'none.ply": No such file'),
        ("{name: c, points: points.txt}", "expected .ply, .xyz, .npy or .pcd"),
        ("{name: c, points: points.xyz, voxel: -1}", "voxel"),
        ("{name: c, points: points.xyz, scale: 2}", "only a mesh has this key"),
        ("{name: c, points: [[0, 0, 0]], voxel: 1}", "only points of a file"),
        ("{name: c, points: bad.xyz}", "bad.xyz: line 1: expected a coordinate"),
        ("{name: c, points: short.npy}", "short.npy: it ends before its 9 x 3 numbers do"),
        ("{name: c, points: packed.pcd}", "binary_compressed is not read"),
        ("{name: c, points: empty.xyz}", "it holds no points"),
        ("{name: c, height_field: flat.npy, cell: 0}", "cell"),
        ("{name: c, height_field: flat.npy}", 'needs the key "cell"'),
        ("{name: c, height_field: points.xyz, cell: 1}", 'unknown format ".xyz"; expected .npy'),
        ("{name: c, points: narrow.npy}", "narrow.npy: it has 2 columns; expected rows of x, y and z, which up to 13"),
        (
            "{name: c, points: heights.npy}",
            "it has 17 columns; expected rows of x, y and z, which up to 13 more columns "
            "may follow; a grid of heights is a height_field",
        ),
        ("{name: c, points: line.npy}", "its shape is (9,); expected rows of x, y and z"),
        ("{name: c, points: picture.npy}", "its shape is (3, 4, 3); expected rows of x, y and z"),
        ("{name: c, height_field: line.npy, cell: 1}", "its shape is (9,); expected rows and columns of heights"),
        ("{name: c, points: named.npy}", "its numbers have names (a structured array)"),
        ("{name: c, points: whole.npy}", "expected '<f4' or '<f8' numbers, got '<i8'"),
        ("{name: c, points: big.npy}", "expected '<f4' or '<f8' numbers, got '>f4'"),
        ("{name: c, points: two.npy}", "two.npy: 344 bytes follow its numbers: does it hold several arrays?"),
        ("{name: c, points: hole.npy}", "hole.npy: row 1 is not finite"),
        ("{name: c, mesh: rows.npy}", 'unknown format ".npy"; expected .obj'),
        ("{name: c, height_field: flat.npy, cell: 1, voxel: 1}", "only points of a file"),
    ],
)
def test_bad_files_are_refused_by_their_names(tmp_path, line, text):
    (tmp_path / "points.xyz").write_text("0 0 0\n")
    (tmp_path / "points.txt").write_text("0 0 0\n")
    (tmp_path / "bad.xyz").write_text("0 zero 0\n")
    (tmp_path / "empty.xyz").write_text("# none\n")
    np.save(tmp_path / "rows.npy", np.ones((9, 3)) / 3)
    np.save(tmp_path / "flat.npy", np.full((4, 4), np.nan))
    np.save(tmp_path / "narrow.npy", np.ones((9, 2)))
    np.save(tmp_path / "heights.npy", np.ones((9, 17)))
    np.save(tmp_path / "line.npy", np.ones(9))
    np.save(tmp_path / "picture.npy", np.ones((3, 4, 3)))
    np.save(tmp_path / "named.npy", np.zeros(4, [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
    np.save(tmp_path / "whole.npy", np.ones((9, 3), np.int64))
    np.save(tmp_path / "big.npy", np.ones((9, 3), ">f4"))
    np.save(tmp_path / "hole.npy", np.array([[0, 0, 0], [0, np.nan, 0]]))
    whole = (tmp_path / "rows.npy").read_bytes()
    (tmp_path / "two.npy").write_bytes(whole + whole)
    (tmp_path / "short.npy").write_bytes(whole[:-1])
    (tmp_path / "packed.pcd").write_text("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\nxxxx")
    (tmp_path / "scene.yaml").write_text(f"bodies:\n  - {line}\n")
    with pytest.raises(clearance.SceneError) as error:
        clearance.Scene.load(tmp_path / "scene.yaml")
    assert text in str(error.value) and "scene.yaml:2" in str(error.value)


def test_files_of_every_format_hold_the_same_points(tmp_path):
    points = np.array([[0, 0, 0], [1, 2, 3], [-1.5, 0.25, 8]], np.float32)
    text = "\n".join(" ".join(map(str, row)) for row in points.tolist()) + "\n"
    (tmp_path / "a.xyz").write_text(text)
    np.save(tmp_path / "b.npy", points)
    np.save(tmp_path / "c.npy", points.astype(np.float64))
    np.save(tmp_path / "g.npy", np.column_stack([points, [7, 8, 9]]))  # x y z intensity
    np.save(tmp_path / "h.npy", np.asfortranarray(np.column_stack([points, np.full((3, 13), -99)])))
    head = "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\n"
    rows = np.zeros(4, [("p", "<f4", 3), ("rgb", "<u4")])
    rows["p"][:3], rows["p"][3] = points, np.nan  # a pixel without a return
    (tmp_path / "d.pcd").write_bytes((head + "DATA binary\n").encode() + rows.tobytes())
    lines = [" ".join(map(str, row)) + " 7" for row in [*points.tolist(), ["-nan", "1", "-NAN(ind)"]]]
    (tmp_path / "e.pcd").write_text(head + "DATA ascii\n" + "\n".join(lines) + "\n")
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    (tmp_path / "f.ply").write_text(ply + text)
    files = sorted(p.name for p in tmp_path.iterdir())
    bodies = "".join(f"  - {{name: {name[0]}, points: {name}, pose: [0,0,0, 1,0,0,0]}}\n" for name in files)
    ball = "  - {name: ball, sphere: 0.5, pose: [3,3,3, 1,0,0,0]}\n"
    (tmp_path / "scene.yaml").write_text("bodies:\n" + bodies + ball)
    engine = clearance.Engine(clearance.Scene.load(tmp_path / "scene.yaml"), backend="cpu", covers="off")
    answer = engine.distances(pairs=[(name[0], "ball") for name in files])
    assert len(set(answer.upper[0])) == 1 and len(files) == 8
    assert answer.lower[0, 0] <= np.sqrt(5.0) - 0.5 <= answer.upper[0, 0]


def test_heights_may_be_three_columns_wide(tmp_path):
    np.save(tmp_path / "heights.npy", np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0.5]], np.float32))
    (tmp_path / "scene.yaml").write_text(
        "bodies:\n  - {name: ground, height_field: heights.npy, cell: 2, pose: [0,0,0, 1,0,0,0]}\n"
        "  - {name: ball, sphere: 0.5, pose: [4,4,2, 1,0,0,0]}\n"
    )
    answer = clearance.Engine(clearance.Scene.load(tmp_path / "scene.yaml"), backend="cpu", covers="off").distances()
    assert answer.lower[0, 0] <= 1.0 <= answer.upper[0, 0] <= answer.lower[0, 0] + 1e-5


def test_a_saved_scene_has_the_same_points(tmp_path, scene_file):
    scene = clearance.Scene.load(scene_file)
    scene.add_points(
        "cut", np.random.default_rng(1).normal(size=(500, 3)), radius=0.1, padding=0.01, pose=[0] * 3 + [1] + [0] * 3
    )
    scene.save(tmp_path / "saved")
    again = clearance.Engine(clearance.Scene.load(tmp_path / "saved/scene.yaml"), backend="cpu", covers="off")
    first = clearance.Engine(scene, backend="cpu", covers="off")
    for engine in (first, again):
        engine.set_points("live", [[1, 1, 1]])
        engine.set_poses({"live": [0, 0, 1, 1, 0, 0, 0]})
    a, b = first.distances(), again.distances()
    assert np.array_equal(a.lower, b.lower) and np.array_equal(a.upper, b.upper)
    for engine in (first, again):
        engine.set_points("cut", [[1, 1, 1]])
    assert gap(first, body="cut") == pytest.approx(gap(again, body="cut"), abs=1e-12)


def test_a_million_points_fit(scene_file):
    engine = clearance.Engine(clearance.Scene.load(scene_file), backend="cpu", covers="off")
    points = np.random.default_rng(3).normal(size=(1_000_000, 3)).astype(np.float32)
    assert engine.set_points("cloud", points, 0.0).applied == 1_000_000
    low, high = gap(engine)
    assert low - 1e-12 <= float(exact(points, 0)) <= high + 1e-12


def test_messages_of_lcm_make_a_cloud(scene_file, start_daemon, kinds):
    if kinds["udpm"]:
        pytest.skip(kinds["udpm"])
    lcm = pytest.importorskip("lcm")
    from clearance_lcm import points_t

    daemon = start_daemon(scene_file, ["udpm", "ipc"])
    bus = lcm.LCM(daemon.urls["udpm"])
    points = np.random.default_rng(2).normal(size=(10_000, 3)).astype(np.float32)

    def send(parts, sequence, body="cloud"):
        for part in parts:
            message = points_t()
            message.publisher_id, message.sequence, message.stamp_ns = 99, sequence, 5000 + sequence
            message.body, message.radius, message.total, message.part, message.parts = body, 0.02, 10_000, part, 3
            message.xyz = points[4000 * part : 4000 * (part + 1)].tolist()
            message.count = len(message.xyz)
            bus.publish("CLEARANCE_POINTS", message.encode())

    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        send([0, 2], 1)  # never complete
        deadline = time.monotonic() + PATIENCE_S
        while not client.stats().get("points.updates", 0):
            assert time.monotonic() < deadline
            send([2, 0, 1], 2)  # UDP may lose some: repeated, as a publisher does
            time.sleep(0.05)
        low, high = gap(client)
        assert low - 1e-12 <= float(exact(points, 0.02)) <= high + 1e-12
        answer = client.distances(pairs=[("cloud", "ball")])
        assert answer.snapshot_stamp_ns == 5002 and answer.snapshot_sequence == 2
        stats = client.stats()
        assert stats["lcm.clouds"] == 1 and stats["points.applied"] == 10_000


def test_a_depth_camera_leaves_the_robot_out(root):
    spec = importlib.util.spec_from_file_location("depth_camera", root / "client/examples/depth_camera.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    world = example.World(root / "scenes/cell/robot.yaml")
    camera = example.Camera([1.6, -1.2, 1.7], [0.3, 0, 1.2], 12, 9, view=0.4)
    radius = 0.002
    on_arm, beside = world.depths(camera, ["arm"]), world.depths(camera, world.others)
    is_arm, is_other = np.isfinite(on_arm) & (on_arm < beside), np.isfinite(beside) & (beside < on_arm)
    assert is_arm.sum() > 3 and is_other.sum() > 3
    met = camera.position + np.minimum(on_arm, beside)[:, None].clip(0, example.FAR) * camera.rays
    kept = example.self_filtered(world, met, radius)
    assert not kept[is_arm].any()
    lower = world.distance(met[is_other], ["arm"])
    assert kept[is_other].sum() == (lower > radius).sum() > 0  # nothing else is left out
    world.scene.add_points("seen", met[is_other & kept], radius=radius, pose=[0, 0, 0, 1, 0, 0, 0])
    engine = clearance.Engine(world.scene, backend="cpu", covers="off")
    engine.set_joints(example.HOME)
    answer = engine.distances(pairs=[("arm", "seen")], reduce="min")
    assert answer.lower[0] > 0 and answer.status[0] == clearance.Status.OK
