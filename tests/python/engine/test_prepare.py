"""Prepared queries: every call, with the bits of the call itself, by an engine and by clients."""

import inspect
import pickle
import threading

import numpy as np
import pytest

import clearance
from clearance._query.conversions import NO_ARGUMENTS
from clearance.wire import ErrorCode
from conftest import PATIENCE_S
from robots import rows_of
from scenes import at, random_poses, same_bits

CALLS = ["distances", "check", "motions", "check_path", "free_scale"]


@pytest.fixture
def front(arm_front):
    return arm_front


def poses(count, bodies=1, seed=3):
    return random_poses(np.random.default_rng(seed), count * bodies, 0.6).reshape(count, bodies, 7)


def equal(a, b):
    """Whether results of a call are equal, bit for bit."""
    if isinstance(a, clearance.Check):
        assert np.array_equal(a.ok, b.ok) and a.limit_violations == b.limit_violations and bool(a) == bool(b)
        return same_bits(a.result, b.result)
    if isinstance(a, clearance.Result):
        return same_bits(a, b)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.tobytes() == b.tobytes()
    return repr(a) == repr(b)  # NaN in a time is equal to itself


def bits(result):
    """The numbers of a call's result."""
    result = result.result if isinstance(result, clearance.Check) else result
    columns = result.columns.values() if isinstance(result, clearance.Result) else [np.array(repr(result))]
    return b"".join(column.tobytes() for column in ([result] if isinstance(result, np.ndarray) else columns))


def arm_inputs(call, Q):
    """Inputs of a call for the arm's joints."""
    return {"motions": (Q[:3], Q[3:6]), "check_path": (Q[:5],), "free_scale": (Q,)}.get(call, (Q,))


#: call -> arguments besides the joints.
ARGUMENTS: dict[str, list[dict]] = {
    "distances": [
        {"reduce": "min"},
        {"reduce": "none", "max_distance": 0.5, "fields": ("default", "points", "flags", "gradient_joints")},
        {"reduce": "within", "max_distance": 0.4},
        {"reduce": "nearest", "pairs": ("cup", "*"), "signed_distance": True},
        {"reduce": "any", "margin": {("arm", "*"): 0.02, ("cup", "*"): 0.0}, "fields": ("default", "pair")},
        {"pairs": [("cup", "table"), ("arm", "cup")]},
    ],
    "check": [{}, {"margin": 0.05, "pairs": ("arm", "table")}],
    "motions": [{}, {"reduce": "any", "margin": 0.01}, {"reduce": "none", "pairs": ("cup", "arm"), "abs_tol": 1e-2}],
    "check_path": [{}, {"margin": 0.01, "max_evaluations": 8}],
    "free_scale": [
        {"pairs": ("arm", "cup")},
        {"weights": np.arange(1.0, 9.0), "margin": 0.001, "pairs": ("arm", "cup")},
    ],
}
CASES = [(call, arguments) for call in CALLS for arguments in ARGUMENTS[call]]


@pytest.mark.parametrize("call, arguments", CASES, ids=str)
def test_results_are_those_of_the_call(front, call, arguments):
    arm = front.joints("arm")
    prepared = front.prepare(call, joints=arm, **arguments)
    seen = []
    for seed in range(4):
        inputs = arm_inputs(call, rows_of(arm, 6, seed))
        names = [name for name in inspect.signature(getattr(front, call)).parameters if name in prepared._call.inputs]
        once = getattr(front, call)(**dict(zip(names, inputs)), joints=arm, **arguments)
        result = prepared.run(*inputs)
        assert equal(result, once)
        assert equal(prepared.submit(*inputs).result(), once)
        seen.append(bits(result))
    assert len(set(seen)) > 1, "the inputs matter"


def test_one_row_at_a_time_is_a_row_of_the_batch(front):
    arm = front.joints("arm")
    Q = rows_of(arm, 40)
    check = front.prepare("check", joints=arm, pairs=[("arm", "table"), ("arm", "cup")])
    batch = check.run(Q)
    assert 0 < batch.free.sum() < len(Q)
    assert [bool(check.run(q[None]).free[0]) for q in Q] == batch.free.tolist()
    assert [bool(check.run(q[None])) for q in Q] == batch.ok.tolist()
    assert [check.run(q[None]).result.all_free for q in Q] == batch.free.tolist()
    assert not batch.result.all_free
    least = front.prepare(joints=arm, reduce="min", fields=["lower", "pair", "gradient_joints"])
    batch = least.run(Q)
    ones = [least.run(q[None]) for q in Q]
    for name, column in batch.columns.items():
        assert np.concatenate([one.columns[name] for one in ones]).tobytes() == column.tobytes(), name


