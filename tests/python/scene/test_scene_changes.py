"""Scenes that change at run time, by an engine in process and by clients of a daemon alike."""

import shutil
import threading

import numpy as np
import pytest

import clearance
from clearance import Status
from clearance.wire import ErrorCode
from patience import PATIENCE_S
from scenes import at, same_bits

BODIES = """
bodies:
  - {{name: table, box: [1, 1, 0.1], static: true, pose: [0.5, 0, -0.1, 1, 0, 0, 0]}}
  - {{name: cup, {cup}, pose: [0.4, 0.3, 0.5, 1, 0, 0, 0], padding: 0.01, uncertainty: {{position: 0.02, angle: 0.1}}}}
  - {{name: gripper, box: [0.1, 0.1, 0.1], pose: [0, 0, 1, 1, 0, 0, 0]}}
  - {{name: finger, capsule: [0.01, 0.1], parent: gripper, pose: [0.05, 0, -0.1, 1, 0, 0, 0]}}
  - {{name: cloud, points: [], radius: 0.01, pose: [0, 2, 0, 1, 0, 0, 0]}}
{more}robots:
  - {{name: arm, urdf: arm.urdf, home: {{joint4: -1.5}}}}
groups: {{hand: [gripper, finger]}}
ignore:
  - [gripper, table]
"""
CUP = "sphere: 0.05"
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.2,
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def write_scene(folder, urdf, cup=CUP, more=""):
    folder.mkdir(exist_ok=True)
    shutil.copy(urdf, folder / "arm.urdf")
    (folder / "scene.yaml").write_text(BODIES.format(cup=cup, more=more))
    return folder / "scene.yaml"


@pytest.fixture
def scene(tmp_path, urdf):
    return write_scene(tmp_path / "cell", urdf)


@pytest.fixture(params=["engine", "shm", "ipc"])
def front(request, scene, start_daemon):
    """An engine, or a client with the right "admin", which clients over LCM lack."""
    if request.param == "engine":
        return clearance.Engine(clearance.Scene.load(scene), covers="off")
    return clearance.connect(start_daemon(scene, [request.param]).urls[request.param], timeout_s=PATIENCE_S)


def loaded(tmp_path, urdf, *arguments, **options):
    """An engine of a scene that was loaded with other content."""
    return clearance.Engine(
        clearance.Scene.load(write_scene(tmp_path / "other", urdf, *arguments, **options)), covers="off"
    )


def code_of(call, *arguments, **options):
    with pytest.raises(clearance.QueryError) as info:
        call(*arguments, **options)
    return info.value.code


def test_bodies_come_and_go(front):
    before = front.distances()
    count = len(front.bodies)
    mug = front.add_body("mug", box=[0.2, 0.2, 0.2], parent="gripper", pose=at(1))
    assert (mug.body, mug.body_count) == (count, count + 1) and mug.scene_revision != before.scene_revision
    assert front.bodies[-1].name == "mug" and front.bodies[-1].parent == front.body_id("gripper")
    front.add_body("tip", np.zeros((1, 3)), radius=0.5, pose=at(0, 0, 3))
    assert front.distances(pairs=("tip", "gripper")).distance[0, 0] == pytest.approx(2 - 0.05 - 0.5)
    two = [{shape: (0.1, 0.5)} for shape in ("capsule", "cylinder", "cone")]
    clouds = {"points": [[0, 0, 0]], "voxel": 0.1}, {"points": []}
    for shape in ({"sphere": 0.1}, *two, {"ellipsoid": (0.1, 0.2, 0.3)}, {"half_space": True}, {"mesh": TETRAHEDRON}):
        assert front.add_body("part", **shape).body == count + 2
        assert front.replace("part", sphere=0.2).body == count + 2
        front.remove_body("part")
    for cloud in clouds:
        front.add_body("part", **cloud)
        front.remove_body("part")
    assert front.remove_body("mug").body is None
    assert front.body_id("tip") == count
    assert front.remove_body("tip").body_count == count
    assert same_bits(front.distances(), before)


