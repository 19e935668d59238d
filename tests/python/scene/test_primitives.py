"""Primitives are restored from a saved scene."""

import clearance


def room():
    scene = clearance.Scene()
    scene.add_half_space("floor")
    scene.add_ellipsoid("egg", (0.1, 0.2, 0.3), pose=[0, 0, 1, 0.9, 0.1, 0.3, 0])
    scene.add_cone("cone", 0.2, 0.5, pose=[1, 0, 1, 0.5, 0.1, 0.3, 0], padding=0.01)
    scene.add_body("post", cylinder=(0.2, 0.5), radius=0.01, pose=[-1, 0, 1, 0.5, 0.1, 0.3, 0])
    scene.add_box("box", (1, 1, 1), pose=[0, 2, 1, 1, 0, 0, 0])
    return scene


def test_a_saved_scene_gives_the_same_answers(tmp_path):
    scene = room()
    scene.save(tmp_path / "saved")
    again = clearance.Scene.load(tmp_path / "saved" / "scene.yaml")
    assert again.revision == scene.revision
    one, other = (clearance.Engine(s, covers="off").distances(signed_distance=True) for s in (scene, again))
    assert (one.lower == other.lower).all() and (one.upper == other.upper).all()
