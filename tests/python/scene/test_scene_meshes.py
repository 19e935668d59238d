"""Meshes in a scene: solids, surfaces and hulls, their frames and warnings."""

import warnings

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S
from scenes import IDENTITY, at

#: A box of edge 2 about the origin with a hollow from above: closed, and not convex.
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
        scene.add_mesh("said", tmp_path / "cup.obj", mesh_as="solid")
        robot = clearance.Scene.load_urdf(tmp_path / "cup.urdf")
    assert all(body.is_solid and body.triangle_count == 28 for body in scene.bodies)
    assert [body.is_solid for body in robot.bodies if body.triangle_count] == [True]
    assert scene.source(1) == f"{tmp_path / 'cup.obj'} (solid)"
    with pytest.warns(
        clearance.MeshWarning,
        match=r"open: its hull stands up to .*: distances are to the hull; .*open\.obj \(hull\) encloses nothing: the "
        r"edge from \(.*\) to \(.*\) of triangle \d+ belongs to no other triangle: the mesh is open there; mesh_as: "
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
            scene.add_body(name, mesh=mesh, mesh_as="solid")
        with pytest.warns(clearance.MeshWarning, match=r"mesh \(hull\) is hollow: triangle \d+ at \("):
            scene.add_body(name, mesh=mesh, pose=IDENTITY)
    assert [body.is_solid for body in scene.bodies] == [True, False, False, False]
    r = clearance.Engine(scene, backend="cpu", covers="off").distances(pairs=[("ball", "*")])
    assert r.status[0].tolist() == 3 * [clearance.Status.OVERLAP]
    (tmp_path / "scene.yaml").write_text("bodies:\n  - {name: ball, sphere: 0.01, pose: [0.75,0.75,0.75, 1,0,0,0]}\n")
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        with pytest.raises(clearance.QueryError, match="does not enclose all that its faces go around"):
            client.add_body("solid", mesh=bad["both sides"], mesh_as="solid")
        client.add_body("hollow", mesh=bad["both sides"], pose=IDENTITY)
        assert client.distances(pairs=[("hollow", "ball")]).status[0, 0] == clearance.Status.OVERLAP
        assert 'event=mesh_suspicious body="hollow"' in daemon.log() and "is hollow: triangle" in daemon.log()


def test_what_overlaps_a_solid_has_a_depth_between_two_bounds():
    scene = clearance.Scene()
    scene.add_body("cup", mesh=(CUP_VERTICES, CUP_TRIANGLES), pose=[0, 0, 0, 1, 0, 0, 0])
    scene.add_sphere("inside", 0.25, pose=[0, 0, 0.25, 1, 0, 0, 0])
    scene.add_sphere("in the wall", 0.1, pose=[0.75, 0, 0, 1, 0, 0, 0])
    r = clearance.Engine(scene, backend="cpu", covers="off").distances(pairs=[(0, 1), (0, 2)], signed_distance=True)
    assert r.status[0, 0] == clearance.Status.OK and r.lower[0, 0] <= 0.25 <= r.upper[0, 0]
    assert r.status[0, 1] == clearance.Status.UNCONVERGED
    assert r.lower[0, 1] == pytest.approx(-0.35) and -0.35 <= r.upper[0, 1] <= -0.1


def test_a_mesh_is_what_is_said_of_it(tmp_path):
    write_obj(tmp_path / "cup.obj", CUP_VERTICES, CUP_TRIANGLES)
    scene = clearance.Scene()
    with pytest.warns(clearance.MeshWarning):
        scene.add_mesh("hull", tmp_path / "cup.obj", mesh_as="hull")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for how in ("surface", "solid"):
            scene.add_mesh(how, tmp_path / "cup.obj", mesh_as=how)
            scene.add_body("own " + how, mesh=(CUP_VERTICES, CUP_TRIANGLES), mesh_as=how, radius=0.125)
    assert [body.triangle_count for body in scene.bodies] == [0, 28, 28, 28, 28]
    assert [body.is_solid for body in scene.bodies] == [False, False, False, True, True]
    assert [body.hull_excess > 0 for body in scene.bodies] == [True, False, False, False, False]
    assert [scene.source(i).split()[-1] for i in range(5)] == ["(hull)", *2 * ["(surface)"], *2 * ["(solid)"]]
    assert scene.pieces("own solid")[0][1] == 0.125
    scene.save(tmp_path / "saved")
    again = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    assert again.revision == scene.revision and again.bodies == scene.bodies


@pytest.mark.parametrize("arguments, error, text", [
    ({"mesh": (CUP_VERTICES, CUP_TRIANGLES[1:]), "mesh_as": "solid"}, clearance.SceneError,
     r"body \"x\": mesh_as: solid: the mesh encloses no volume: the edge from \(.*\) to \(.*\) of triangle \d+ "
     r"belongs to no other triangle: the mesh is open there"),
    ({"mesh": (CUP_VERTICES, [[0, 1, 16]])}, clearance.SceneError,
     "triangle 0 names the vertex 16, and there are 16"),
    ({"mesh": (CUP_VERTICES, CUP_TRIANGLES), "mesh_as": "decompose"}, ValueError,
     "mesh_as: expected 'hull' or 'parts' or 'auto' or 'surface' or 'solid', got 'decompose'"),
    ({"mesh": CUP_VERTICES}, ValueError, r"mesh: expected a pair \(vertices, triangles\), got 16 things"),
    ({"mesh": (CUP_VERTICES, [[0, 1]])}, ValueError, r"mesh\[1\]: expected shape \(T, 3\), got \(1, 2\)"),
    ({"mesh": (CUP_VERTICES, [[0.0, 1, 2]])}, TypeError, r"mesh\[1\]: expected \(T, 3\) integers, got an array of"),
    ({"mesh": (CUP_VERTICES, [[0, 1, -1]])}, ValueError, r"mesh\[1\]: expected indices of vertices, got -1"),
    ({"mesh": ([[0, 1]], [[0, 1, 2]])}, ValueError, r"mesh\[0\]: expected shape \(V, 3\), got \(1, 2\)"),
    ({"sphere": 1.0, "mesh_as": "solid"}, ValueError,
     "mesh_as: expected 'auto' or 'hull' where there is no mesh, got 'solid'"),
])  # fmt: skip
def test_what_is_wrong_with_a_mesh_is_said(arguments, error, text):
    scene = clearance.Scene()
    with pytest.raises(error, match=text):
        scene.add_body("x", **arguments)
    assert len(scene) == 0


def write_shelf(path):
    """Five separate panels: an open shelf, 1 m wide, 0.4 m deep, 2 m high."""
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
        "bodies:\n  - {name: one, mesh: shelf.obj, mesh_as: hull}\n"
        "  - {name: two, mesh: shelf.obj, scale: 2, mesh_as: hull}\n"
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
        clearance.Scene().add_mesh("quiet", tmp_path / "shelf.obj", mesh_as="hull")
        clearance.Scene().add_box("crate", [1, 1, 1])
    with pytest.warns(clearance.MeshWarning):
        scene.add_mesh("three", tmp_path / "shelf.obj", mesh_as="hull")


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
        clearance.Scene.load_urdf(tmp_path / "r.urdf", srdf=tmp_path / "r.srdf", mesh_as="hull")
    assert [one.category for one in caught] == [clearance.MeshWarning, clearance.RobotWarning]
    assert [one.filename for one in caught] == [__file__] * 2 and caught[0].lineno == caught[1].lineno
    text = str(caught[0].message)
    assert text.startswith("7 bodies: r/l0: its hull stands up to") and text.endswith("; and 2 more")
    with pytest.warns(clearance.MeshWarning) as own:
        clearance.Scene().add_body("own", mesh=(CUP_VERTICES, CUP_TRIANGLES[1:]))
    assert len(own) == 1 and own[0].filename == __file__


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