def test_the_answers_are_those_of_a_scene_loaded_whole(front, tmp_path, urdf):
    more = (
        "  - {name: ball, sphere: 0.1, pose: [1, 1, 1, 1, 0, 0, 0]}\n"
        "  - {name: lid, box: [0.1, 0.1, 0.02], parent: cup, pose: [0, 0, 0.1, 1, 0, 0, 0]}\n"
    )
    front.add_body("crate", box=[1, 1, 1], pose=at(5))
    front.add_body("ball", sphere=0.1, pose=at(1, 1, 1))
    front.add_body("lid", box=[0.1, 0.1, 0.02], parent="cup", pose=at(0, 0, 0.1))
    front.replace("cup", cylinder=(0.04, 0.1))
    front.replace("cup", box=[0.08, 0.08, 0.1])
    front.remove_body("crate")
    # Robots come behind the bodies of a file, so that ids differ: rows are compared by name.
    other = loaded(tmp_path, urdf, cup="box: [0.08, 0.08, 0.1]", more=more)
    rng = np.random.default_rng(3)
    poses = {"ball": rng.normal(size=7), "cup": rng.normal(size=7)}
    joints = front.joints("arm")
    positions = rng.uniform(joints.lower, joints.upper)
    for one in (front, other):
        one.set_poses(poses, stamp_ns=7)
        one.set_joints(positions, joints=one.joints("arm"))
        one.set_points("cloud", [[0, 0, 0.5]])
    names = [body.name for body in front.bodies]
    pairs = [(names[a], names[b]) for a, b in front.pairs]
    assert len(pairs) == len(other.pairs)
    is_, expected = (
        one.distances(pairs=pairs, signed_distance=False, fields=["lower", "upper", "status", "point_a", "normal"])
        for one in (front, other)
    )
    for column in ("lower", "upper", "status", "point_a", "normal"):
        a, b = getattr(is_, column), getattr(expected, column)
        assert a.tobytes() == b.tobytes(), column
    assert (is_.status == Status.OK).any()
    configurations = rng.normal(size=(3, 1, 7))
    groups = [("hand", "arm"), ("lid", "*")]
    least = [one.distances(groups, configurations, ["cup"], reduce="min").upper for one in (front, other)]
    assert np.array_equal(*least)


def test_the_state_of_the_others_stays(front):
    front.set_poses({"cup": at(3, 0, 0)}, stamp_ns=5)
    front.attach("cup", "gripper", at(0, 0, 0.2), allow=["finger"])
    front.allow("cloud", "table")
    front.set_points("cloud", [[0, 0, 1]], radius=0.25)
    front.set_joints({"arm/joint1": 0.3})
    joints = [(j.name, j.position, j.stamp_ns) for j in front.joint_states()]
    states = [(s.pose.tolist(), s.parent, s.status, s.stamp_ns) for s in front.body_states()]
    pairs, before = front.pairs.tolist(), front.distances(fields=["default", "points"])
    front.add_body("crate", box=[1, 1, 1], pose=at(9))
    assert [(s.pose.tolist(), s.parent, s.status, s.stamp_ns) for s in front.body_states()[:-1]] == states
    front.replace("crate", sphere=0.2)
    front.remove_body("crate")
    assert front.pairs.tolist() == pairs and same_bits(front.distances(fields=["default", "points"]), before)
    assert [(j.name, j.position, j.stamp_ns) for j in front.joint_states()] == joints
    front.replace("cup", box=[0.1, 0.1, 0.1])
    front.replace("finger", box=[0.02, 0.02, 0.1])
    assert front.pairs.tolist() == pairs, "allowed pairs and those of parents belong to bodies, not to shapes"
    assert [(s.pose.tolist(), s.parent, s.status, s.stamp_ns) for s in front.body_states()] == states
    front.replace("cloud", points=[[0.5, 0, 0]])
    lower = front.distances(pairs=("cloud", "gripper")).lower[0, 0]
    assert lower == pytest.approx(np.hypot(0.45, np.hypot(1.95, 0.95)), abs=1e-3), "the points of the new shape"
    with pytest.raises(clearance.QueryError, match="older than"):
        front.set_poses({"cup": at(0, 0, 0)}, stamp_ns=4)


def test_attachments_that_exchanged_their_leaders_stay(front):
    front.add_body("lid", sphere=0.1, parent="cup", pose=at(0, 0, 1))
    front.attach("lid", None)
    front.attach("cup", "lid")
    before = [s.pose.tolist() for s in front.body_states()]
    front.add_body("crate", box=[1, 1, 1], pose=at(9))
    assert front.bodies[front.body_id("cup")].parent == front.body_id("lid")
    assert front.bodies[front.body_id("lid")].parent is None
    assert [s.pose.tolist() for s in front.body_states()[:-1]] == before


