"""Prepared queries while the scene changes: they survive where their ids keep their meaning, else raise StaleQuery."""

import pickle
import threading

import numpy as np
import pytest

import clearance
from conftest import PATIENCE_S
from robots import rows_of
from scenes import at, random_poses, same_bits

SCENE = """
bodies:
  - {name: floor, box: [4, 4, 0.1], static: true, pose: [0, 0, -1, 1, 0, 0, 0]}
  - {name: tool, box: [0.2, 0.2, 0.2], pose: [0, 0, 0, 1, 0, 0, 0]}
  - {name: ball, sphere: 0.1, pose: [1, 0, 0, 1, 0, 0, 0]}
groups: {things: [tool, ball]}
"""


@pytest.fixture
def front(arm_front):
    return arm_front


def poses(count, seed=3):
    return random_poses(np.random.default_rng(seed), count, 0.6).reshape(count, 1, 7)


@pytest.fixture(params=["shm", "ipc"])
def daemon(request, start_daemon, kinds, tmp_path):
    if kinds[request.param]:
        pytest.skip(kinds[request.param])
    (tmp_path / "scene.yaml").write_text(SCENE)
    return start_daemon(tmp_path / "scene.yaml", [request.param]).urls[request.param]


@pytest.fixture
def clients(daemon):
    with clearance.connect(daemon, timeout_s=PATIENCE_S) as one, clearance.connect(daemon, timeout_s=PATIENCE_S) as two:
        yield one, two


def test_attach_allow_and_forbid_are_survived(front):
    arm = front.joints("arm")
    Q = rows_of(arm, 4)
    hand = next(body.name for body in front.bodies if body.name.startswith("arm/"))
    queries = {
        "distances": front.prepare(joints=arm),
        "check": front.prepare("check", joints=arm, pairs=("arm", "*"), margin={("arm", "cup"): 0.01}),
        "motions": front.prepare("motions", joints=arm, pairs=[("cup", "table")]),
        "check_path": front.prepare("check_path", joints=arm),
        "free_scale": front.prepare("free_scale", joints=arm, pairs=("arm", "table")),
    }
    inputs = {"motions": (Q[:2], Q[2:]), "check_path": (Q,)}
    seen = set()
    for change in (
        lambda: front.attach("cup", hand),
        lambda: front.allow("arm", "table"),
        lambda: front.forbid("arm", "table"),
        lambda: front.attach("cup", None),
    ):
        change()
        assert not any(query.is_stale for query in queries.values())
        given = {call: inputs.get(call, (Q,)) for call in queries}
        results = {call: query.run(*given[call]) for call, query in queries.items()}
        assert same_bits(results["distances"], front.distances(configurations=Q, joints=arm))
        assert same_bits(
            results["check"].result,
            front.check(Q, {("arm", "cup"): 0.01}, pairs=("arm", "*"), joints=arm).result,
        )
        assert same_bits(results["motions"], front.motions(Q[:2], Q[2:], joints=arm, pairs=[("cup", "table")]))
        assert repr(results["check_path"]) == repr(front.check_path(Q, joints=arm))
        scale = front.free_scale(Q, arm, pairs=("arm", "table"))
        assert results["free_scale"].tobytes() == scale.tobytes()
        for call, query in queries.items():
            assert repr(query.submit(*given[call]).result()) == repr(results[call])
        seen.add(results["distances"].pairs.tobytes())
    assert len(seen) == 2, "the changes are seen"


def test_pairs_of_a_result_are_those_of_its_scene(front):
    prepared = front.prepare(pairs=("arm", "*"))
    before = prepared.run()
    kept = before.pairs
    front.allow("arm", "table")
    after, unread = prepared.run(), prepared.run()
    assert len(after.pairs) < len(kept) and after.lower.shape == (1, len(after.pairs))
    front.forbid("arm", "table")
    assert np.array_equal(prepared.run().pairs, kept)
    with pytest.raises(clearance.QueryError, match="the scene has changed since this answer"):
        _ = unread.pairs


def test_poses_of_a_body_that_follows_another_mean_something_else(front):
    hand = next(body.name for body in front.bodies if body.name.startswith("arm/"))
    prepared = front.prepare("check", bodies=["cup"])
    others = front.prepare("check", pairs=("cup", "table")), front.prepare("check", joints="arm")
    prepared.run(poses(2))
    front.attach("cup", hand)
    for call in (prepared.run, prepared.submit):
        with pytest.raises(clearance.StaleQuery, match=f"bodies: the parent of 'cup' was none, and is now '{hand}'"):
            call(poses(2))
    assert prepared.is_stale and not any(query.is_stale for query in others)
    front.attach("cup", None)
    assert not prepared.is_stale
    assert prepared.run(poses(2)).free.shape == (2,)


