"""Building a scene."""

import importlib.util
import warnings

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S
from scenes import ARM_PAIRS, IDENTITY, arm, at, box_vertices, same_bits


def test_bodies_groups_and_pairs():
    scene = arm()
    assert [body.name for body in scene.bodies] == ["base", "link1", "link2", "cup", "table"]
    assert [body.id for body in scene.bodies] == [0, 1, 2, 3, 4]
    assert [body.is_static for body in scene.bodies] == [True, False, False, False, True]
    assert [body.parent for body in scene.bodies] == [None, None, None, 2, None]
    assert scene.bodies[1].vertex_count == 8 and scene.bodies[3].vertex_count == 1
    assert scene.bodies[0].extent >= np.sqrt(0.2**2 + 0.2**2 + 0.1**2)
    assert scene.groups["arm"].tolist() == [1, 2, 3]
    assert scene.ignored.tolist() == [[0, 1]]
    assert len(scene) == 5 and "5 bodies, 1 groups" in repr(scene)
    assert clearance.Engine(scene).pairs.tolist() == ARM_PAIRS


def test_pieces_initial_poses_and_revision():
    scene = arm()
    ((vertices, radius),) = scene.pieces("link1")
    assert radius == 0 and sorted(map(tuple, vertices)) == sorted(map(tuple, box_vertices(0.1, 0.1, 0.5)))
    ((vertices, radius),) = scene.pieces("link2")
    assert radius == 0.05 and sorted(vertices[:, 2]) == [-0.2, 0.2]
    assert scene.initial_pose("base").tolist() == IDENTITY
    assert scene.initial_pose("cup").tolist() == at(0, 0, 0.3)
    assert scene.initial_pose(1) is None
    assert scene.source("base") == "box"
    assert scene.revision == arm().revision != clearance.Scene().revision
    other = arm()
    other.add_sphere("ball", 0.1)
    assert other.revision != scene.revision


#: A box of edge 2 about the origin, hollow above: closed, and not convex.
CUP_VERTICES = [
    [r * x, r * y, z if r == 1 or z > 0 else -0.5]
    for r in (1.0, 0.5)
    for z in (-1.0, 1.0)
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
]
CUP_QUADS = [(3, 2, 1, 0), (8, 9, 10, 11)]
for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
    CUP_QUADS += [(i, j, 4 + j, 4 + i), (8 + j, 8 + i, 12 + i, 12 + j), (4 + i, 4 + j, 12 + j, 12 + i)]
CUP_TRIANGLES = [t for a, b, c, d in CUP_QUADS for t in ((a, b, c), (a, c, d))]


def write_obj(path, vertices, triangles):
    faces = "".join("f " + " ".join(str(v + 1) for v in t) + "\n" for t in triangles)
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in vertices) + faces)


