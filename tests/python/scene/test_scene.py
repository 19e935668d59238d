"""Building a scene."""

import importlib.util
import warnings

import numpy as np
import pytest

import clearance
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
    assert clearance.Engine(scene, covers="off").pairs.tolist() == ARM_PAIRS


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


def test_a_cylinder_is_exact_but_for_a_robots_which_publishes_its_model_error(root):
    scene = clearance.Scene()
    scene.add_cylinder("post", 0.1, 1.0, pose=[0, 0, 1, 1, 0, 0, 0])
    scene.add_body("grown", cylinder=(0.1, 1.0), radius=0.05, pose=[1, 0, 1, 1, 0, 0, 0])
    r = clearance.Engine(scene, covers="off").distances(rel_tol=1e-12)
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
    engine = clearance.Engine(scene, covers="off")
    exact = {("floor", "cone"): 1.0, ("floor", "egg"): 4.5, ("cone", "egg"): 1.5}
    exact.update({("floor", "grown"): 4.25, ("floor", "blunt"): 0.75, ("egg", "grown"): 4 - 2.25})
    for pair, distance in exact.items():
        r = engine.distances(pairs=pair, rel_tol=1e-9)
        assert r.lower[0, 0] <= distance <= r.upper[0, 0] and r.status[0, 0] == clearance.Status.OK, pair
    assert engine.distances(pairs=("cone", "egg"), rel_tol=1e-9).normal[0, 0] == pytest.approx([0, 0, 1])
    engine.set_poses({"egg": [0, 0, -0.75, 1, 0, 0, 0]})
    r = engine.distances(pairs=("floor", "egg"), signed_distance=True)
    assert r.lower[0, 0] <= -0.25 <= r.upper[0, 0] and r.status[0, 0] == clearance.Status.OVERLAP
    with pytest.raises(clearance.SceneError, match="cannot follow a body"):
        scene.add_half_space("wall", parent="cone")


def test_what_is_not_known_of_a_body_widens_its_intervals():
    scene = clearance.Scene()
    scene.add_box("wall", (1, 1, 1), pose=[0, 0, 0, 1, 0, 0, 0], static=True)
    uncertainties = {"uncertainty": {"position": 0.25, "angle": 0.01}, "padding": 0.125, "max_speed": 0.0}
    scene.add_box("box", (1, 1, 1), pose=[3, 0, 0, 1, 0, 0, 0], **uncertainties)
    info = scene.bodies[1]
    assert (info.uncertainty_position, info.uncertainty_angle, info.padding, info.max_speed) == (0.25, 0.01, 0.125, 0)
    r = clearance.Engine(scene, covers="off").distances(fields=("default", "flags", "pair_lower"))
    turn = 2 * np.sin(0.005) * (np.sqrt(0.75) + 0.375)
    assert r.upper[0, 0] == pytest.approx(2 - 0.375) and r.lower[0, 0] == pytest.approx(2 - 0.375 - turn, abs=1e-5)
    assert r.flags[0, 0] & clearance.Flag.UNCERTAINTY_LIMITED and r.pair_lower[0, 0].tolist() == [0, 1]
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
        clearance.Engine(scene, covers="off").set_poses({"matrix": [0, 0, 0, 0, 0, 0, 1]})
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
    (lambda s: s.add_mesh("x", "a.obj", mesh_as="hul"), ValueError,
     r"mesh_as: expected 'hull' or 'parts' or 'auto' or 'surface' or 'solid', got 'hul'"),
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
    engine = clearance.Engine(scene, covers="off")
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
    one, other = clearance.Engine(scene, threads=1, covers="off"), clearance.Engine(saved, threads=1, covers="off")
    arm = one.joints("arm")
    rows = np.random.default_rng(5).uniform(arm.lower, arm.upper, (20, len(arm)))
    query = {"joints": arm, "configurations": rows, "fields": ("default", "points", "normal", "flags")}
    assert np.array_equal(one.pairs, other.pairs) and same_bits(one.distances(**query), other.distances(**query))
    with pytest.raises(clearance.SceneError, match="saved: expected a folder that is empty or not there yet"):
        scene.save(tmp_path / "saved")


def test_the_cells_robot_stands_where_its_arm_does(root):
    """arm.urdf and arm.py describe the same arm."""
    spec = importlib.util.spec_from_file_location("arm", root / "scenes" / "cell" / "arm.py")
    arm = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(arm)
    engine = clearance.Engine(clearance.Scene.load(root / "scenes" / "cell" / "robot.yaml"), covers="off")
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
    def gap(**uncertainties):
        scene = clearance.Scene()
        scene.add_box("table", [1, 1, 0.1], static=True, pose=at(0.5, 0, -0.1))
        scene.add_robot("arm", root / "tests" / "engine" / "robot" / "arm.urdf", home={"joint4": -1.5}, **uncertainties)
        r = clearance.Engine(scene, threads=1, covers="off").distances(
            pairs=[("arm/fore", "table"), ("arm/wrist", "table")]
        )
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
