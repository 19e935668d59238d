"""An invalid body or pose gives a status of its rows; an invalid call raises an exception that names the cause."""

import pickle

import numpy as np
import pytest

import clearance
from clearance import Flag, Status
from scenes import IDENTITY, arm, at

# ---- statuses are not exceptions ------------------------------------------------------------------------------------


def test_missing_and_bad_poses_are_statuses():
    engine = clearance.Engine(arm(), covers="off")
    r = engine.distances(fields=("default", "points", "flags"))
    no_pose = r.status == Status.NO_POSE
    assert no_pose.all() and np.isnan(r.distance).all() and np.isneginf(r.lower).all() and np.isposinf(r.upper).all()
    done = engine.set_poses({"link1": at(0, 0, 0.4), "link2": [np.nan] * 7})
    assert (done.applied, done.bad, done.unknown, done.fixed) == (2, 1, 0, 0) or (done.applied, done.bad) == (1, 1)
    r = engine.distances()
    by_pair = {tuple(pair): Status(s) for pair, s in zip(r.pairs.tolist(), r.status[0])}
    assert by_pair[1, 2] == by_pair[2, 4] == Status.BAD_POSE
    assert by_pair[1, 4] == Status.OK, "the rest of the batch is answered"
    assert engine.body_states()[2].status == Status.BAD_POSE
    for bad in ([0, 0, 0, 0, 0, 0, 0], [np.inf, 0, 0, 1, 0, 0, 0], np.full((4, 4), np.nan)):
        engine.set_poses({"link2": bad})
        assert engine.distances(pairs=("link1", "link2")).status[0, 0] == Status.BAD_POSE
    r = engine.distances(reduce="min", fields=("default", "flags"))
    assert r.flags[0] & Flag.INCOMPLETE


def test_bad_configuration_is_a_status_of_its_rows(engine):
    configurations = np.tile(at(1, 1, 1), (3, 1, 1))
    configurations[1, 0, 3:] = 0
    r = engine.distances(configurations=configurations, bodies=["link2"])
    assert (r.status[1] == Status.BAD_POSE).sum() == 6 and (r.status[[0, 2]] == Status.OK).all()


def test_unknown_ids_are_statuses(engine):
    r = engine.distances(pairs=[[1, 77], [1, 2]])
    assert r.status.tolist() == [[Status.UNKNOWN_BODY, Status.OK]] and np.isnan(r.distance[0, 0])
    done = engine.set_poses({99: IDENTITY, "base": IDENTITY, "link1": IDENTITY})
    assert (done.applied, done.unknown, done.fixed) == (1, 1, 1)


def test_renormalised_is_a_flag_and_stale_a_status(engine):
    engine.set_poses({"link1": at(0, 0, 0.4, (2, 0, 0, 0))}, stamp_ns=12)
    r = engine.distances(fields=("lower", "flags"))
    has_link1 = (r.pairs == 1).any(axis=1)
    assert (r.flags[0, has_link1] & Flag.RENORMALISED).all() and not (r.flags[0, ~has_link1] & Flag.RENORMALISED).any()
    assert (engine.prepare("distances", max_pose_age_ns=1).run().status == Status.STALE_POSE).all()
    with pytest.raises(clearance.QueryError, match="max_pose_age_ns: expected nanoseconds >= 0, got -1"):
        engine.prepare("distances", max_pose_age_ns=-1).run()
    assert not (engine.distances().status == Status.STALE_POSE).any()
    assert r.snapshot_stamp_ns == 12 and engine.body_states()[1].stamp_ns == 12


