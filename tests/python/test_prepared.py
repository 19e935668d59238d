"""Prepared queries: the same answers as from distances(), by the engine and a client."""

import numpy as np
import pytest

import clearance
from scenes import at, random_poses


@pytest.fixture(scope="module")
def scene_file(root):
    return root / "scenes" / "cell" / "scene.yaml"


@pytest.fixture(scope="module", params=["engine", "shm", "ipc"])
def front(request, kinds, scene_file, tmp_path_factory):
    if request.param == "engine":
        yield clearance.Engine(clearance.Scene.load(str(scene_file)), threads=1)
        return
    if kinds[request.param] is not None:
        pytest.skip(kinds[request.param])
    from conftest import Daemon

    daemon = Daemon(tmp_path_factory.mktemp("prepared"), scene_file, [request.param])
    with clearance.connect(daemon.urls[request.param]) as client:
        yield client
    assert daemon.stop() == 0, daemon.log()


def same(a, b):
    return all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in ("lower", "upper", "status")
    )


@pytest.mark.parametrize("copy", [True, False])
def test_answers_are_those_of_distances(front, copy):
    pairs = [("cup", "*"), ("forearm", "table")]
    prepared = front.prepare(pairs=pairs, max_distance=0.5, fields="default", copy=copy)
    expected = front.distances(pairs, max_distance=0.5, fields="default")
    for _ in range(40):  # more than there are slots: each answer releases its own
        result = prepared()
        assert same(result, expected)
    assert np.array_equal(result.pairs, expected.pairs)
    assert (result.fields, result.total, result.configurations) == (
        expected.fields,
        expected.total,
        expected.configurations,
    )
    assert (result.scene_revision, result.backend) == (expected.scene_revision, expected.backend)


def test_new_poses_are_written_into_the_configurations(front):
    bodies = ["forearm", "cup"]
    configurations = random_poses(np.random.default_rng(3), 10, 2.0).reshape(5, 2, 7)
    prepared = front.prepare(bodies=bodies, configurations=configurations, reduce="min")
    before = prepared()
    configurations[...] = random_poses(np.random.default_rng(4), 10, 2.0).reshape(5, 2, 7)
    after = prepared()
    assert not same(before, after)
    assert same(after, front.distances(bodies=bodies, configurations=configurations, reduce="min"))


def test_pairs_are_copied(front):
    pairs = np.array([[0, 3], [1, 5]], dtype=np.uint32)
    prepared = front.prepare(pairs=pairs)
    expected = front.distances(pairs)
    pairs[...] = 7
    result = prepared()
    assert same(result, expected) and np.array_equal(result.pairs, [[0, 3], [1, 5]])
    with pytest.raises(ValueError):
        result.pairs[0] = 1


def test_poses_of_the_moment(front):
    prepared = front.prepare(pairs=("ball", "table"))
    front.set_poses({"ball": at(0.4, 0, 5)})
    far = prepared().distance[0, 0]
    front.set_poses({"ball": at(0.4, 0, 4)})
    assert far - prepared().distance[0, 0] == pytest.approx(1)


@pytest.mark.parametrize("arguments, error", [({"pair": None}, TypeError), ({"reduce": "least"}, ValueError)])
def test_wrong_arguments_are_refused_at_once(front, arguments, error):
    with pytest.raises(error):
        front.prepare(**arguments)