def test_what_makes_no_sense_is_rejected_and_changes_nothing(front):
    front.add_body("crate", box=[1, 1, 1], pose=at(9))
    front.add_body("lid", sphere=0.1, parent="crate")
    revision = front.distances().scene_revision
    for call, text in [
        (lambda: front.add_body("cup", sphere=1.0), "is already that of a body"),
        (lambda: front.add_body("hand", sphere=1.0), "is already that of a group"),
        (lambda: front.add_body("", sphere=1.0), "name is empty"),
        (lambda: front.add_body("odd", box=[1, -1, 1]), "box edge: expected a number of metres > 0, got -1"),
        (lambda: front.add_body("odd", sphere=0.1, parent=99), "the parent, body 99, is not in the scene"),
        (lambda: front.add_body("odd", mesh=(TETRAHEDRON[0], [[0, 1, 9]])), "names the vertex 9, and there are 4"),
        (lambda: front.remove_body("cup"), '"cup" was loaded with the scene: only added bodies can be removed'),
        (lambda: front.remove_body("ghost"), '"ghost" is not in the scene'),
        (lambda: front.remove_body("crate "), '"crate " is not in the scene; did you mean "crate"\\?'),
        (lambda: front.replace("cup ", sphere=0.1), 'there is no body "cup "; did you mean "cup"\\?'),
        (lambda: front.remove_body("crate"), '"lid" follows "crate": detach it first'),
        (lambda: front.replace("ghost", sphere=0.1), 'there is no body "ghost"'),
        (lambda: front.replace("arm", sphere=0.1), 'body "arm": '),
        (lambda: front.replace("cup", half_space=True), "a half_space is static, and this body may move"),
        (lambda: front.replace("cup", sphere=-1), "sphere radius: expected"),
    ]:
        with pytest.raises(clearance.QueryError, match=text) as info:
            call()
        assert info.value.code == ErrorCode.BAD_QUERY
    link = next(body.name for body in front.bodies if body.name.startswith("arm/") and body.vertex_count)
    with pytest.raises(clearance.QueryError, match="a robot's link cannot be replaced"):
        front.replace(link, sphere=0.1)
    for call in (front.add_body, front.replace):
        with pytest.raises(ValueError, match="half_space, points, got none"):
            call("thing")
        with pytest.raises(ValueError, match=r"box: expected three numbers, got \[1, 2\]"):
            call("thing", box=[1, 2])
    with pytest.raises(ValueError, match="ghost"):
        front.add_body("odd", sphere=0.1, parent="ghost")
    assert front.distances().scene_revision == revision
    assert front.set_poses({"cup": at(1)}).applied == 1, "updates go on after a removal was rejected"
    front.attach("lid", None)
    front.remove_body("crate")
    front.remove_body("lid")


def test_ids_keep_their_meaning_or_are_rejected(front):
    count = len(front.bodies)
    front.add_body("crate", box=[1, 1, 1], pose=at(9))
    front.add_body("lid", sphere=0.1, pose=at(8))
    of_cup = front.prepare("distances", pairs=[("cup", "hand")])
    of_lid = front.prepare("distances", pairs=[("lid", "table")])
    front.replace("lid", sphere=0.2)
    assert of_lid.run().upper < 10, "another shape is no other body"
    front.remove_body("crate")
    assert front.body_id("lid") == count
    assert of_cup.run().lower.shape == front.distances(pairs=("cup", "hand")).lower.shape
    with pytest.raises(clearance.StaleQuery, match=r"id .* was 'lid'|is now none"):
        of_lid.run()  # its id is that of no body now
    assert front.distances(pairs=("lid", "table")).status[0, 0] == Status.OK
    with pytest.raises(ValueError, match="no body is named 'crate'"):
        front.set_poses({"crate": at(0)})
    before = front.distances(pairs=("cup", "*"))
    front.add_body("crate", box=[1, 1, 1], pose=at(9))
    with pytest.raises(clearance.QueryError, match="the scene has changed since this answer"):
        before.pairs


def test_static_bodies_have_no_pairs_among_them(front):
    count = len(front.pairs)
    front.add_body("wall", half_space=True)
    wall, table = front.body_id("wall"), front.body_id("table")
    assert [table, wall] not in front.pairs.tolist() and len(front.pairs) > count
    front.replace("table", half_space=True)
    assert [table, wall] not in front.pairs.tolist()
    front.replace("table", cylinder=(0.5, 0.1))
    front.remove_body("wall")
    assert len(front.pairs) == count