# ---- exceptions -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments, error, text", [
    ({"pairs": [[1, 2, 3]]}, ValueError, r"pairs\[0\]: expected two bodies or groups, got \[1, 2, 3\]"),
    ({"pairs": np.zeros((2, 3), int)}, ValueError, r"pairs: expected shape \(P, 2\), got \(2, 3\)"),
    ({"pairs": np.array([[0, -1]])}, ValueError, r"pairs: an id is 0 to 4294967295, got -1"),
    ({"pairs": np.array([[0, 1 << 33]])}, ValueError, r"pairs: an id is 0 to 4294967295, got 8589934592"),
    ({"pairs": np.zeros((2, 2))}, TypeError, r"pairs\[0\]\[0\]: expected a name or an id, got .*0\.0"),
    ({"pairs": 7}, TypeError, r"pairs: expected \(P, 2\) ids, a list of name pairs or one pair, got 7"),
    ({"pairs": "arm"}, TypeError, r"pairs: expected \(P, 2\) ids"),
    ({"pairs": [("link1", True)]}, TypeError, r"pairs\[0\]\[1\]: expected a name or an id, got True"),
    ({"pairs": ("lnk1", "*")}, ValueError, r"pairs\[0\]\[0\]: no body or group is named 'lnk1'; did you mean 'link1'"),
    ({"pairs": ("zzzz", "*")}, ValueError,
     r"no body or group is named 'zzzz'; the scene has 'arm', 'base'|the scene has "),
    ({"pairs": [(1, 1)]}, clearance.QueryError, r"pairs\[0\]: body 1 with itself"),
    ({"configurations": np.zeros((2, 7)), "bodies": ["link1", "link2"]}, ValueError,
     r"configurations: expected shape \(K, M, 7\) or \(K, M, 4, 4\), got \(2, 7\)"),
    ({"configurations": np.zeros((2, 1, 7)), "bodies": ["link1", "link2"]}, ValueError,
     r"configurations: expected M = 2 poses each \(bodies\), got shape \(2, 1, 7\)"),
    ({"configurations": np.zeros((2, 1, 7))}, ValueError,
     r"configurations: expected M = 3 poses each \(every movable body\), got shape \(2, 1, 7\)"),
    ({"configurations": np.zeros((0, 1, 7)), "bodies": ["link1"]}, ValueError,
     r"configurations: expected at least one, got shape \(0, 1, 7\)"),
    ({"configurations": np.zeros((1, 0, 7)), "bodies": []}, ValueError, r"bodies: expected at least one"),
    ({"configurations": np.zeros((1, 1, 6)), "bodies": ["link1"]}, ValueError,
     r"configurations: expected poses of 7 numbers"),
    ({"configurations": "abc", "bodies": ["link1"]}, TypeError, r"configurations: expected numbers"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": "link1"}, TypeError,
     r"bodies: expected a list of names or ids, got 'link1'"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["lnik1"]}, ValueError,
     r"bodies\[0\]: no body is named 'lnik1'; did you mean 'link1'"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["arm"]}, ValueError,
     r"bodies\[0\]: 'arm' is a group; expected a body"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": ["base"]}, clearance.QueryError,
     r"bodies\[0\]: 'base' is static and cannot be moved"),
    ({"configurations": np.zeros((1, 2, 7)), "bodies": [1, 1]}, clearance.QueryError,
     r"bodies\[1\]: 'link1' is named twice"),
    ({"configurations": np.zeros((1, 1, 7)), "bodies": [55]}, clearance.QueryError, r"bodies\[0\]: unknown body 55"),
    ({"bodies": ["link1"]}, ValueError, r"bodies: only together with configurations"),
    ({"max_distance": "1"}, TypeError, r"max_distance: expected a number, got '1'"),
    ({"max_distance": np.nan}, ValueError, r"max_distance: expected a number, got nan"),
    ({"max_distance": -1}, clearance.QueryError, r"max_distance: expected metres >= 0, got -1"),
    ({"abs_tol": None}, TypeError, r"abs_tol: expected a number, got None"),
    ({"abs_tol": -1e-3}, clearance.QueryError, r"abs_tol"),
    ({"rel_tol": -1}, ValueError, r"rel_tol: expected a number >= 0 or None, got -1"),
    ({"rel_tol": 2}, clearance.QueryError, r"rel_tol: expected a ratio below 1, got 2"),
    ({"reduce": "max"}, ValueError, r"reduce: expected 'none' or 'within' or 'nearest' or 'min' or 'any', got 'max'"),
    ({"reduce": None}, TypeError, r"reduce: expected 'none' or"),
    ({"fields": "distnce"}, ValueError, r"fields: no column is named 'distnce'; there are distance, lower"),
    ({"fields": ["lower", 3]}, ValueError, r"fields: no column is named 3"),
    ({"fields": []}, ValueError, r"fields: expected at least one column"),
    ({"fields": 3.5}, TypeError, r"fields: expected column names, got 3\.5"),
    ({"fields": 1 << 26}, ValueError, r"fields: unknown bits in 0x4000000"),
    ({"timeout_s": -1}, ValueError, r"timeout_s: expected a number >= 0, got -1"),
    ({"timeout_s": "soon"}, TypeError, r"timeout_s: expected a number, got 'soon'"),
    ({"radius": 1}, TypeError, r"radius"),
])  # fmt: skip
def test_bad_queries_are_named(engine, arguments, error, text):
    with pytest.raises(error, match=text):
        engine.distances(**arguments)
    with pytest.raises(error, match=text):
        engine.submit(**arguments)
    assert (engine.distances().status == Status.OK).all(), "and the engine goes on"


