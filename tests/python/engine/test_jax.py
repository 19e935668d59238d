"""Device queries as JAX functions. Without a GPU, XLA calls a fake in CPU memory, whose rows are the engine's own; with
one, in JAX and here, device queries are tested as well."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

from robots import arm_scene, rows_of

jax = pytest.importorskip("jax", reason="needs JAX: make test-extras EXTRAS=jax")

import jax.numpy as jnp  # noqa: E402

import clearance  # noqa: E402
import clearance.jax  # noqa: E402
from clearance import _engine  # noqa: E402
from clearance._device import xla_ffi  # noqa: E402
from clearance._device.plan import DevicePlan  # noqa: E402
from clearance._words import COLUMNS, Field  # noqa: E402

K, BODIES = 5, ["s1", "s4"]
MASK = int(Field.DISTANCE | Field.LOWER | Field.STATUS | Field.GRADIENT | Field.POINTS32)


def balls() -> clearance.Scene:
    scene = clearance.Scene()
    for i in range(6):
        scene.add_capsule(f"s{i}", 0.2 + 0.02 * i, 0.3, pose=[i, 0.1 * i, 0, 1, 0, 0, 0])
    return scene


def memory(address: int, shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    count = int(np.prod(shape)) * dtype.itemsize
    return np.frombuffer(memoryview((ctypes.c_char * count).from_address(address)), dtype).reshape(shape)


def answer(engine: clearance.Engine, pairs: np.ndarray, numbers: np.ndarray, name: str) -> np.ndarray:
    """A column of an ordinary query."""
    return getattr(engine.distances(pairs, numbers, BODIES, fields=name), name)


class FakeDevice:
    """Replaces the extension module's plan: an engine on the CPU answers with the data at the addresses."""

    device = 0

    def __init__(self, engine: clearance.Engine, pairs: np.ndarray):
        self.engine, self.pairs, self.runs = engine, pairs, 0
        self.shape = (K, len(pairs), MASK)

    def run(self, poses: int, positions: int, columns: list[int], stream: int) -> None:
        assert positions == 0
        self.runs += 1
        given = memory(poses, (K, len(BODIES), 7), np.dtype("<f8"))
        if np.isnan(given).all():
            raise ValueError("nothing but NaN")
        names = [name for name, column in COLUMNS.items() if columns[column.bit]]
        for name in names:
            column = COLUMNS[name]
            out = memory(columns[column.bit], (*self.shape[:2], *column.shape), column.dtype)
            out[...] = answer(self.engine, self.pairs, given, name).reshape(out.shape)


@pytest.fixture(autouse=True)
def _float64() -> object:
    x64 = jax.experimental.enable_x64() if hasattr(jax.experimental, "enable_x64") else jax.enable_x64(True)
    with x64, jax.default_device(jax.devices("cpu")[0]):
        yield


@pytest.fixture()
def engine() -> clearance.Engine:
    return clearance.Engine(balls(), backend="cpu")


@pytest.fixture()
def plan(engine: clearance.Engine) -> DevicePlan:
    pairs = np.array([[1, 0], [1, 4], [2, 4], [3, 5]], dtype=np.uint32)
    return DevicePlan(_engine, FakeDevice(engine, pairs), np.array([1, 4], dtype=np.uint32), pairs)


def poses() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(K, len(BODIES), 7)) * [2, 2, 2, 1, 1, 1, 1]


def test_rows_are_those_of_the_plan(engine: clearance.Engine, plan: DevicePlan) -> None:
    numbers, names = poses(), ["lower", "status", "points32"]
    rows = clearance.jax.Rows(plan, names, platform="cpu")
    expected = {name: answer(engine, plan.pairs, numbers, name) for name in names}
    for evaluate in (rows, jax.jit(rows)):
        got = evaluate(jnp.asarray(numbers))
        assert sorted(got) == sorted(names)
        for name in names:
            np.testing.assert_array_equal(got[name], expected[name])
        assert got["points32"].shape == (*plan.shape, 2, 3) and got["points32"].dtype == np.float32


def test_the_gradient_is_the_slope(engine: clearance.Engine, plan: DevicePlan) -> None:
    numbers, weights = poses(), np.random.default_rng(4).uniform(0.5, 2, plan.shape)
    distances = clearance.jax.Distances(engine, plan, platform="cpu")
    cost = jax.jit(jax.value_and_grad(lambda x: (distances(x) * weights).sum()))
    value, got = cost(jnp.asarray(numbers))
    expected = engine.distances(configurations=numbers, bodies=BODIES, pairs=plan.pairs)
    assert value == pytest.approx((expected.distance * weights).sum(), rel=1e-9)
    apart = (expected.lower > 1e-3).all(axis=1)
    assert apart.sum() >= 2
    step = 1e-6
    for m in range(len(BODIES)):
        for i in range(7):
            moved = [numbers.copy(), numbers.copy()]
            moved[0][:, m, i] -= step
            moved[1][:, m, i] += step
            ends = [
                engine.distances(configurations=x, bodies=BODIES, pairs=plan.pairs, rel_tol=1e-12).distance
                for x in moved
            ]
            slope = ((ends[1] - ends[0]) * weights).sum(axis=1) / (2 * step)
            np.testing.assert_allclose(got[apart, m, i], slope[apart], atol=1e-5)