def test_a_running_query_ends_with_its_scene():
    scene = clearance.Scene()
    for i in range(60):
        scene.add_hull(f"body{i}", np.random.default_rng(i).normal(size=(200, 3)), pose=at(0.5 * i))
    engine = clearance.Engine(scene, covers="off")
    configurations = np.tile(at(1, 2, 3), (200, 60, 1)) + np.random.default_rng(1).normal(size=(200, 60, 7))
    query = {"configurations": configurations, "bodies": list(range(60)), "fields": "lower"}
    expected, revision = engine.distances(**query), engine.scene_revision
    running = engine.submit(**query)
    for i in range(5):
        engine.add_body(f"part{i}", sphere=1.0, pose=at(3))
    engine.replace("body0", sphere=5.0)
    done = running.result(PATIENCE_S)
    assert done.scene_revision == revision and done.lower.tobytes() == expected.lower.tobytes()
    assert engine.distances(**query).lower.shape[1] > expected.lower.shape[1]


def test_changes_during_queries_and_updates(scene):
    """Threads that update and query their own bodies while the scene changes: no update is lost, no id is confused."""
    engine = clearance.Engine(clearance.Scene.load(scene), threads=1)  # covers come and go during the queries
    engine.add_body("first", sphere=0.01, pose=at(0, 50))
    owners = ["cup", "own0", "own1"]
    for i, name in enumerate(owners[1:]):
        engine.add_body(name, sphere=0.1, pose=at(10 * i))
    ended, failures, counts = threading.Event(), [], [0] * len(owners)

    def guarded(work):
        def run():
            try:
                while not ended.is_set():
                    work()
            except Exception as error:
                failures.append(error)
                raise

        return threading.Thread(target=run)

    def update(i):
        counts[i] += 1
        x = 100.0 * (i + 1) + counts[i] % 50
        engine.set_poses({owners[i]: at(x)}, stamp_ns=counts[i])
        state = engine.body_states()[engine.body_id(owners[i])]
        assert (state.pose[0], state.stamp_ns) == (x, counts[i])

    def query():
        r = engine.distances(pairs=("own0", "own1"))
        assert 30 < r.lower[0, 0] < 200 or r.snapshot_stamp_ns == 0, "the distance of other bodies"
        assert engine.check(pairs=[("hand", "own1")]).free.all()
        engine.distances(reduce="min")

    for i in range(len(owners)):
        update(i)
    threads = [guarded(lambda i=i: update(i)) for i in range(len(owners))] + [guarded(query)]
    for thread in threads:
        thread.start()
    for k in range(150):
        name = f"part{k % 5}"
        if k % 10 < 5:
            engine.add_body(name, box=[0.1, 0.1, 0.1], parent="gripper" if k % 2 else None, pose=at(0, 0, 40))
        else:
            engine.remove_body(name)
        engine.replace("cup", sphere=0.05 + 0.001 * (k % 7))
        if failures:
            break
    ended.set()
    for thread in threads:
        thread.join()
    assert not failures and min(counts) > 3
    for i, name in enumerate(owners):
        state = engine.body_states()[engine.body_id(name)]
        assert state.stamp_ns == counts[i]


def test_names_of_other_threads_are_found(scene):
    engine = clearance.Engine(clearance.Scene.load(scene), covers="off")
    engine.bodies
    thread = threading.Thread(target=lambda: engine.add_body("mug", sphere=0.1, pose=at(4)))
    thread.start()
    thread.join()
    assert engine.distances(pairs=("mug", "cup")).status[0, 0] == Status.OK
    engine.attach("mug", "gripper")
    assert engine.bodies[engine.body_id("mug")].parent == engine.body_id("gripper")


def test_a_replaced_shape_survives_a_reload(start_daemon, scene):
    daemon = start_daemon(scene, ["ipc"])
    with clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) as client:
        client.replace("cup", box=[0.3, 0.3, 0.3])
        before = client.distances(pairs=("cup", "table")).lower.tolist()
        client.reload()
        assert client.distances(pairs=("cup", "table")).lower.tolist() == before
        scene.write_text("bodies: [{name: table, box: [1, 1, 1]}]\n")
        assert client.reload().body_count == 1
        assert "added_bodies_left_out" in daemon.log() and "there is no body" in daemon.log()