@pytest.mark.parametrize("arguments, error, text", [
    ({"precision": "f16"}, ValueError, r"precision: expected 'f64' or 'f32', got 'f16'"),
    ({"max_results": -1}, ValueError, r"max_results: expected an integer >= 0, got -1"),
    ({"max_results": 1.5}, TypeError, r"max_results: expected an integer, got 1\.5"),
    ({"configurations": np.zeros((1, 3, 7))}, TypeError, r"distances.*'configurations'"),
])  # fmt: skip
def test_bad_options_of_prepared_queries_are_named(engine, arguments, error, text):
    with pytest.raises(error, match=text):
        engine.prepare("distances", **arguments)


@pytest.mark.parametrize("arguments, error, text", [
    (({"lnk1": IDENTITY},), ValueError, r"poses: no body is named 'lnk1'; did you mean 'link1'"),
    (({"link1": [0, 0, 0]},), ValueError, r"poses\['link1'\]: expected poses of 7 numbers .* got shape \(3,\)"),
    (({"link1": IDENTITY, "link2": [0, 0]},), ValueError, r"poses\['link2'\]: expected poses of 7 numbers"),
    (({"link1": "here"},), TypeError, r"poses\['link1'\]: expected numbers"),
    (({"link1": np.zeros((2, 7))},), ValueError, r"poses\['link1'\]: expected one pose, got shape \(2, 7\)"),
    (({"link1": 2 * np.eye(4)},), ValueError, r"poses\['link1'\]: not a rigid transform"),
    (({1.5: IDENTITY},), TypeError, r"poses: expected a body's name or id, got 1\.5"),
    ((np.zeros((2, 7)), ["link1"]), ValueError, r"poses: expected one pose for each of 1 bodies, got shape \(2, 7\)"),
    ((np.zeros(7),), ValueError, r"poses: expected one pose for each of 3 bodies, got shape \(7,\)"),
    (({}, ["link1"]), TypeError, r"bodies: only with an array of poses, not with a dict"),
    (({"link1": IDENTITY}, None, 1.5), TypeError, r"stamp_ns: expected an integer, got 1\.5"),
    ((None,), TypeError, r"poses: expected numbers"),
])  # fmt: skip
def test_bad_poses_are_named(engine, arguments, error, text):
    revision = engine.pose_revision
    with pytest.raises(error, match=text):
        engine.set_poses(*arguments)
    assert engine.pose_revision == revision, "nothing was applied"


def test_empty_update(engine):
    assert engine.set_poses({}).applied == 0


@pytest.mark.parametrize("arguments, error, text", [
    ({"scene": None}, TypeError, r"scene: expected a clearance.Scene, got NoneType"),
    ({"backend": "gpu"}, ValueError, r"backend: expected 'auto' or 'cpu' or 'cuda' or 'reference', got 'gpu'$"),
    ({"backend": 3}, TypeError, r"backend: expected 'auto' or 'cpu' or 'cuda' or 'reference', got 3"),
    ({"threads": -1}, ValueError, r"threads: expected 0 \(all cores\) or more, got -1"),
    ({"threads": 1.5}, TypeError, r"threads: expected an integer, got 1\.5"),
    ({"backend": "cpu", "devices": [0]}, ValueError, r"devices: backend 'cpu' uses none"),
    ({"devices": [1.5]}, TypeError, r"devices\[0\]: expected an integer, got 1\.5"),
    ({"devices": [0, -1]}, ValueError, r"devices\[1\]: expected an integer >= 0, got -1"),
    ({"devices": [99]}, RuntimeError, r"devices: 99 is not there"),
])  # fmt: skip
def test_bad_engines_are_named(arguments, error, text):
    with pytest.raises(error, match=text):
        clearance.Engine(**{"scene": arm(), **arguments})


def test_an_absent_backend_raises():
    assert "cpu" in clearance.Engine.backends()
    if "cuda" not in clearance.Engine.backends():
        with pytest.raises(RuntimeError, match="backend 'cuda' is not there"):
            clearance.Engine(arm(), backend="cuda")


def test_too_many_rows():
    engine = clearance.Engine(arm(), max_rows=20, covers="off")
    with pytest.raises(clearance.QueryError, match=r"3 configurations x 7 rows are more than the limit of 20") as info:
        engine.distances(configurations=np.tile(IDENTITY, (3, 3, 1)))
    assert info.value.code == clearance.wire.ErrorCode.TOO_LARGE and isinstance(info.value, ValueError)


def test_errors_can_be_pickled():

    error = pickle.loads(pickle.dumps(clearance.QueryError(3, "too large")))
    assert (error.code, str(error)) == (3, "too large")