def test_paths_of_one_motion_are_those_of_the_call(front):
    arm = front.joints("arm")
    prepared = front.prepare("check_path", joints=arm, pairs=[("arm", "table"), ("arm", "cup")])
    Q = rows_of(arm, 12)
    Q[9] += 9.0
    seen = []
    for a, b in zip(Q, np.roll(Q, 1, axis=0)):
        for path in ([a, b], [a, a + 0.01 * (b - a)], [a, b, a], [a, b, a, b]):
            expected = front.check_path(path, joints=arm, pairs=[("arm", "table"), ("arm", "cup")])
            found = prepared.run(np.array(path))
            assert found == expected and prepared.run(path) == expected
            seen.append((found.free, found.ok))
    assert set(seen) == {(True, True), (True, False), (False, False)}
    for wrong in (Q[:1], Q[0], np.zeros((2, 3)), np.zeros(()), [Q[0]]):
        with pytest.raises(ValueError, match=r"^path: expected"):
            prepared.run(wrong)


def test_poses_joints_and_the_current_state(front):
    arm = front.joints("arm")
    X, Q = poses(5), rows_of(arm, 5)
    both = front.prepare(bodies=["cup"], joints=arm, reduce="min")
    expected = front.distances(configurations=(Q, X), bodies=["cup"], joints=arm, reduce="min")
    assert equal(both.run((Q, X)), expected)
    moved = front.prepare("check", bodies=["cup"], margin=0.01)
    assert equal(moved.run(X), front.check(X, 0.01, bodies=["cup"]))
    matrices = np.tile(np.eye(4), (5, 1, 1, 1))
    matrices[:, 0, :3, 3] = X[:, 0, :3]
    assert equal(moved.run(matrices), front.check(matrices, 0.01, bodies=["cup"]))
    now = front.prepare("check")
    for height in (0.5, 2.0):
        front.set_poses({"cup": at(0.4, 0.3, height)})
        assert equal(now.run(), front.check())
    front.set_poses({"cup": at(0.4, 0.3, 0.5)})
    movable = [body.id for body in front.bodies if not body.is_static and body.name == "cup"]
    assert movable


