"""Planning scenes of MoveIt that the ROS 2 package follows, with fakes of the message types."""

import math
import time
from types import SimpleNamespace as Message

import numpy as np

import clearance
from ros_messages import ADD, APPEND, MOVE, REMOVE, header, pose, primitive, scene, thing
from scenes import at


def distance(client, a, b):
    r = client.distances([(a, b)])
    return float(r.lower[0, 0]), float(r.upper[0, 0])


def test_objects_come_move_and_go(bridge):
    client, follower = bridge.client, bridge.scene
    crate = thing("crate", primitives=[(primitive(1, 0.2, 0.2, 0.2), pose(0, 0, 0.1))], where=pose(1, 0, 1))
    pair = thing("pair", primitives=[(primitive(2, 0.1), pose(2)), (primitive(3, 0.4, 0.1), pose(2, 1))])
    cone = thing("cone", primitives=[(primitive(4, 0.4, 0.1), pose(3, 0, 2))])
    follower.on_scene(scene([crate, pair, cone]))
    assert not follower.left_out
    assert [body.name for body in client.bodies][-4:] == ["crate", "pair.0", "pair.1", "cone"]
    low, high = distance(client, "crate", "pair.0")
    exact = math.hypot(0.9, 1.0) - 0.1  # from the sphere's centre to the crate's lower edge
    assert low <= exact <= high and high - low < 1e-5
    state = client.body_states()[client.body_id("cone")]
    assert state.pose.tolist() == at(3, 0, 2)
    low, high = distance(client, "pair.1", "crate")  # about (2, 1) up to z = 0.2; corner (1.1, 0.1, 1)
    assert low <= math.hypot(math.hypot(0.9, 0.9) - 0.1, 0.8) <= high and high - low < 1e-3

    follower.on_scene(scene([thing("crate", MOVE, where=pose(1, 0, 3)), thing("pair", REMOVE)]))
    assert not follower.left_out
    state = client.body_states()[client.body_id("crate")]
    np.testing.assert_allclose(state.pose, at(1, 0, 3.1), atol=1e-12)
    assert "pair.0" not in {body.name for body in client.bodies}
    follower.on_scene(scene([thing("crate", APPEND, primitives=[(primitive(2, 0.1), pose())])]))
    assert client.bodies[-1].name == "crate.1"
    follower.on_scene(scene([cone], is_diff=False))  # a whole scene removes objects that it does not name
    assert {body.name for body in client.bodies if "crate" in body.name or "pair" in body.name} == set()
    assert "table" in {body.name for body in client.bodies}


def test_a_mesh_is_its_triangles(bridge):
    corners = [Message(x=x, y=y, z=0.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))]
    triangles = [Message(vertex_indices=np.array(t, dtype=np.uint32)) for t in ((0, 1, 2), (0, 2, 3))]
    sheet = thing("sheet", meshes=[(Message(vertices=corners, triangles=triangles), pose(0, 0, 2))])
    probe = thing("probe", primitives=[(primitive(2, 0.1), pose(0.5, 0.5, 2.5))])
    bridge.scene.on_scene(scene([sheet, probe]))
    low, high = distance(bridge.client, "sheet", "probe")
    assert low <= 0.4 <= high and high - low < 1e-5


CUBE = [triangle for a, b, c, d in (
    (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)
) for triangle in ((a, b, c), (a, c, d))]  # fmt: skip
PROBE = thing("probe", primitives=[(primitive(2, 0.1), pose(0.5, 0.5, 2.5))])


