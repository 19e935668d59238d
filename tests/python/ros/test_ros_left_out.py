"""Parts of planning scenes that were not applied stay in missing() until they are."""

import shutil
from types import SimpleNamespace as Message

import numpy as np
import pytest

import clearance
from ros_messages import APPEND, MOVE, REMOVE, pose, primitive, scene, thing
from scenes import at

LOST = "the daemon was restarted, or a message did not reach it: it lacks objects until a whole scene comes"
PLANE = Message(coef=[0, 0, 1, 0])
BOX, PRISM = (primitive(1, 0.2, 0.2, 0.2), pose(0, 0, 0.1)), (primitive(5, 1.0, 1.0), pose())


def attached(item, link="flange"):
    return Message(link_name=link, object=item, touch_links=[])


def names(bridge):
    return {body.name for body in bridge.client.bodies}


def test_attaching_what_is_missing_leaves_it_missing(bridge):
    follower, wall = bridge.scene, thing("wall", planes=[PLANE])
    follower.on_scene(scene([wall]))
    follower.on_scene(scene(attached=[attached(thing("wall"))]))
    assert "planes are not supported" in follower.left_out["wall"]
    follower.on_scene(scene([thing("wall", REMOVE)]))
    assert "wall" in follower.left_out, "it is attached, not in the world"
    follower.on_scene(scene(attached=[attached(thing("wall", REMOVE))]))
    assert "wall" in follower.left_out, "it is in the world again"
    follower.on_scene(scene([thing("wall", REMOVE)]))
    assert not follower.left_out
    follower.on_scene(scene([wall], attached=[attached(thing("wall", REMOVE))]))
    assert "wall" in follower.left_out, "one difference"


def test_an_unknown_attached_object_is_missing_until_it_is_removed(bridge):
    follower = bridge.scene
    follower.on_scene(scene(attached=[attached(thing("ghost", REMOVE))]))
    assert not follower.left_out, "nothing is missing"
    follower.on_scene(scene(attached=[attached(thing("ghost"))]))
    assert "no such object" in follower.left_out["ghost"]
    follower.on_scene(scene([thing("ghost", REMOVE)]))
    assert not follower.left_out
    follower.on_scene(scene(attached=[attached(thing("tool", planes=[PLANE], frame="flange"))]))
    assert "planes are not supported" in follower.left_out["tool"]
    follower.on_scene(scene(attached=[attached(thing("tool", primitives=[BOX], frame="flange"))]))
    assert not follower.left_out and "tool" in names(bridge), "all its shapes are there"
    follower.on_scene(scene(attached=[attached(thing("tool", MOVE, primitives=[BOX], frame="flange"))]))
    assert "no operation 3" in follower.left_out["tool"] and "tool" in names(bridge)
    follower.on_scene(scene(is_diff=False))
    assert not follower.left_out and "tool" not in names(bridge)


@pytest.mark.parametrize("bad", [thing("shelf", APPEND, primitives=[PRISM]), thing("shelf", primitives=[PRISM])])
def test_moving_or_appending_does_not_mend(bridge, bad):
    follower = bridge.scene
    follower.on_scene(scene([thing("shelf", primitives=[BOX], where=pose(3))]))
    follower.on_scene(scene([bad]))
    follower.on_scene(scene([thing("shelf", MOVE, where=pose(4))]))
    assert "type 5" in follower.left_out["shelf"]
    assert bridge.client.body_states()[bridge.client.body_id("shelf")].pose.tolist() == at(4, 0, 0.1), "but it moves"
    follower.on_scene(scene([thing("shelf", APPEND, primitives=[BOX])]))
    assert "shelf" in follower.left_out and "shelf.1" in names(bridge)
    follower.on_scene(scene([thing("shelf", primitives=[BOX], where=pose(3))]))
    assert not follower.left_out


def test_shapes_are_appended_to_an_attached_object(bridge):
    follower = bridge.scene
    for operation in (0, APPEND):
        tool = thing("tool", operation, primitives=[BOX], frame="flange")
        follower.on_scene(scene(attached=[attached(tool)]))
    assert not follower.left_out and {"tool", "tool.1"} <= names(bridge)


def test_an_object_is_not_detached_from_a_link_that_does_not_hold_it(bridge):
    follower = bridge.scene
    parent = lambda: bridge.client.body_states()[bridge.client.body_id("tool")].parent  # noqa: E731
    follower.on_scene(scene(attached=[attached(thing("tool", primitives=[BOX], frame="flange"))]))
    for link in ("elbow", "flange"):
        assert parent() == bridge.client.body_id("arm/flange")
        follower.on_scene(scene(attached=[attached(thing("tool", REMOVE), link)]))
    assert parent() is None