def test_a_mesh_is_the_truth_where_nothing_is_said(tmp_path):
    write_obj(tmp_path / "cup.obj", CUP_VERTICES, CUP_TRIANGLES)
    write_obj(tmp_path / "open.obj", CUP_VERTICES, CUP_TRIANGLES[1:])
    (tmp_path / "scene.yaml").write_text("bodies:\n  - {name: file, mesh: cup.obj}\n")
    (tmp_path / "cup.urdf").write_text(
        "<robot name='r'><link name='l'><collision><geometry><mesh filename='cup.obj'/></geometry></collision></link>"
        "</robot>"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = clearance.Scene.load(tmp_path / "scene.yaml")
        scene.add_mesh("path", tmp_path / "cup.obj")
        scene.add_body("own", mesh=(CUP_VERTICES, CUP_TRIANGLES))
        scene.add_mesh("said", tmp_path / "cup.obj", convexify="solid")
        robot = clearance.Scene.load_urdf(tmp_path / "cup.urdf")
    assert all(body.is_solid and body.triangle_count == 28 for body in scene.bodies)
    assert [body.is_solid for body in robot.bodies if body.triangle_count] == [True]
    assert scene.source(1) == f"{tmp_path / 'cup.obj'} (solid)"
    with pytest.warns(
        clearance.MeshWarning,
        match=r"open: its hull stands up to .*: distances are to the hull; .*open\.obj \(hull\) encloses nothing: the "
        r"edge from \(.*\) to \(.*\) of triangle \d+ belongs to no other triangle: the mesh is open there; convexify: "
        "surface ",
    ):
        scene.add_mesh("open", tmp_path / "open.obj")
    with pytest.warns(clearance.MeshWarning, match="own open: .* mesh \\(hull\\) encloses nothing"):
        scene.add_body("own open", mesh=(CUP_VERTICES, CUP_TRIANGLES[1:]))
    assert [body.triangle_count for body in scene.bodies[-2:]] == [0, 0]


def test_a_hollow_mesh_is_no_solid_but_its_hull(tmp_path, start_daemon):
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    cube = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    crossing = np.concatenate([corners, corners + 0.5])
    bad = {
        "both sides": (crossing, np.concatenate([cube, cube[:, ::-1], cube + 8, cube[:, ::-1] + 8])),
        "one inside out": (crossing, np.concatenate([cube, cube[:, ::-1] + 8])),
    }
    scene = clearance.Scene()
    scene.add_body("solid", mesh=(crossing, np.concatenate([cube, cube + 8])), pose=IDENTITY)
    scene.add_sphere("ball", 0.01, pose=at(0.75, 0.75, 0.75))
    for name, mesh in bad.items():
        with pytest.raises(clearance.SceneError, match="solid: the mesh does not enclose all that its faces go around"):
            scene.add_body(name, mesh=mesh, convexify="solid")
        with pytest.warns(clearance.MeshWarning, match=r"mesh \(hull\) is hollow: triangle \d+ at \("):
            scene.add_body(name, mesh=mesh, pose=IDENTITY)
    assert [body.is_solid for body in scene.bodies] == [True, False, False, False]
    r = clearance.Engine(scene, backend="cpu").distances(pairs=[("ball", "*")])
    assert r.status[0].tolist() == 3 * [clearance.Status.OVERLAP]
    (tmp_path / "scene.yaml").write_text("bodies:\n  - {name: ball, sphere: 0.01, pose: [0.75,0.75,0.75, 1,0,0,0]}\n")
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        with pytest.raises(clearance.QueryError, match="does not enclose all that its faces go around"):
            client.add_body("solid", mesh=bad["both sides"], convexify="solid")
        client.add_body("hollow", mesh=bad["both sides"], pose=IDENTITY)
        assert client.distances(pairs=[("hollow", "ball")]).status[0, 0] == clearance.Status.OVERLAP
        assert 'event=mesh_suspicious body="hollow"' in daemon.log() and "is hollow: triangle" in daemon.log()


def test_what_overlaps_a_solid_has_a_depth_between_two_bounds():
    scene = clearance.Scene()
    scene.add_body("cup", mesh=(CUP_VERTICES, CUP_TRIANGLES), pose=[0, 0, 0, 1, 0, 0, 0])
    scene.add_sphere("inside", 0.25, pose=[0, 0, 0.25, 1, 0, 0, 0])
    scene.add_sphere("in the wall", 0.1, pose=[0.75, 0, 0, 1, 0, 0, 0])
    r = clearance.Engine(scene, backend="cpu").distances(pairs=[(0, 1), (0, 2)], signed=True)
    assert r.status[0, 0] == clearance.Status.OK and r.lower[0, 0] <= 0.25 <= r.upper[0, 0]
    assert r.status[0, 1] == clearance.Status.UNCONVERGED
    assert r.lower[0, 1] == pytest.approx(-0.35) and -0.35 <= r.upper[0, 1] <= -0.1


def test_a_mesh_is_what_is_said_of_it(tmp_path):
    write_obj(tmp_path / "cup.obj", CUP_VERTICES, CUP_TRIANGLES)
    scene = clearance.Scene()
    with pytest.warns(clearance.MeshWarning):
        scene.add_mesh("hull", tmp_path / "cup.obj", convexify="hull")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for how in ("surface", "solid"):
            scene.add_mesh(how, tmp_path / "cup.obj", convexify=how)
            scene.add_body("own " + how, mesh=(CUP_VERTICES, CUP_TRIANGLES), convexify=how, radius=0.125)
    assert [body.triangle_count for body in scene.bodies] == [0, 28, 28, 28, 28]
    assert [body.is_solid for body in scene.bodies] == [False, False, False, True, True]
    assert [body.hull_excess > 0 for body in scene.bodies] == [True, False, False, False, False]
    assert [scene.source(i).split()[-1] for i in range(5)] == ["(hull)", *2 * ["(surface)"], *2 * ["(solid)"]]
    assert scene.pieces("own solid")[0][1] == 0.125
    scene.save(tmp_path / "saved")
    again = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    assert again.revision == scene.revision and again.bodies == scene.bodies


@pytest.mark.parametrize("arguments, error, text", [
    ({"mesh": (CUP_VERTICES, CUP_TRIANGLES[1:]), "convexify": "solid"}, clearance.SceneError,
     r"body \"x\": convexify: solid: the mesh encloses no volume: the edge from \(.*\) to \(.*\) of triangle \d+ "
     r"belongs to no other triangle: the mesh is open there"),
    ({"mesh": (CUP_VERTICES, [[0, 1, 16]])}, clearance.SceneError,
     "triangle 0 names the vertex 16, and there are 16"),
    ({"mesh": (CUP_VERTICES, CUP_TRIANGLES), "convexify": "decompose"}, clearance.SceneError, "only of a mesh file"),
    ({"mesh": CUP_VERTICES}, ValueError, r"mesh: expected a pair \(vertices, triangles\), got 16 things"),
    ({"mesh": (CUP_VERTICES, [[0, 1]])}, ValueError, r"mesh\[1\]: expected shape \(T, 3\), got \(1, 2\)"),
    ({"mesh": (CUP_VERTICES, [[0.0, 1, 2]])}, TypeError, r"mesh\[1\]: expected \(T, 3\) integers, got an array of"),
    ({"mesh": (CUP_VERTICES, [[0, 1, -1]])}, ValueError, r"mesh\[1\]: expected places in the list of vertices, got -1"),
    ({"mesh": ([[0, 1]], [[0, 1, 2]])}, ValueError, r"mesh\[0\]: expected shape \(V, 3\), got \(1, 2\)"),
    ({"sphere": 1.0, "convexify": "solid"}, ValueError,
     "convexify: expected 'auto' or 'hull' where there is no mesh, got 'solid'"),
])  # fmt: skip
def test_what_is_wrong_with_a_mesh_is_said(arguments, error, text):
    scene = clearance.Scene()
    with pytest.raises(error, match=text):
        scene.add_body("x", **arguments)
    assert len(scene) == 0


def test_a_cylinder_is_exact_but_for_a_robots_which_publishes_its_model_error(root):
    scene = clearance.Scene()
    scene.add_cylinder("post", 0.1, 1.0, pose=[0, 0, 1, 1, 0, 0, 0])
    scene.add_body("grown", cylinder=(0.1, 1.0), radius=0.05, pose=[1, 0, 1, 1, 0, 0, 0])
    r = clearance.Engine(scene).distances(rel_tol=1e-12)
    assert r.lower[0, 0] <= 1 - 0.25 <= r.upper[0, 0] and r.upper[0, 0] - r.lower[0, 0] < 1e-12
    assert all(body.model_error == 0 for body in scene.bodies)
    arm = clearance.Scene.load_urdf(root / "scenes" / "cell" / "arm.urdf")
    assert 0 < max(body.model_error for body in arm.bodies) < 2e-4


def test_primitives_are_exact():
    scene = clearance.Scene()
    scene.add_half_space("floor", pose=[0, 0, -1, 1, 0, 0, 0])
    scene.add_cone("cone", 0.5, 2.0, pose=[0, 0, 1, 1, 0, 0, 0])
    scene.add_ellipsoid("egg", (1.0, 2.0, 0.5), pose=[0, 0, 4, 1, 0, 0, 0])
    scene.add_body("grown", ellipsoid=(1.0, 2.0, 0.5), radius=0.25, pose=[4, 0, 4, 1, 0, 0, 0])
    scene.add_body("blunt", cone=(0.5, 2.0), radius=0.25, pose=[4, 0, 1, 1, 0, 0, 0])
    floor, cone = scene.bodies[0], scene.bodies[1]
    assert floor.is_static and floor.extent == np.inf
    assert cone.extent == pytest.approx(np.hypot(0.5, 1.0)) and cone.model_error == 0
    engine = clearance.Engine(scene)
    exact = {("floor", "cone"): 1.0, ("floor", "egg"): 4.5, ("cone", "egg"): 1.5}
    exact.update({("floor", "grown"): 4.25, ("floor", "blunt"): 0.75, ("egg", "grown"): 4 - 2.25})
    for pair, distance in exact.items():
        r = engine.distances(pairs=pair, rel_tol=1e-9)
        assert r.lower[0, 0] <= distance <= r.upper[0, 0] and r.status[0, 0] == clearance.Status.OK, pair
    assert engine.distances(pairs=("cone", "egg"), rel_tol=1e-9).normal[0, 0] == pytest.approx([0, 0, 1])
    engine.set_poses({"egg": [0, 0, -0.75, 1, 0, 0, 0]})
    r = engine.distances(pairs=("floor", "egg"), signed=True)
    assert r.lower[0, 0] <= -0.25 <= r.upper[0, 0] and r.status[0, 0] == clearance.Status.OVERLAP
    with pytest.raises(clearance.SceneError, match="follows no body"):
        scene.add_half_space("wall", parent="cone")


def test_what_is_not_known_of_a_body_widens_its_intervals():
    scene = clearance.Scene()
    scene.add_box("wall", (1, 1, 1), pose=[0, 0, 0, 1, 0, 0, 0], static=True)
    doubts = {"uncertainty": {"position": 0.25, "angle": 0.01}, "padding": 0.125, "max_speed": 0.0}
    scene.add_box("box", (1, 1, 1), pose=[3, 0, 0, 1, 0, 0, 0], **doubts)
    info = scene.bodies[1]
    assert (info.uncertainty_position, info.uncertainty_angle, info.padding, info.max_speed) == (0.25, 0.01, 0.125, 0)
    r = clearance.Engine(scene).distances(fields=("default", "flags", "pair_lower"))
    turn = 2 * np.sin(0.005) * (np.sqrt(0.75) + 0.375)
    assert r.upper[0, 0] == pytest.approx(2 - 0.375) and r.lower[0, 0] == pytest.approx(2 - 0.375 - turn, abs=1e-5)
    assert r.flags[0, 0] & clearance.Flag.SLACK and r.pair_lower[0, 0].tolist() == [0, 1]
    assert r.status[0, 0] == clearance.Status.OK


def test_bad_doubts_are_named():
    scene = clearance.Scene()
    with pytest.raises(TypeError, match="uncertainty: expected a map"):
        scene.add_sphere("a", 1, uncertainty=0.1)
    with pytest.raises(ValueError, match="uncertainty: expected the keys position and angle, got 'turn'"):
        scene.add_sphere("a", 1, uncertainty={"turn": 0.1})
    with pytest.raises(clearance.SceneError, match="padding: expected a number of metres >= 0, got -1"):
        scene.add_sphere("a", 1, padding=-1)
    with pytest.raises(clearance.SceneError, match="max_speed: expected"):
        scene.add_sphere("a", 1, max_speed=-1)
    assert not scene.bodies


def write_shelf(path):
    """Five panels that do not touch: an open shelf, 1 m wide, 0.4 m deep, 2 m high."""
    panels = [
        ((0, 0.19, 0), (1, 0.02, 2)),
        ((-0.49, 0, 0), (0.02, 0.3, 2)),
        ((0.49, 0, 0), (0.02, 0.3, 2)),
        ((0, 0, -0.9), (0.9, 0.3, 0.02)),
        ((0, -0.05, 0.9), (0.9, 0.3, 0.02)),
    ]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    with open(path, "w") as f:
        for i, (centre, size) in enumerate(panels):
            for z in (-0.5, 0.5):
                for y in (-0.5, 0.5):
                    for x in (-0.5, 0.5):
                        f.write("v {} {} {}\n".format(*(c + k * s for c, k, s in zip(centre, (x, y, z), size))))
            for face in faces:
                f.write("f {} {} {} {}\n".format(*(8 * i + 1 + k for k in face)))


def test_a_concave_mesh_is_warned_about_once_for_each_load(tmp_path):
    write_shelf(tmp_path / "shelf.obj")
    (tmp_path / "scene.yaml").write_text(
        "bodies:\n  - {name: one, mesh: shelf.obj, convexify: hull}\n"
        "  - {name: two, mesh: shelf.obj, scale: 2, convexify: hull}\n"
    )
    with pytest.warns(
        clearance.MeshWarning, match=r"one: its hull stands up to .* m out of its mesh, .* % of it is empty.*; two: "
    ) as caught:
        scene = clearance.Scene.load(tmp_path / "scene.yaml")
    assert len(caught) == 1 and caught[0].filename == __file__
    one, two = scene.bodies
    assert 0.2 < one.hull_excess < 0.6 and two.hull_excess == pytest.approx(2 * one.hull_excess)
    assert 0.8 < one.empty_share < 0.95 and one.model_error == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", clearance.MeshWarning)
        clearance.Scene().add_mesh("quiet", tmp_path / "shelf.obj", convexify="hull")
        clearance.Scene().add_box("crate", [1, 1, 1])
    with pytest.warns(clearance.MeshWarning):
        scene.add_mesh("three", tmp_path / "shelf.obj", convexify="hull")


def test_a_robots_hulls_are_warned_about_once_in_the_callers_line(tmp_path):
    write_shelf(tmp_path / "shelf.obj")
    links = "".join(
        f"<link name='l{i}'><collision><geometry><mesh filename='shelf.obj'/></geometry></collision></link>"
        for i in range(7)
    )
    joints = "".join(
        f"<joint name='j{i}' type='fixed'><parent link='l0'/><child link='l{i}'/></joint>" for i in range(1, 7)
    )
    (tmp_path / "r.urdf").write_text(f"<robot name='r'>{links}{joints}</robot>")
    (tmp_path / "r.srdf").write_text("<robot name='r'><unknown/></robot>")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        clearance.Scene.load_urdf(tmp_path / "r.urdf", srdf=tmp_path / "r.srdf", convexify="hull")
    assert [one.category for one in caught] == [clearance.MeshWarning, clearance.RobotWarning]
    assert [one.filename for one in caught] == [__file__] * 2 and caught[0].lineno == caught[1].lineno
    text = str(caught[0].message)
    assert text.startswith("7 bodies: r/l0: its hull stands up to") and text.endswith("; and 2 more")
    with pytest.warns(clearance.MeshWarning) as own:
        clearance.Scene().add_body("own", mesh=(CUP_VERTICES, CUP_TRIANGLES[1:]))
    assert len(own) == 1 and own[0].filename == __file__


def test_quaternions_that_look_like_xyzw_are_warned_about(tmp_path):
    (tmp_path / "scene.yaml").write_text("bodies:\n  - {name: one, box: 1, pose: [0, 0, 0, 0, 0, 0, 1]}\n")
    (tmp_path / "r.urdf").write_text("<robot name='r'><link name='a'/></robot>")
    text = "the quaternion 0, 0, 0, 1 looks like one in the order x, y, z, w, which would be no turn"
    with pytest.warns(clearance.PoseWarning, match=rf"scene.yaml:2: bodies\[0\].pose: {text}") as caught:
        scene = clearance.Scene.load(tmp_path / "scene.yaml")
    assert len(caught) == 1 and caught[0].filename == __file__
    adds = (
        lambda pose: scene.add_sphere("b", 1, pose=pose),
        lambda pose: scene.add_body("c", box=(1, 1, 1), pose=pose),
        lambda pose: scene.add_robot("r", tmp_path / "r.urdf", base=pose),
    )
    for add, what in zip(adds, ("pose", "pose", "base")):
        with pytest.warns(clearance.PoseWarning, match=f"^{what}: {text}") as caught:
            add([0, 0, 0, 0, 0, 0, 1])
        assert len(caught) == 1 and caught[0].filename == __file__
    half_turn = np.diag([-1.0, -1, 1, 1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.add_sphere("matrix", 1, pose=half_turn)
        scene.add_sphere("negated", 1, pose=[0, 0, 0, 0, 0, 0, -1])
        scene.add_sphere("about y", 1, pose=[0, 0, 0, 0, 0, 1, 0])
        clearance.Engine(scene).set_poses({"matrix": [0, 0, 0, 0, 0, 0, 1]})
    with pytest.warns(clearance.PoseWarning, match="which would be a turn about z"):
        scene.add_sphere("yaw", 1, pose=[0, 0, 0, 0, 0, 0.6, 0.8])


def test_a_urdf_is_a_scene_of_one_robot(tmp_path):
    (tmp_path / "file.urdf").write_text("<robot name='panda'><link name='a'/></robot>")
    assert [body.name for body in clearance.Scene.load(tmp_path / "file.urdf").bodies] == ["panda", "panda/a"]


def test_matrix_as_pose_and_options_by_keyword():
    scene = clearance.Scene()
    matrix = np.eye(4)
    matrix[:3, 3] = 1, 2, 3
    assert scene.add_box("a", (1, 1, 1), pose=matrix, radius=0.1) == 0
    assert scene.add_sphere("b", 0.5, parent="a") == 1
    assert scene.add_sphere("c", 0.5, parent=1, static=False) == 2
    assert scene.initial_pose("a").tolist() == [1, 2, 3, 1, 0, 0, 0]
    assert [body.parent for body in scene.bodies] == [None, 0, 1]


@pytest.mark.parametrize("call, error, text", [
    (lambda s: s.add_hull("x", [[0, 0]]), ValueError, r"vertices: expected shape \(V, 3\), got \(1, 2\)"),
    (lambda s: s.add_hull("x", "abc"), TypeError, r"vertices: expected \(V, 3\) numbers"),
    (lambda s: s.add_hull("x", np.zeros((0, 3))), clearance.SceneError, r"x.*vert"),
    (lambda s: s.add_hull("x", [[0, 0, np.nan]]), clearance.SceneError, r"x.*(nan|finite)"),
    (lambda s: s.add_hull("x", [[0, 0, 0]], radius=-1), clearance.SceneError, r"radius.*-1"),
    (lambda s: s.add_hull("x", [[0, 0, 0]], radius="big"), TypeError, r"radius: expected a number, got 'big'"),
    (lambda s: s.add_hull(3, [[0, 0, 0]]), TypeError, r"name: expected a string, got 3"),
    (lambda s: s.add_hull("", [[0, 0, 0]]), clearance.SceneError, r"name"),
    (lambda s: s.add_hull("base", [[0, 0, 0]]), clearance.SceneError, r"base"),
    (lambda s: s.add_hull("n" * 64, [[0, 0, 0]]), clearance.SceneError, r"63"),
    (lambda s: s.add_box("x", 1), TypeError, r"size: expected three numbers, got 1"),
    (lambda s: s.add_box("x", [1, 1]), ValueError, r"size: expected three numbers, got \[1, 1\]"),
    (lambda s: s.add_box("x", [1, 1, -1]), clearance.SceneError, r"x"),
    (lambda s: s.add_box("x", [1, 1, 1], pose=[0, 0, 0]), ValueError, r"pose: expected poses of 7 numbers"),
    (lambda s: s.add_box("x", [1, 1, 1], pose=np.zeros((2, 7))), ValueError,
     r"pose: expected one pose, got shape \(2, 7\)"),
    (lambda s: s.add_box("x", [1, 1, 1], pose=2 * np.eye(4)), ValueError, r"pose: not a rigid transform"),
    (lambda s: s.add_box("x", [1, 1, 1], parent="bse"), ValueError,
     r"parent: no body is named 'bse'; did you mean 'base'\?"),
    (lambda s: s.add_box("x", [1, 1, 1], parent=9), ValueError, r"parent: no body has the id 9; the scene has 5"),
    (lambda s: s.add_sphere("x", 0), clearance.SceneError, r"x"),
    (lambda s: s.add_mesh("x", "a.obj", convexify="hul"), ValueError,
     r"convexify: expected 'hull' or 'submeshes' or 'decompose' or 'surface' or 'solid' or 'auto', got 'hul'"),
    (lambda s: s.add_mesh("x", "a.obj", scale=[1, 2]), ValueError,
     r"scale: expected one number or three, got \[1, 2\]"),
    (lambda s: s.add_mesh("x", "/dev/null/a.obj"), clearance.SceneError, r"/dev/null/a.obj"),
    (lambda s: s.add_group("g", "base"), TypeError, r"bodies: expected a list of names, got 'base'"),
    (lambda s: s.add_group("g", ["bas"]), ValueError, r"bodies\[0\]: no body is named 'bas'; did you mean 'base'\?"),
    (lambda s: s.ignore("base", "lnk1"), ValueError, r"b: no body or group is named 'lnk1'; did you mean 'link1'"),
    (lambda s: s.ignore("base", 12), ValueError, r"b: no body has the id 12"),
    (lambda s: s.pieces("lnk1"), ValueError, r"body: no body is named 'lnk1'; did you mean 'link1'"),
    (lambda s: s.pieces(17), ValueError, r"body: no body has the id 17; the scene has 5"),
    (lambda s: clearance.Scene.load("/dev/null/scene.yaml"), clearance.SceneError, r"/dev/null/scene.yaml"),
])  # fmt: skip
def test_bad_input_is_named(call, error, text):
    scene = arm()
    with pytest.raises(error, match=text):
        call(scene)
    assert len(scene) == 5 and scene.revision == arm().revision, "nothing was added"


def test_scene_file(tmp_path):
    (tmp_path / "tet.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (tmp_path / "scene.yaml").write_text(
        "bodies:\n"
        "  - {name: tet, mesh: tet.obj, scale: 2.0}\n"
        "  - {name: ball, sphere: 0.5, pose: [5, 0, 0, 1, 0, 0, 0], static: true}\n"
    )
    scene = clearance.Scene.load(tmp_path / "scene.yaml")
    ((vertices, radius),) = scene.pieces("tet")
    assert radius == 0 and sorted(map(tuple, vertices)) == [(0, 0, 0), (0, 0, 2), (0, 2, 0), (2, 0, 0)]
    shown = scene.display_mesh("tet")
    assert shown is not None
    vertices, triangles = shown
    assert triangles.shape == (4, 3) and len(vertices) > triangles.max()
    engine = clearance.Engine(scene)
    engine.set_poses({"tet": IDENTITY})
    assert engine.distances().upper[0, 0] == pytest.approx(2.5, rel=1e-9)

    by_hand = clearance.Scene()
    by_hand.add_mesh("tet", tmp_path / "tet.obj", scale=[2, 2, 2])
    assert np.array_equal(by_hand.pieces("tet")[0][0], scene.pieces("tet")[0][0])


def test_scene_file_error_names_file_line_and_key(tmp_path):
    (tmp_path / "scene.yaml").write_text("bodies:\n  - {name: ball, sphere: -1}\n")
    with pytest.raises(clearance.SceneError, match=r"scene.yaml:2.*sphere.*-1"):
        clearance.Scene.load(str(tmp_path / "scene.yaml"))


def test_a_saved_scene_is_the_same_scene(tmp_path, root):
    scene = clearance.Scene.load(root / "scenes" / "cell" / "robot.yaml")
    scene.add_capsule("vague", 0.05, 0.2, pose=at(1, 1, 1), uncertainty={"angle": 0.01}, padding=0.02)
    scene.save(tmp_path / "saved")
    saved = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    assert saved.revision == scene.revision and saved.bodies == scene.bodies
    one, other = clearance.Engine(scene, threads=1), clearance.Engine(saved, threads=1)
    arm = one.joints("arm")
    rows = np.random.default_rng(5).uniform(arm.lower, arm.upper, (20, len(arm)))
    query = {"joints": arm, "positions": rows, "fields": ("default", "points", "normal", "flags")}
    assert np.array_equal(one.pairs, other.pairs) and same_bits(one.distances(**query), other.distances(**query))
    with pytest.raises(clearance.SceneError, match="saved: expected a folder that is empty or not there yet"):
        scene.save(tmp_path / "saved")


def test_the_cells_robot_stands_where_its_arm_does(root):
    """arm.urdf and arm.py say the same of the same arm."""
    spec = importlib.util.spec_from_file_location("arm", root / "scenes" / "cell" / "arm.py")
    arm = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(arm)
    engine = clearance.Engine(clearance.Scene.load(root / "scenes" / "cell" / "robot.yaml"))
    rng = np.random.default_rng(7)
    for degrees in [arm.HOME, *rng.uniform(-90, 90, (5, 6))]:
        engine.set_joints(np.radians(degrees), joints=[f"arm/{name}" for name in arm_joints(arm)])
        states = engine.body_states()
        for link, pose in arm.link_poses(degrees).items():
            found = states[engine.body_id(f"arm/{link}")].pose
            assert np.allclose(found[:3], pose[:3], atol=1e-12) and abs(found[3:] @ pose[3:]) > 1 - 1e-12, link


def arm_joints(arm):
    """Names of the URDF's joints in the order of arm.py's links."""
    names = {"shoulder": "turn", "upper_arm": "lift", "forearm": "elbow", "wrist_1": "wrist_lift"}
    names.update(wrist_2="wrist_turn", flange="tool")
    return [names[link] for link, _, _ in arm.JOINTS]


def test_links_may_be_less_well_known_than_their_joints_say(root):
    def gap(**doubts):
        scene = clearance.Scene()
        scene.add_box("table", [1, 1, 0.1], static=True, pose=at(0.5, 0, -0.1))
        scene.add_robot("arm", root / "tests" / "engine" / "robot" / "arm.urdf", home={"joint4": -1.5}, **doubts)
        r = clearance.Engine(scene, threads=1).distances(pairs=[("arm/fore", "table"), ("arm/wrist", "table")])
        info = {body.name: body for body in scene.bodies}["arm/fore"]
        return r.lower[0], r.upper[0], info

    lower, upper, _ = gap()
    place, _, info = gap(uncertainty={"fore": {"position": 0.03}})
    assert info.uncertainty_position == 0.03
    assert abs(place[0] - (lower[0] - 0.03)) < 1e-6 and place[1] == lower[1], "of that link alone"
    turned, turned_upper, _ = gap(uncertainty={"fore": {"angle": 0.02}})
    assert turned[0] < lower[0] - 0.002 and turned_upper[0] >= upper[0] - 1e-6
    grown, _, info = gap(padding={"fore": 0.05})
    assert info.padding == 0.05 and abs(grown[0] - (lower[0] - 0.05)) < 1e-6 and grown[1] == lower[1]
    with pytest.raises(clearance.SceneError, match='uncertainty: there is no link "elbows"'):
        gap(uncertainty={"elbows": {"angle": 0.1}})


def test_a_mesh_whose_y_points_up_is_turned_exactly(tmp_path):
    corners = [[1.0, 2.0, 3.0], [4.0, 2.0, 3.0], [1.0, 7.0, 3.0], [1.0, 2.0, 14.0]]
    write_obj(tmp_path / "wedge.obj", corners, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    scene = clearance.Scene()
    scene.add_mesh("wedge", tmp_path / "wedge.obj", up="y")
    turned = {(x, -z, y) for x, y, z in corners}
    assert {tuple(v) for v in scene.pieces("wedge")[0][0]} == turned
    scene.save(tmp_path / "saved")
    again = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    assert again.revision == scene.revision
    assert {tuple(v) for v in again.pieces("wedge")[0][0]} == turned
    with pytest.raises(ValueError, match="up: expected 'z' or 'y', got 'x'"):
        scene.add_mesh("no", tmp_path / "wedge.obj", up="x")


def test_a_mesh_in_millimetres_is_warned_about(tmp_path):
    write_obj(
        tmp_path / "part.obj",
        [[0, 0, 0], [137, 0, 0], [0, 40, 0], [0, 0, 12]],
        [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)],
    )
    scene = clearance.Scene()
    with pytest.warns(clearance.MeshWarning, match="part: its mesh is 137 m wide.* scale: 0.001"):
        scene.add_mesh("part", tmp_path / "part.obj")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.add_mesh("scaled", tmp_path / "part.obj", scale=0.001)