def crate_of(triangles):
    """A cube of 1 m, whose sides are some of these triangles; PROBE is in its centre."""
    corners = [Message(x=x, y=y, z=z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
    faces = [Message(vertex_indices=np.array(corner, dtype=np.uint32)) for corner in triangles]
    return thing("crate", meshes=[(Message(vertices=corners, triangles=faces), pose(0, 0, 2))])


def test_a_closed_mesh_is_solid(bridge):
    """A body within it overlaps; triangles alone would have it 0.4 m away, and free."""
    for triangles, status in ((CUBE, "OVERLAP"), (CUBE[1:], "OK")):  # the second without a part of a side
        bridge.scene.on_scene(scene([crate_of(triangles), PROBE]))
        assert not bridge.scene.left_out
        r = bridge.client.distances([("crate", "probe")])
        assert clearance.Status(r.status[0, 0]).name == status
    assert r.lower[0, 0] <= 0.4 <= r.upper[0, 0]


def test_a_closed_mesh_with_a_flipped_triangle_is_left_out(bridge):
    """As triangles, it would leave a body within it free."""
    for k in range(len(CUBE)):
        flipped = [triangle[::-1] if i == k else triangle for i, triangle in enumerate(CUBE)]
        bridge.scene.on_scene(scene([crate_of(flipped), PROBE]))
        assert "2 triangles with inconsistent orientations" in bridge.scene.left_out["crate"]
        assert "crate" not in {body.name for body in bridge.client.bodies}
        assert bridge.report(0.5).least == -math.inf
    bridge.scene.on_scene(scene([crate_of(CUBE)]))
    assert not bridge.report(0.5).stale


def test_an_attached_object_follows_its_link_and_may_touch_its_fingers(bridge):
    client, follower = bridge.client, bridge.scene
    link = next(body.name for body in reversed(client.bodies) if body.name.startswith("arm/") and body.piece_count)
    name = link.removeprefix("arm/")
    held = thing("mug", primitives=[(primitive(2, 0.05), pose(0, 0, 0.02))], frame=name)
    attached = Message(link_name=name, object=held, touch_links=[name, "nail"])
    follower.on_scene(scene(attached=[attached]))
    assert not follower.left_out
    mug, at_link = client.body_id("mug"), client.body_id(link)
    states = client.body_states()
    assert states[mug].parent == at_link
    before = states[mug].pose
    bridge.on_joints(Message(header=header(time.time_ns()), name=["joint1"], position=[1.0]))
    states = client.body_states()
    assert np.abs(states[mug].pose - before).max() > 0.05
    pairs = {tuple(pair) for pair in np.sort(client.pairs, axis=1).tolist()}
    assert tuple(sorted((mug, at_link))) not in pairs and len(pairs) > 5
    gone = Message(link_name=attached.link_name, object=thing("mug", REMOVE), touch_links=[])
    follower.on_scene(scene(attached=[gone]))
    state = client.body_states()[client.body_id("mug")]
    assert state.parent is None
    np.testing.assert_allclose(state.pose, states[mug].pose, atol=1e-12)


def test_pairs_that_may_touch_are_not_asked_about(bridge):
    ball = thing("ball", primitives=[(primitive(2, 0.05), pose(0.4, 0.3, 0.5))])  # at the cup's place
    bridge.scene.on_scene(scene([ball]))
    ids = sorted((bridge.client.body_id("ball"), bridge.client.body_id("cup")))
    assert ids in np.sort(bridge.client.pairs, axis=1).tolist()
    assert bridge.report(0.2).pairs[0].status == "overlap"
    bridge.scene.on_scene(scene(names=["ball", "cup", "unheard of"], allowed={("ball", "cup")}))
    assert ids not in np.sort(bridge.client.pairs, axis=1).tolist()
    assert not [pair for pair in bridge.report(0.2).pairs if {pair.a, pair.b} == {"ball", "cup"}]


def test_what_cannot_be_taken_is_said_and_the_rest_is_taken(bridge):
    objects = [
        thing("plane", planes=[Message(coef=[0, 0, 1, 0])]),
        thing("prism", primitives=[(primitive(5, 1.0, 1.0), pose())]),
        thing("short", primitives=[(primitive(1, 1.0), pose())]),
        thing("table", primitives=[(primitive(2, 1.0), pose())]),
        thing("lost", MOVE),
        thing("good", primitives=[(primitive(2, 0.1), pose(3))]),
    ]
    bridge.scene.on_scene(scene(objects))
    why = bridge.scene.left_out
    assert sorted(why) == ["lost", "plane", "prism", "short", "table"]
    assert "planes are not supported" in why["plane"] and "a box has 3 dimensions, not 1" in why["short"]
    assert "type 5" in why["prism"] and "no such object" in why["lost"] and "table" in why["table"]
    assert "good" in {body.name for body in bridge.client.bodies}
    report = bridge.report(0.5)
    assert report.least == -math.inf and report.stale == [f"{name}: {text}" for name, text in why.items()]
    bridge.scene.on_scene(scene([thing("short", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(5))])]))
    assert "short" not in bridge.scene.left_out
    bridge.scene.on_scene(scene(is_diff=False))
    assert not bridge.scene.left_out and bridge.report(0.5).stale == [], "a whole scene without them"
    bridge.scene.on_scene(scene([thing("plane", planes=[Message(coef=[0, 0, 1, 0])])]))
    bridge.scene.on_scene(scene([thing("", REMOVE)]))
    assert not bridge.scene.left_out, "all are removed"