def test_default_columns_depend_on_the_number_of_rows(front):
    arm = front.joints("arm")
    prepared = front.prepare(joints=arm)
    pairs = len(prepared.run(rows_of(arm, 1)).pairs)
    many = rows_of(arm, 100_000 // pairs + 1)
    for Q in (many[:1], many, many[:2]):
        result = prepared.run(Q)
        assert result.columns.keys() == front.distances(configurations=Q, joints=arm).columns.keys()
        assert ("normal" in result.columns) == (len(Q) * pairs <= 100_000)


@pytest.mark.parametrize("arguments, inputs, error, text", [
    ({"joints": "arm"}, (np.zeros((1, 3)),), ValueError, r"configurations: expected shape \(K, 8\).*got \(1, 3\)"),
    ({"joints": "arm"}, (np.zeros((0, 8)),), ValueError, "configurations: expected at least one row"),
    ({"joints": "arm"}, (), ValueError, "joints: only together with configurations"),
    ({"joints": "arm"}, ("here",), TypeError, "configurations: expected"),
    ({"bodies": ["cup"]}, (np.zeros((1, 2, 7)),), ValueError, r"configurations: expected M = 1 poses each \(bodies\)"),
    ({"bodies": ["cup"], "joints": "arm"}, (np.zeros((1, 8)),), TypeError, r"expected a pair \(positions, poses\)"),
    ({"call": "motions", "joints": "arm"}, (np.zeros((1, 8)), np.zeros((2, 8))), ValueError, "end: expected shape"),
    ({"call": "motions", "joints": "arm"}, (np.zeros((1, 8)),), ValueError, "end: expected .* got none"),
    ({"call": "check_path", "bodies": ["cup"]}, (), ValueError, "path: expected .* got none"),
    ({"call": "check_path", "joints": "arm"}, (np.zeros((1, 8)),), ValueError, "path: expected two waypoints"),
])  # fmt: skip
def test_wrong_inputs_are_named(front, arguments, inputs, error, text):
    prepared = front.prepare(**arguments)
    for run in (prepared.run, prepared.submit):
        with pytest.raises(error, match=text):
            run(*inputs)


@pytest.mark.parametrize("arguments, error, text", [
    ({"call": "distance"}, ValueError, "call: expected 'distances' or .*got 'distance'; did you mean 'distances'"),
    ({"reduce": "least"}, ValueError, "reduce: expected"),
    ({"sined": True}, TypeError, r"prepare\('distances'\) got an unexpected argument 'sined'"),
    ({"configurations": None}, TypeError, r"prepare\('distances'\) got an unexpected argument 'configurations'"),
    ({"call": "check", "fields": "lower"}, TypeError, r"prepare\('check'\) got an unexpected argument 'fields'"),
    ({"call": "check", "max_evaluations": 8}, TypeError, r"prepare\('check'\) got an unexpected argument 'max_eval"),
    ({"warm": True}, TypeError, "unexpected argument 'warm'"),
    ({"model": "pieces"}, TypeError, "unexpected argument 'model'; set abs_tol or rel_tol"),
    ({"format": "compact"}, TypeError, "unexpected argument 'format'"),
    ({"min_pose_stamp_ns": 1}, TypeError, "unexpected argument 'min_pose_stamp_ns'"),
    ({"call": "free_scale"}, ValueError, "joints: expected some, that move"),
    ({"precision": "f16"}, ValueError, "precision: expected"),
    ({"max_results": -1}, ValueError, "max_results: expected an integer >= 0"),
    ({"bodies": []}, ValueError, "bodies: expected at least one"),
])  # fmt: skip
def test_wrong_arguments_are_named_at_once(front, arguments, error, text):
    with pytest.raises(error, match=text):
        front.prepare(**arguments)


@pytest.mark.parametrize("arguments, name", [
    ({"call": "check", "margin": -1}, "margin"),
    ({"call": "check", "joints": "arm", "margin": -1}, "margin"),
    ({"call": "check_path", "bodies": ["cup"], "margin": np.inf}, "margin"),
    ({"call": "motions", "joints": "arm", "abs_tol": np.inf}, "abs_tol"),
    ({"call": "free_scale", "joints": "arm", "margin": -1e-9}, "margin"),
    ({"max_distance": -1.0}, "max_distance"),
    ({"bodies": ["cup"], "abs_tol": -1.0}, "abs_tol"),
    ({"max_pose_age_ns": -1}, "max_pose_age_ns"),
])  # fmt: skip
def test_values_out_of_range_are_rejected_at_once(front, arguments, name):
    with pytest.raises(clearance.QueryError, match=name) as info:
        front.prepare(**arguments)
    assert info.value.code == ErrorCode.BAD_QUERY
    front.prepare(**{key: value for key, value in arguments.items() if key != name})


@pytest.mark.parametrize("arguments, text", [
    ({"call": "check", "max_distance": 1.0}, "max_distance: reduce any uses its margins instead"),
    ({"joints": "arm", "margin": 0.1}, "margin: only for reduce any and motions"),
    ({"reduce": "any", "signed_distance": True}, "signed_distance: reduce any computes no depth"),
    ({"fields": "gradient_joints"}, "fields: gradient_joints is for a query with joints"),
    ({"fields": "steps"}, "fields: time, first_contact and steps are only for motions"),
    ({"fields": "verdict"}, "fields: verdict needs reduce any"),
    ({"fields": "free_scale"}, "fields: free_scale needs reduce any"),
    ({"call": "motions", "joints": "arm", "reduce": "any", "fields": "gradient"}, "fields: motions have no gradient"),
])  # fmt: skip
def test_contradictions_are_rejected_at_once(front, arguments, text):
    with pytest.raises(clearance.QueryError, match=text) as info:
        front.prepare(**arguments)
    assert info.value.code == (ErrorCode.NOT_SUPPORTED if "call" in arguments and "joints" in arguments else 1)


@pytest.mark.parametrize("arguments, text", [
    ({"bodies": ["table"]}, "bodies.0.: 'table' is static and cannot be moved"),
    ({"bodies": [999]}, "bodies.0.: unknown body 999"),
    ({"call": "check", "bodies": ["cup"], "margin": np.zeros(7)}, "pair_margins: expected one for each of"),
])  # fmt: skip
def test_an_engine_rejects_what_its_scene_does_not_have_at_once(arm_engine, arguments, text):
    with pytest.raises(clearance.QueryError, match=text):
        arm_engine.prepare(**arguments)


def other_arrays(Q):
    """The same numbers in arrays that need a conversion, or another check, than those read in place."""
    unaligned = np.frombuffer(b"." + Q.tobytes(), np.uint8)[1:].view(Q.dtype).reshape(Q.shape)
    assert not unaligned.flags.aligned
    return {
        "list": Q.tolist(),
        "columns first": np.asfortranarray(Q),
        "every second": np.repeat(Q, 2, axis=0)[::2],
        "other bytes": Q.astype(Q.dtype.newbyteorder()),
        "unaligned": unaligned,
        "masked": np.ma.MaskedArray(Q),
        "subclass": Q.view(type("Rows", (np.ndarray,), {})),
        "read-only": np.frombuffer(Q.tobytes(), Q.dtype).reshape(Q.shape),
    }


@pytest.mark.parametrize("call", [call for call in CALLS if call != "check_path"])
def test_arrays_that_need_a_conversion_have_the_same_results(front, call):
    arm = front.joints("arm")
    prepared = front.prepare(call, joints=arm, pairs=("cup", "arm"), **{"reduce": "min"} if call == "distances" else {})
    Q = rows_of(arm, 6)
    inputs = arm_inputs(call, Q)
    expected = prepared.run(*inputs)
    assert equal(prepared.run(*inputs), expected)  # now read in place
    assert prepared._by_rows is not None
    others = [other_arrays(array) for array in inputs]
    for kind in others[0]:
        assert equal(prepared.run(*(arrays[kind] for arrays in others)), expected), kind
    masked = [np.ma.MaskedArray(array, mask=array == array[0, 0]) for array in inputs]
    for wrong in (masked, [array[:, :-1] for array in inputs], [array[:0] for array in inputs], [None for _ in inputs]):
        with pytest.raises(ValueError):
            prepared.run(*wrong)
    with pytest.raises(TypeError):
        prepared.run(*inputs, Q, Q, Q)
    assert equal(prepared.run(*inputs), expected)


def test_options_of_prepared_queries_alone(front):
    few = front.prepare(reduce="within", max_distance=5.0, max_results=2).run()
    assert len(few.lower) == 2 and few.total > 2
    f32, f64 = (front.prepare(precision=word, fields="lower").run().lower for word in ("f32", "f64"))
    assert np.allclose(f32, f64, rtol=1e-3) and f64.tobytes() == front.distances(fields="lower").lower.tobytes()
    front.set_poses({"cup": at(0.4, 0.3, 0.5)})
    stale = front.prepare(pairs=("cup", "table"), max_pose_age_ns=1).run()
    assert stale.status.tolist() == [[clearance.Status.STALE_POSE]]
    is_client = isinstance(front, clearance.Client)
    for name, value in {"copy": False, "deadline_ns": 3_600_000_000_000}.items():
        if is_client:
            assert len(front.prepare(pairs=("cup", "table"), **{name: value}).run().lower) == 1
        else:
            with pytest.raises(TypeError, match=name):
                front.prepare(**{name: value})


def test_every_row_of_the_options_is_an_argument(front):
    """A new row of wire/query_options.h needs no other code."""
    taken = []
    for name, (_, kind, default, words, *_) in front._module.OPTIONS.items():
        if name in (*NO_ARGUMENTS, "max_evaluations"):
            continue
        value = words.split()[default] if kind == "word" else None if name == "rel_tol" else default
        result = front.prepare(**{"fields": "default", name: value}).run()
        assert same_bits(result, front.distances(fields="default")), name
        taken.append(name)
    assert {"max_distance", "precision", "max_results", "fields", "reduce", "margin"} <= set(taken)


def test_parameters():
    """The names that a caller can rely on."""
    parameters = {call: list(inspect.signature(getattr(clearance.Client, call)).parameters)[1:] for call in CALLS}
    assert parameters["distances"] == [
        "pairs", "configurations", "bodies", "joints", "reduce", "margin", "max_distance", "abs_tol", "rel_tol",
        "signed_distance", "fields", "timeout_s",
    ]  # fmt: skip
    assert parameters["check"] == ["configurations", "margin", "pairs", "bodies", "joints", "timeout_s"]
    assert (
        inspect.signature(clearance.Engine.submit).parameters
        == inspect.signature(clearance.Engine.distances).parameters
    )
    for call, names in parameters.items():
        text = getattr(clearance.Client, call).__doc__
        assert all(name in text for name in names), call


def test_arguments_are_copied(front):
    pairs, bodies, margins = np.array([[0, 1]], dtype=np.uint32), ["cup"], np.array([0.1])
    prepared = front.prepare("distances", pairs=pairs, bodies=bodies, reduce="any", margin=margins)
    expected = prepared.run(poses(3))
    pairs[...], margins[...] = 7, 9.0
    bodies.append("table")
    assert equal(prepared.run(poses(3)), expected)
    rows = front.prepare(pairs=np.array([[0, 1]])).run().pairs
    with pytest.raises(ValueError):
        rows[0] = 1


def test_threads_share_a_prepared_query(front):
    arm = front.joints("arm")
    Q = rows_of(arm, 64)
    check = front.prepare("check", joints=arm, pairs=[("arm", "table"), ("arm", "cup")])
    expected = [bits(check.run(q[None])) for q in Q]
    wrong = []

    def work(first):
        for _ in range(5):
            for i in range(first, len(Q), 4):
                if bits(check.run(Q[i : i + 1])) != expected[i]:
                    wrong.append(i)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and len(set(expected)) > 2


def test_a_prepared_query_is_not_sent(front):
    prepared = front.prepare("check")
    with pytest.raises(TypeError, match="a prepared query cannot be pickled or copied"):
        pickle.dumps(prepared)
    assert repr(prepared) == "<clearance.Prepared check(configurations)>"
    with pytest.raises(TypeError, match="on_device: only for the call 'distances'"):
        prepared.on_device(1)
    with pytest.raises(ValueError, match="configurations: expected 1 or more"):
        front.prepare(joints="arm").on_device()


def test_joint_limits(front):
    arm = front.joints("arm")
    check = front.prepare("check", joints=arm, pairs=("cup", "table"))
    Q = rows_of(arm, 4)
    Q[1, 0] = arm.upper[0] + 0.1 if np.isfinite(arm.upper[0]) else Q[1, 0]
    limited = int(np.flatnonzero(np.isfinite(arm.upper))[0])
    Q[2, limited] = arm.upper[limited] + 0.5
    result = check.run(Q)
    assert result.free.all() and result.beyond_limits[2] and not bool(result)
    assert [v.configuration for v in result.limit_violations][-1] == 2
    assert equal(result, front.check(Q, joints=arm, pairs=("cup", "table")))
    Q[2, limited] = np.nan
    assert not check.run(Q).beyond_limits[2]
    Q[...] = 0.5 * (np.maximum(arm.lower, -1) + np.minimum(arm.upper, 1))
    Q[0, limited] = np.degrees(arm.upper[limited] - 0.1) if arm.upper[limited] > 1 else 60.0
    with pytest.warns(clearance.JointLimitWarning, match="configurations: ") as caught:
        check.run(Q)
    assert caught[0].filename == __file__


def test_service_class_and_waiting_for_poses(arm_daemon):
    with clearance.connect(arm_daemon.urls["ipc"], timeout_s=PATIENCE_S, service_class="planning") as client:
        assert client.check().free.shape == (1,)
        stamp = 1_000_000_000
        client.set_poses({"cup": at(0.4, 0.3, 0.5)}, stamp_ns=stamp)
        client.wait_for_poses(stamp, "cup")
        with pytest.raises(clearance.RequestError) as late:
            client.wait_for_poses(stamp + 1, of="cup", timeout_s=0.01)
        assert late.value.code == clearance.wire.ErrorCode.POSES_LATE
        client.set_poses({"cup": at(0.4, 0.3, 0.5)})
        for wrong in ({"stamp_ns": 0}, {"stamp_ns": 1, "timeout_s": 11}, {"stamp_ns": 1, "of": "cupp"}):
            with pytest.raises(ValueError, match=list(wrong)[-1]):
                client.wait_for_poses(**wrong)
    with pytest.raises(ValueError, match="service_class: expected 'control' or 'planning'"):
        clearance.connect(arm_daemon.urls["ipc"], service_class="plan")