def test_a_compiled_function_asks_once_a_call(engine: clearance.Engine, plan: DevicePlan) -> None:
    distances = jax.jit(clearance.jax.Distances(engine, plan, platform="cpu"))
    for _ in range(3):
        jax.block_until_ready(distances(jnp.asarray(poses())))
    assert plan._plan.runs == 3


def test_what_the_plan_says_no_to_is_raised(engine: clearance.Engine, plan: DevicePlan) -> None:
    rows = jax.jit(clearance.jax.Rows(plan, platform="cpu"))
    with pytest.raises(Exception, match="clearance: nothing but NaN"):
        jax.block_until_ready(rows(jnp.full(plan.poses_shape, jnp.nan)))
    assert jax.block_until_ready(rows(jnp.asarray(poses())))["lower"].shape == plan.shape, "and it goes on"


def test_a_plan_that_is_gone_is_named(engine: clearance.Engine, plan: DevicePlan) -> None:
    other = DevicePlan(_engine, FakeDevice(engine, plan.pairs), plan.bodies, plan.pairs)
    rows = clearance.jax.Rows(other, platform="cpu")
    del xla_ffi._plans[rows._number]
    with pytest.raises(Exception, match="the plan was deleted"):
        jax.block_until_ready(rows(jnp.asarray(poses())))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.zeros((K, 2, 7), np.float32), r"poses: expected float64 \(5, 2, 7\), got float32"),
        (np.zeros((2, K, 7)), r"poses: expected float64 \(5, 2, 7\), got float64 \(2, 5, 7\)"),
    ],
)
def test_poses_that_are_refused(plan: DevicePlan, given: np.ndarray, text: str) -> None:
    with pytest.raises(TypeError, match=text):
        clearance.jax.Rows(plan, platform="cpu")(given)


def test_columns_that_are_refused(engine: clearance.Engine, plan: DevicePlan) -> None:
    with pytest.raises(ValueError, match="fields: the plan has no column 'uper'"):
        clearance.jax.Rows(plan, ["uper"], platform="cpu")
    bare = FakeDevice(engine, plan.pairs)
    bare.shape = (K, len(plan.pairs), int(Field.LOWER))
    with pytest.raises(ValueError, match="plan: expected the column 'distance' among its fields"):
        clearance.jax.Distances(engine, DevicePlan(_engine, bare, plan.bodies, plan.pairs), platform="cpu")
    of_joints = DevicePlan(_engine, FakeDevice(engine, plan.pairs), None, plan.pairs, np.arange(3, dtype=np.uint32))
    with pytest.raises(ValueError, match="plan: expected bodies alone"):
        clearance.jax.Distances(engine, of_joints, platform="cpu")
    with pytest.raises(ValueError, match="plan: expected the column 'gradient_joints' among its fields"):
        clearance.jax.JointDistances(of_joints, platform="cpu")


class FakeArmDevice:
    """The same for joint positions, of every pair or the nearest."""

    device = 0

    def __init__(self, engine: clearance.Engine, reduce: str, pairs: int):
        self.engine, self.reduce = engine, reduce
        self.shape = (K, pairs, int(Field.DISTANCE | Field.GRADIENT_JOINTS))

    def run(self, poses: int, positions: int, columns: list[int], stream: int) -> None:
        assert poses == 0
        given = memory(positions, (K, JOINTS), np.dtype("<f8"))
        rows = arm_rows(self.engine, given, self.reduce)
        for name in ("distance", "gradient_joints"):
            if columns[COLUMNS[name].bit]:
                expected = getattr(rows, name)
                memory(columns[COLUMNS[name].bit], expected.shape, expected.dtype)[...] = expected


JOINTS = 8
ARM_PAIRS = [(f"arm/{link}", fixed) for link in ("fore", "wrist") for fixed in ("table", "cup")]


def arm_rows(engine: clearance.Engine, positions: np.ndarray, reduce: str) -> clearance.Result:
    return engine.distances(
        ARM_PAIRS,
        joints="arm",
        configurations=positions,
        reduce=reduce,
        fields=["distance", "gradient_joints"],
        rel_tol=1e-12,
    )