def test_a_new_version_that_cannot_be_taken_leaves_the_old_one(bridge):
    follower = bridge.scene
    follower.on_scene(scene([thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(3))])]))
    for bad in (
        thing("crate", primitives=[(primitive(1, 1.0), pose(3))]),
        thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4)), (primitive(2, -1.0, 0.0), pose())]),
        thing("crate", planes=[Message(coef=[0, 0, 1, 0])]),
        thing("crate", operation=7, primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4))]),
    ):
        follower.on_scene(scene([bad]))
        assert list(follower.left_out) == ["crate"]
        assert bridge.client.body_states()[bridge.client.body_id("crate")].pose.tolist() == at(3)
    follower.on_scene(scene([thing("crate", primitives=[(primitive(1, 1.0, 1.0, 1.0), pose(4))])]))
    assert not follower.left_out


def test_without_a_name_all_are_meant(bridge):
    """As in MoveIt: a removal without a name removes all objects, or detaches all of a link or of any."""
    client, follower = bridge.client, bridge.scene
    link = next(body.name for body in reversed(client.bodies) if body.name.startswith("arm/") and body.piece_count)
    frame = link.removeprefix("arm/")
    balls = [thing(name, primitives=[(primitive(2, 0.05), pose(k))]) for k, name in enumerate("abc", 3)]
    for ball in balls[:2]:
        ball.header.frame_id = frame
    held = [Message(link_name=frame, object=ball, touch_links=[]) for ball in balls[:2]]
    follower.on_scene(scene(balls[2:], attached=held))
    parent = lambda name: client.body_states()[client.body_id(name)].parent  # noqa: E731
    assert [parent(name) for name in "abc"] == [client.body_id(link)] * 2 + [None]
    follower.on_scene(scene([thing("", REMOVE), thing("a", REMOVE)]))
    assert [parent(name) for name in "ab"] == [client.body_id(link)] * 2, "what is attached is not in the world"
    follower.on_scene(scene(balls[2:]))
    for where in ("joint1", ""):  # of another link, then of any
        follower.on_scene(scene(attached=[Message(link_name=where, object=thing("", REMOVE), touch_links=[])]))
        assert (parent("a") is None) == (not where)
    assert [parent(name) for name in "abc"] == [None] * 3
    follower.on_scene(scene([thing("", REMOVE)]))
    assert not {"a", "b", "c"} & {body.name for body in client.bodies}
    assert not follower.left_out and "table" in {body.name for body in client.bodies}


def test_a_matrix_that_is_not_square_is_left_out(bridge):
    follower = bridge.scene
    message = scene(names=["table", "cup"], allowed={("cup", "table")})
    message.allowed_collision_matrix.entry_values.pop()
    before = len(bridge.client.pairs)
    follower.on_scene(message)
    assert "2 names need 2 rows of 2 values" in follower.left_out_fields["allowed_collision_matrix"]
    assert len(bridge.client.pairs) == before
    follower.on_scene(scene(names=["table", "cup"], allowed={("cup", "table")}))
    assert not follower.missing() and len(bridge.client.pairs) == before - 1


def test_an_object_is_added_whole_or_not(bridge):
    client, follower = bridge.client, bridge.scene
    good, bad = (primitive(1, 1.0, 1.0, 1.0), pose(3)), (primitive(2, -1.0), pose(4))
    names = [body.name for body in client.bodies]
    follower.on_scene(scene([thing("crate", primitives=[good, bad])]))
    assert list(follower.left_out) == ["crate"] and [body.name for body in client.bodies] == names
    follower.on_scene(scene([thing("crate", primitives=[good])]))
    for operation in (ADD, APPEND):
        follower.on_scene(scene([thing("crate", operation, primitives=[(good[0], pose(5)), bad])]))
        assert list(follower.left_out) == ["crate"], "what the daemon rejects leaves the old one"
        assert [body.name for body in client.bodies] == [*names, "crate"]
        assert client.body_states()[client.body_id("crate")].pose.tolist() == at(3)
    follower.on_scene(scene([thing("crate", primitives=[(good[0], pose(5)), (primitive(2, 1.0), pose(6))])]))
    assert not follower.left_out and [body.name for body in client.bodies] == [*names, "crate.0", "crate.1"]