def test_margins_of_each_pair_belong_to_these_pairs(front):
    count = len(front.pair_table(("arm", "*")))
    each = front.prepare("check", pairs=("arm", "*"), margin=np.full(count, 0.01))
    named = front.prepare("check", pairs=[("cup", "table")], margin=[0.01])
    each.run()
    front.allow("arm", "table")
    with pytest.raises(clearance.StaleQuery, match="margin: one number for each pair"):
        each.run()
    assert named.run().free.all()
    front.forbid("arm", "table")


def test_a_body_that_is_added_or_removed(clients):
    client, _ = clients
    every, pair = client.prepare(), client.prepare(pairs=("ball", "floor"))
    moved = client.prepare("check", bodies=["ball"])
    client.add_body("mug", sphere=0.1, pose=at(0, 1, 0))
    added = client.prepare(pairs=("mug", "floor"))
    assert len(every.run().pairs) == len(client.pairs) == 6
    assert same_bits(pair.run(), client.distances(("ball", "floor")))
    assert moved.run(poses(3)).free.shape == (3,) and added.run().lower[0, 0] > 0
    client.remove_body("mug")
    assert added.is_stale and not every.is_stale and not pair.is_stale
    with pytest.raises(clearance.StaleQuery, match="the scene has changed: id 3 was 'mug', and is now none") as stale:
        added.run()
    assert stale.value.code == clearance.wire.ErrorCode.WRONG_SCENE and isinstance(stale.value, clearance.QueryError)
    again = pickle.loads(pickle.dumps(stale.value))
    assert type(again) is clearance.StaleQuery and str(again) == str(stale.value)
    with pytest.raises(clearance.StaleQuery):
        added.submit()
    assert len(every.run().pairs) == 3


def test_ids_that_another_client_shifts(clients):
    client, other = clients
    client.add_body("first", sphere=0.1, pose=at(0, 1, 0))
    client.add_body("second", sphere=0.1, pose=at(0, -1, 0))
    first, second = (client.prepare(pairs=(name, "floor")) for name in ("first", "second"))
    things, margins = client.prepare(pairs=("things", "*")), client.prepare("check", margin={("second", "*"): 0.1})
    ball = client.prepare(pairs=("ball", "floor"))
    expected = ball.run()
    second.run()
    other.remove_body("first")  # `second` takes its id
    for query in (second, first, margins):
        with pytest.raises(clearance.StaleQuery, match=r"id [34] was '(first|second)', and is now"):
            query.run()
        assert query.is_stale
    assert ball.run().lower.tobytes() == expected.lower.tobytes()
    assert things.run().lower.shape == (1, len(client.pair_table(("things", "*"))))
    assert client.distances(("second", "floor")).pairs.tolist() == [[3, 0]]
    with pytest.raises(clearance.StaleQuery):
        second.run()  # also after other calls have read the new scene
    assert client.prepare(pairs=("second", "floor")).run().lower[0, 0] > 0


def test_a_future_of_a_query_that_becomes_stale(clients):
    client, other = clients
    other.add_body("mug", sphere=0.1, pose=at(0, 1, 0))
    client.refresh()
    prepared = client.prepare(pairs=("mug", "floor"))
    other.remove_body("mug")
    future = prepared.submit()
    with pytest.raises(clearance.StaleQuery, match="id 3 was 'mug'"):
        future.result()
    assert isinstance(future.exception(), clearance.StaleQuery)


def test_every_answer_is_of_one_scene_while_another_thread_changes_it(front):
    arm = front.joints("arm")
    Q = rows_of(arm, 3)
    prepared = front.prepare(joints=arm, pairs=("arm", "*"), reduce="none", fields="lower")
    counts = set()
    for allow in (front.allow, front.forbid):
        allow("arm", "table")
        counts.add(len(front.pair_table(("arm", "*"))))
    assert len(counts) == 2
    done, wrong = threading.Event(), []

    def change():
        for _ in range(100):
            front.allow("arm", "table")
            front.forbid("arm", "table")
        done.set()

    thread = threading.Thread(target=change)
    thread.start()
    while not done.is_set():
        wrong += [n for n in prepared.run(Q).lower.shape[1:] if n not in counts]
    thread.join()
    assert not wrong and prepared.run(Q).lower.shape[1] == max(counts)
