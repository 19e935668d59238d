"""Objects that can be sent to other processes, and the errors of those that cannot."""

import concurrent.futures
import copy
import multiprocessing
import pickle
import warnings

import numpy as np
import pytest

import clearance
from scenes import ARM_POSES, arm, at, same

WAYS = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "oldest": lambda value: pickle.loads(pickle.dumps(value, protocol=2)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}
QUERIES = {
    "none": {"fields": ("default", "points", "flags", "gradient", "pieces")},
    "min": {"reduce": "min"},
    "nearest": {"reduce": "nearest"},
    "within": {"reduce": "within", "max_distance": 0.5, "fields": ("default", "pair", "configuration")},
    "configurations": {"bodies": ["link2"], "configurations": [[at(1, 0, 0)], [at(0, 2, 0)]]},
    "float32": {"fields": ("bounds", "points32", "status")},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("query", QUERIES)
def test_results_come_back_equal(engine, query, way):
    result = engine.distances(**QUERIES[query])
    again = WAYS[way](result)
    assert same(result, again) and np.array_equal(again.pairs, result.pairs) and repr(again) == repr(result)
    for name in ("reduce", "fields", "configurations", "total", "scene_revision", "snapshot_revision", "engine_ns",
                 "backend", "pose_age_ns"):  # fmt: skip
        assert getattr(again, name) == getattr(result, name), name
    assert np.array_equal(again.configuration, result.configuration)
    with pytest.raises(AttributeError, match="the column 'gradient_joints' was not requested"):
        _ = again.gradient_joints


def test_a_result_of_a_scene_that_is_gone_keeps_its_columns(engine):
    result = engine.distances()
    engine.allow("link1", "table")
    again = pickle.loads(pickle.dumps(result))
    assert same(result, again)
    with pytest.raises(clearance.QueryError, match="the scene has changed since this answer"):
        _ = again.pairs


@pytest.mark.parametrize("way", WAYS)
def test_checks_come_back_equal(engine, way):
    poses = [[at(0.3, 0, 0.9)], [at(0, 0, 0.4)]]
    check = engine.check(poses, bodies=["link2"])
    again = WAYS[way](check)
    assert np.array_equal(again.free, check.free) and set(check.free) == {True, False}
    assert np.array_equal(again.pair, check.pair) and np.array_equal(again.verdict, check.verdict)
    assert np.array_equal(again.hit, check.hit) and not again and not check
    path = engine.check_path(poses, bodies=["link2"])
    assert not path.free and WAYS[way](path) == path


@pytest.mark.parametrize("way", WAYS)
def test_scenes_come_back_equal(root, way):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", clearance.MeshWarning)
        scene = clearance.Scene.load(root / "scenes" / "cell" / "scene.yaml")
    scene.add_points("cloud", np.random.default_rng(1).normal(size=(50, 3)).astype(np.float32), radius=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = WAYS[way](scene)
    assert again.revision == scene.revision and again.bodies == scene.bodies
    assert np.array_equal(again.ignored, scene.ignored)
    again.add_sphere("more", 0.1)
    assert len(again) == len(scene) + 1, "it is a scene of its own"
    assert len(WAYS[way](clearance.Scene())) == 0
    robot = clearance.Scene()
    robot.add_robot("robot", root / "tests" / "engine" / "robot" / "arm.urdf", home={"joint4": -1.5})
    assert WAYS[way](robot).revision == robot.revision


@pytest.mark.parametrize("way", WAYS)
def test_what_does_not_come_along_says_what_to_do(engine, way):
    rejected = {
        "a clearance.Engine cannot be pickled or copied: send its Scene, or the scene file's path, and make an Engine "
        "of it in each process": engine,
        "a future cannot be pickled or copied: send its result()": engine.submit(),
        "a prepared query cannot be pickled or copied: send its arguments, and prepare it there": engine.prepare(),
    }
    for text, value in rejected.items():
        with pytest.raises(TypeError) as error:
            WAYS[way](value)
        assert str(error.value) == text


def test_a_client_says_what_to_do(ipc):
    with clearance.connect(ipc.urls["ipc"]) as client:
        with pytest.raises(TypeError, match=r"^a clearance\.Client cannot be pickled or copied: send its url, and"):
            pickle.dumps(client)
        result = client.prepare("distances", copy=False).run()
        again = pickle.loads(pickle.dumps(result))
        assert same(result, again) and np.array_equal(again.pairs, result.pairs)


def _checked(scene):
    engine = clearance.Engine(scene, threads=1, covers="off")
    engine.set_poses(ARM_POSES)
    return engine.distances(), engine.check([[at(0.3, 0, 0.9)]], bodies=["link2"])


def test_a_worker_process_takes_a_scene_and_returns_results(engine):
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=context) as pool:
        result, check = pool.submit(_checked, arm()).result()
    assert same(result, engine.distances()) and result.pairs.tolist() == engine.pairs.tolist()
    assert check.free.shape == (1,)