def test_an_object_is_attached_and_leaves_the_world_in_one_difference(bridge):
    follower = bridge.scene
    follower.on_scene(scene([thing("cube", primitives=[BOX], where=pose(3))]))
    follower.on_scene(scene([thing("cube", REMOVE)], attached=[attached(thing("cube"))]))
    state = bridge.client.body_states()[bridge.client.body_id("cube")]
    assert not follower.left_out and state.parent == bridge.client.body_id("arm/flange")
    np.testing.assert_allclose(state.pose, at(3, 0, 0.1), atol=1e-12)


def test_a_scene_that_does_not_reach_the_daemon_is_missing(bridge, monkeypatch):
    follower, ball = bridge.scene, thing("ball", primitives=[(primitive(2, 0.05), pose(3))])

    def late(*given, **options):
        raise clearance.TimeoutError("no answer")

    with monkeypatch.context() as patch:
        patch.setattr(bridge.client, "add_body", late)
        with pytest.raises(clearance.TimeoutError):
            follower.on_scene(scene([ball]))
    assert bridge.report(0.5).stale == [f"planning_scene: {LOST}"]
    follower.on_scene(scene([ball]))
    assert bridge.report(0.5).stale, "a difference is not all of it"
    follower.on_scene(scene([ball], is_diff=False))
    assert not bridge.report(0.5).stale


def test_octomaps_are_missing_until_a_whole_scene_has_none(bridge):
    follower = bridge.scene
    follower.on_scene(scene(octomap=[1, 2]))
    assert "set_points()" in follower.left_out_fields["octomap"]
    assert [text.partition(":")[0] for text in bridge.report(0.5).stale] == ["octomap"]
    for harmless in (scene(), scene([thing("", REMOVE)]), scene([thing("octomap", primitives=[BOX])])):
        follower.on_scene(harmless)
        assert "octomap" in follower.left_out_fields
    follower.on_scene(scene(is_diff=False, octomap=[1]))
    assert "octomap" in follower.left_out_fields
    follower.on_scene(scene(is_diff=False))
    assert not follower.left_out_fields


@pytest.mark.parametrize("frame, is_taken", [
    ("", True), ("world", True), ("base", True), ("flange", False), ("map", False), ("cup", False),
])  # fmt: skip
def test_poses_are_in_the_world(bridge, frame, is_taken):
    """MoveIt's planning frame is the robot's root link, or a frame named world."""
    follower = bridge.scene
    bridge.on_joints(Message(header=thing("").header, name=["joint1"], position=[0.5]))
    follower.on_scene(scene([thing("cube", primitives=[BOX], where=pose(3), frame=frame)]))
    assert ("cube" in names(bridge)) == is_taken
    assert list(follower.left_out) == ([] if is_taken else ["cube"])
    if not is_taken:
        assert "header.frame_id: expected world" in follower.left_out["cube"] and frame in follower.left_out["cube"]
    follower.on_scene(scene([thing("cube", primitives=[BOX], where=pose(3))]))
    follower.on_scene(scene([thing("cube", MOVE, where=pose(4), frame=frame)]))
    x = bridge.client.body_states()[bridge.client.body_id("cube")].pose[0]
    assert (x, "cube" in follower.left_out) == ((4, False) if is_taken else (3, True))


def test_a_root_link_elsewhere_is_not_the_world(ros, start_daemon, urdf, tmp_path):
    shutil.copy(urdf, tmp_path / "arm.urdf")
    yaml = "robots:\n  - {name: arm, urdf: arm.urdf, base: [1, 0, 0, 1, 0, 0, 0]}\n"
    (tmp_path / "scene.yaml").write_text(yaml)
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    with clearance.connect(daemon.urls["ipc"]) as client:
        follower = ros.planning_scene.SceneFollower(client, "arm")
        follower.on_scene(scene([thing("cube", primitives=[BOX], frame="base")]))
        assert "header.frame_id" in follower.left_out["cube"]


def test_attached_poses_are_in_the_link_or_in_the_world(bridge):
    client, follower = bridge.client, bridge.scene
    bridge.on_joints(Message(header=thing("").header, name=["joint1"], position=[0.5]))
    for frame in ("", "map", "elbow"):
        follower.on_scene(scene(attached=[attached(thing("mug", primitives=[BOX], frame=frame))]))
        assert "header.frame_id: expected flange or world" in follower.left_out["mug"]
        assert "mug" not in names(bridge)
    poses = {}
    for frame in ("world", "flange"):
        follower.on_scene(scene(attached=[attached(thing("mug", primitives=[BOX], frame=frame))]))
        state = client.body_states()[client.body_id("mug")]
        assert not follower.left_out and state.parent == client.body_id("arm/flange")
        poses[frame] = state.pose
    np.testing.assert_allclose(poses["world"], at(0, 0, 0.1), atol=1e-12)
    assert np.abs(poses["flange"] - poses["world"]).max() > 0.1