@pytest.mark.parametrize("reduce", ["none", "min"])
def test_the_gradient_by_joints_is_the_slope(root: Path, reduce: str) -> None:
    engine = clearance.Engine(arm_scene(str(root / "tests" / "engine" / "robot" / "arm.urdf")), backend="cpu")
    numbers = rows_of(engine.joints("arm"), K)
    rows = arm_rows(engine, numbers, reduce)
    pairs = np.zeros((rows.distance.shape[-1], 2), np.uint32)
    fake = FakeArmDevice(engine, reduce, len(pairs))
    plan = DevicePlan(_engine, fake, None, pairs, np.arange(JOINTS, dtype=np.uint32), reduce == "min")
    distances = clearance.jax.JointDistances(plan, platform="cpu")
    cost = jax.jit(jax.value_and_grad(lambda x: (0.4 - distances(x)).clip(min=0).sum()))
    value, got = cost(jnp.asarray(numbers))
    assert value == pytest.approx(np.clip(0.4 - rows.distance, 0, None).sum(), rel=1e-9)
    near = (rows.distance < 0.4)[..., None]
    slope = -np.where(near, np.nan_to_num(rows.gradient_joints), 0).reshape(K, -1, JOINTS).sum(axis=1)
    assert np.abs(slope).max() > 0.01
    np.testing.assert_allclose(got, slope, atol=1e-12)
    with pytest.raises(TypeError, match=r"positions: expected float64 \(5, 8\), got float32"):
        clearance.jax.Rows(plan, platform="cpu")(positions=np.zeros((K, JOINTS), np.float32))


def gpus() -> list[object]:
    """JAX's GPUs, if the engine has one, too."""
    try:
        return jax.devices("gpu") if "cuda" in clearance.Engine.backends() else []
    except RuntimeError:
        return []


needs_gpu = pytest.mark.skipif(not gpus(), reason="no CUDA device, or JAX has none")


@needs_gpu
@pytest.mark.parametrize("reduce", ["none", "min"])
def test_joints_on_a_gpu(root: Path, reduce: str) -> None:
    scene = arm_scene(str(root / "tests" / "engine" / "robot" / "arm.urdf"))
    engine, cpu = (clearance.Engine(scene, backend=backend) for backend in ("cuda", "cpu"))
    numbers = rows_of(cpu.joints("arm"), 64)
    rows = arm_rows(cpu, numbers, reduce)
    fields = ["distance", "gradient_joints"]
    plan = engine.prepare("distances", pairs=ARM_PAIRS, fields=fields, joints="arm", reduce=reduce).on_device(64)
    distances = clearance.jax.JointDistances(plan)
    cost = jax.jit(jax.value_and_grad(lambda x: (0.4 - distances(x)).clip(min=0).sum()))
    with jax.default_device(gpus()[0]):
        value, got = cost(jnp.asarray(numbers))
    near = (rows.distance < 0.4)[..., None]
    slope = -np.where(near, np.nan_to_num(rows.gradient_joints), 0).reshape(64, -1, JOINTS).sum(axis=1)
    apart = rows.distance.reshape(64, -1).min(axis=1) > 0
    assert apart.sum() > 40 and np.abs(slope[apart]).max() > 0.01
    assert value == pytest.approx(np.clip(0.4 - rows.distance, 0, None).sum(), rel=1e-9)
    np.testing.assert_allclose(np.asarray(got)[apart], slope[apart], atol=1e-9)


@needs_gpu
def test_poses_on_a_gpu(engine: clearance.Engine) -> None:
    on_gpu = clearance.Engine(balls(), backend="cuda")
    pairs = [("s1", "s0"), ("s1", "s4"), ("s2", "s4"), ("s3", "s5")]
    query = on_gpu.prepare("distances", pairs=pairs, bodies=BODIES, fields=["distance", "lower", "gradient"])
    plan = query.on_device(K)
    distances = clearance.jax.Distances(on_gpu, plan)
    cost = jax.jit(jax.value_and_grad(lambda x: distances(x).sum()))
    with jax.default_device(gpus()[0]):
        value, got = cost(jnp.asarray(poses()))
        lower = clearance.jax.Rows(plan, ["lower"])(jnp.asarray(poses()))["lower"]
    expected = answer(engine, plan.pairs, poses(), "lower")
    assert (expected > 0).all()  # so that the rows have the CPU's bits
    np.testing.assert_array_equal(np.asarray(lower), expected)
    assert value == pytest.approx(answer(engine, plan.pairs, poses(), "distance").sum(), rel=1e-12)
    of_cpu = DevicePlan(_engine, FakeDevice(engine, plan.pairs), plan.bodies, plan.pairs)
    there = clearance.jax.Distances(engine, of_cpu, platform="cpu")
    np.testing.assert_allclose(
        np.asarray(got), jax.grad(lambda x: there(x).sum())(jnp.asarray(poses())), rtol=0, atol=1e-12
    )