def test_pairs_that_a_later_matrix_revokes_are_asked_about_again(bridge):
    client, follower = bridge.client, bridge.scene
    client.allow("table", "cup")  # as the daemon's scene does
    pairs = lambda: {tuple(sorted(client.bodies[i].name for i in pair)) for pair in client.pairs.tolist()}  # noqa: E731
    everything = ["arm/base", "ball", "cup", "table"]
    own, table = ("ball", "cup"), ("cup", "table")
    follower.on_scene(scene([thing("ball", primitives=[(primitive(2, 0.05), pose(0.4, 0.3, 0.5))])]))
    assert own in pairs()
    for revoked in (
        scene(names=everything, allowed={table}),
        scene(names=["arm/base", "table"]),
        scene([thing("ball", MOVE, where=pose())], is_diff=False),
    ):
        follower.on_scene(scene(names=everything, allowed={own, table}))
        follower.on_scene(scene())
        assert not {own, table} & pairs(), "a difference without a matrix changes none"
        follower.on_scene(revoked)
        assert own in pairs() and table not in pairs()
    message = scene(names=everything)
    message.allowed_collision_matrix.entry_values.pop()
    follower.on_scene(message)
    for harmless in (scene(), scene([thing("", REMOVE)])):
        follower.on_scene(harmless)
        assert "allowed_collision_matrix" in follower.left_out_fields, "not mended by one without"


def grown(field, value, is_diff=True, **links):
    message = scene(is_diff=is_diff)
    items = [Message(link_name=name, **{value: number}) for name, number in links.items()]
    setattr(message, field, items)
    return message


@pytest.mark.parametrize("field, value, true", [("link_padding", "padding", 0.0), ("link_scale", "scale", 1.0)])
def test_links_that_moveit_grows_are_missing(bridge, field, value, true):
    follower = bridge.scene
    follower.on_scene(grown(field, value, upper=true, flange=true - 0.1))
    assert not follower.left_out_fields, "the daemon's links are not smaller"
    follower.on_scene(grown(field, value, upper=true + 0.01, flange=true))
    assert follower.left_out_fields[field].startswith(f"upper {true + 0.01:g}")
    follower.on_scene(grown(field, value, flange=true))
    follower.on_scene(scene([thing("", REMOVE)]))
    assert field in follower.left_out_fields, "the other link is as it was"
    assert bridge.report(0.5).least == -np.inf
    follower.on_scene(grown(field, value, flange=float("nan")))
    assert "flange nan" in follower.left_out_fields[field]
    follower.on_scene(grown(field, value, upper=true, flange=true))
    assert not follower.left_out_fields
    follower.on_scene(grown(field, value, upper=true + 1))
    for whole in (scene(is_diff=False), grown(field, value, is_diff=False, flange=true)):
        follower.on_scene(whole)
        assert follower.left_out_fields[field].startswith("upper"), "a whole scene does not list the link"
    follower.on_scene(grown(field, value, is_diff=False, upper=true))
    assert not follower.missing()


@pytest.mark.parametrize("name", ["link_padding", "link_scale", "allowed_collision_matrix", "octomap"])
def test_an_object_may_have_the_name_of_a_field(bridge, name):
    """Neither hides the other, and each is missing until it is mended itself."""
    follower = bridge.scene
    bad = scene([thing(name, planes=[PLANE])], names=["cup", "table"], octomap=[1])
    bad.allowed_collision_matrix.entry_values.pop()
    bad.link_padding = [Message(link_name="upper", padding=0.01)]
    bad.link_scale = [Message(link_name="upper", scale=1.1)]
    follower.on_scene(bad)
    assert len(follower.missing()) == 5 and "planes are not supported" in follower.left_out[name]
    mended = scene(names=["cup", "table"])
    mended.link_padding = [Message(link_name="upper", padding=0.0)]
    mended.link_scale = [Message(link_name="upper", scale=1.0)]
    follower.on_scene(mended)
    assert list(follower.left_out) == [name] and list(follower.left_out_fields) == ["octomap"]
    assert bridge.report(0.5).stale == follower.missing()
    follower.on_scene(bad)
    follower.on_scene(scene([thing("", REMOVE)]))
    assert not follower.left_out and len(follower.left_out_fields) == 4
