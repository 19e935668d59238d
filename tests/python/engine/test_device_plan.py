"""Device queries: accepted and rejected arguments, with a fake device, and on a GPU compared with the CPU."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clearance
from clearance import _engine
from clearance._device.plan import DeviceArray, DevicePlan
from clearance._words import COLUMNS, Field
from robots import arm_scene, rows_of

ARM = Path(__file__).resolve().parents[2] / "engine" / "robot" / "arm.urdf"
#: Those of its pairs that do not overlap at any of its positions.
ARM_PAIRS = [
    (f"arm/{link}", other)
    for link in ("fore", "wrist", "palm", "flange", "left_finger")
    for other in ("table", "cup", "arm/base")
]

MASK = int(Field.LOWER | Field.UPPER | Field.STATUS | Field.POINTS32)


class FakeDevice:
    """Replaces the extension module's plan."""

    shape = (3, 2, MASK)
    device = 0

    def __init__(self) -> None:
        self.runs: list[tuple[int, int, list[int], int]] = []

    def own_columns(self) -> list[int]:
        return [1000 * column.bit if MASK >> column.bit & 1 else 0 for column in COLUMNS.values()]

    def run(self, poses: int, positions: int, columns: list[int], stream: int) -> None:
        self.runs.append((poses, positions, columns, stream))


class OnDevice:
    """Memory that claims to be on a GPU."""

    def __init__(self, address: int, shape: tuple[int, ...], typestr: str, strides: object = None):
        self.__cuda_array_interface__ = {
            "shape": shape, "typestr": typestr, "data": (address, False), "strides": strides, "version": 3
        }  # fmt: skip


@pytest.fixture()
def run() -> FakeDevice:
    return FakeDevice()


@pytest.fixture()
def plan(run: FakeDevice) -> DevicePlan:
    bodies = np.array([1, 2, 4, 7], dtype=np.uint32)
    return DevicePlan(_engine, run, bodies, np.array([[1, 2], [4, 9]]))


POSES = OnDevice(64, (3, 4, 7), "<f8")


def test_memory_of_the_caller_goes_to_its_column(plan: DevicePlan, run: FakeDevice) -> None:
    lower, points = OnDevice(4096, (3, 2), "<f8"), OnDevice(8192, (3, 2, 2, 3), "<f4")
    rows = plan(POSES, out={"lower": lower, "points32": points}, stream=77)
    assert rows.lower is lower and rows.points32 is points
    poses, positions, columns, stream = run.runs[0]
    assert (poses, positions, stream) == (64, 0, 77)
    assert columns[COLUMNS["lower"].bit] == 4096 and columns[COLUMNS["points32"].bit] == 8192
    assert sum(map(bool, columns)) == 2
    with pytest.raises(AttributeError, match=r"no column 'uper'|no column 'upper'"):
        _ = rows.upper


def test_memory_of_the_plan_is_shown_as_arrays(plan: DevicePlan, run: FakeDevice) -> None:
    rows = plan(POSES)
    assert plan.fields == ("lower", "upper", "status", "points32")
    assert isinstance(rows.status, DeviceArray) and rows.status.dtype == np.uint8
    interface = rows.upper.__cuda_array_interface__
    assert interface["shape"] == (3, 2) and interface["data"] == (2000, False) and interface["typestr"] == "<f8"
    assert plan(POSES).upper is rows.upper, "the same each time"
    assert run.runs[0] == run.runs[1]


class Stream:
    cuda_stream = 99


@pytest.mark.parametrize(("stream", "address"), [(None, 0), (5, 5), (Stream(), 99)])
def test_streams(plan: DevicePlan, run: FakeDevice, stream: object, address: int) -> None:
    plan(POSES, stream=stream)
    assert run.runs[0][3] == address


@pytest.mark.parametrize(
    ("poses", "error", "text"),
    [
        (None, TypeError, "poses: expected an array in a GPU's memory"),
        (np.zeros((3, 4, 7)), ValueError, "poses: expected memory of CUDA device 0"),
        (OnDevice(64, (3, 4, 7), "<f4"), TypeError, "poses: expected float64, got float32"),
        (OnDevice(64, (4, 3, 7), "<f8"), ValueError, r"poses: expected shape \(3, 4, 7\), got \(4, 3, 7\)"),
        (OnDevice(64, (3, 4, 7), "<f8", (8, 24, 96)), ValueError, r"poses: expected C order, got strides"),
    ],
)
def test_poses_that_are_refused(plan: DevicePlan, poses: object, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        plan(poses)


@pytest.mark.parametrize(
    ("out", "error", "text"),
    [
        ({"uper": OnDevice(64, (3, 2), "<f8")}, ValueError, "out: the plan has no column 'uper'; did you mean 'upper'"),
        ({"upper": OnDevice(64, (3, 2), "<f4")}, TypeError, r"out\['upper'\]: expected float64, got float32"),
        ({"upper": OnDevice(64, (2, 3), "<f8")}, ValueError, r"out\['upper'\]: expected shape \(3, 2\)"),
        ([1], TypeError, "out: expected a dict of arrays, got list"),
    ],
)
def test_columns_that_are_refused(plan: DevicePlan, out: object, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        plan(POSES, out=out)


def test_a_stream_that_is_none(plan: DevicePlan) -> None:
    with pytest.raises(TypeError, match="stream: expected the address"):
        plan(POSES, stream="0")


def test_a_plan_of_the_current_poses_takes_none(run: FakeDevice) -> None:
    plan = DevicePlan(_engine, run, None, np.array([[1, 2], [4, 9]]))
    plan()
    assert run.runs[0][:2] == (0, 0)
    with pytest.raises(ValueError, match="poses: the plan has no bodies"):
        plan(POSES)


@pytest.mark.parametrize("reduced", [False, True])
def test_positions_of_joints(run: FakeDevice, reduced: bool) -> None:
    run.shape = (3, 2, MASK | int(Field.GRADIENT_JOINTS))
    joints = np.arange(7, dtype=np.uint32)
    plan = DevicePlan(_engine, run, None, np.array([[1, 2], [4, 9]]), joints, reduced=reduced)
    lead = (3,) if reduced else (3, 2)
    assert plan.shape == lead
    positions, lower = OnDevice(128, (3, 7), "<f8"), OnDevice(4096, lead, "<f8")
    gradient = OnDevice(8192, (*lead, 7), "<f8")
    plan(positions=positions, out={"lower": lower, "gradient_joints": gradient})
    assert run.runs[0][:2] == (0, 128)
    assert run.runs[0][2][COLUMNS["gradient_joints"].bit] == 8192
    assert plan(positions=positions).gradient_joints.shape == (*lead, 7)
    with pytest.raises(TypeError, match="positions: expected an array in a GPU's memory"):
        plan()
    with pytest.raises(ValueError, match=r"positions: expected shape \(3, 7\), got \(3, 6\)"):
        plan(positions=OnDevice(128, (3, 6), "<f8"))
    with pytest.raises(ValueError, match="poses: the plan has no bodies"):
        plan(POSES, positions=positions)
    with pytest.raises(ValueError, match=r"out\['gradient_joints'\]: expected shape"):
        plan(positions=positions, out={"gradient_joints": lower})


def test_positions_for_a_plan_without_joints(plan: DevicePlan) -> None:
    with pytest.raises(ValueError, match="positions: the plan has no joints"):
        plan(POSES, positions=OnDevice(128, (3, 7), "<f8"))


def balls() -> clearance.Scene:
    scene = clearance.Scene()
    for i in range(6):
        scene.add_sphere(f"s{i}", 0.2 + 0.02 * i, pose=[i, 0.1 * i, 0, 1, 0, 0, 0])
    return scene


def test_without_a_gpu_it_says_so() -> None:
    engine = clearance.Engine(balls(), backend="cpu")
    with pytest.raises(clearance.QueryError, match="the engine has no device"):
        engine.prepare("distances").on_device(0)
    with pytest.raises(clearance.QueryError, match="the engine has no device"):
        engine.prepare("distances", reduce="any", margin=0.1).on_device(4)
    with pytest.raises(ValueError, match="configurations: expected 1 or more, since bodies or joints move"):
        engine.prepare("distances", bodies=["s1"]).on_device(0)
    with pytest.raises(ValueError, match="configurations: expected an integer >= 0, got -1"):
        engine.prepare("distances").on_device(-1)


needs_gpu = pytest.mark.skipif("cuda" not in clearance.Engine.backends(), reason="no CUDA device")


class Driver:
    """GPU memory from its driver alone, in the engine's context."""

    def __init__(self) -> None:
        self._cuda = ctypes.CDLL("libcuda.so.1")
        device, context = ctypes.c_int(), ctypes.c_void_p()
        self._call("cuInit", 0)
        self._call("cuDeviceGet", ctypes.byref(device), 0)
        self._call("cuDevicePrimaryCtxRetain", ctypes.byref(context), device)
        self._call("cuCtxSetCurrent", context)

    def _call(self, name: str, *arguments: Any) -> None:
        assert getattr(self._cuda, name)(*arguments) == 0, name

    def put(self, array: np.ndarray) -> OnDevice:
        address = ctypes.c_uint64()
        self._call("cuMemAlloc_v2", ctypes.byref(address), ctypes.c_size_t(array.nbytes))
        self._call("cuMemcpyHtoD_v2", address, ctypes.c_void_p(array.ctypes.data), ctypes.c_size_t(array.nbytes))
        return OnDevice(address.value, array.shape, array.dtype.str)

    def get(self, column: Any) -> np.ndarray:
        interface = column.__cuda_array_interface__
        array = np.empty(interface["shape"], np.dtype(interface["typestr"]))
        self._call("cuCtxSynchronize")
        address = ctypes.c_uint64(interface["data"][0])
        self._call("cuMemcpyDtoH_v2", ctypes.c_void_p(array.ctypes.data), address, ctypes.c_size_t(array.nbytes))
        return array


@needs_gpu
def test_positions_of_a_robot_on_the_gpu() -> None:
    engine, cpu = clearance.Engine(arm_scene(ARM), backend="cuda"), clearance.Engine(arm_scene(ARM), backend="cpu")
    positions = rows_of(engine.joints("arm"), 200)
    driver = Driver()
    given = driver.put(positions)
    columns = ["distance", "lower", "upper", "status", "gradient_joints"]
    for reduce in ("none", "min"):
        query = engine.prepare("distances", pairs=ARM_PAIRS, fields=columns, joints="arm", reduce=reduce)
        plan = query.on_device(len(positions))
        rows = plan(positions=given)
        expected = cpu.distances(ARM_PAIRS, joints="arm", configurations=positions, reduce=reduce, fields=columns)
        got = {name: driver.get(getattr(rows, name)) for name in columns}
        assert got["lower"].shape == plan.shape == expected.lower.shape
        assert got["gradient_joints"].shape == expected.gradient_joints.shape
        apart = (expected.lower > 0) & (got["lower"] > 0)  # the CPU completes some overlapping pairs
        assert apart.mean() > 0.7
        for name in columns:
            np.testing.assert_array_equal(got[name][apart], getattr(expected, name)[apart], err_msg=name)
    query = engine.prepare("distances", pairs=ARM_PAIRS, joints="arm", reduce="any", margin=0.01)
    free = query.on_device(len(positions))
    assert set(free.fields) == {"status", "pair"} and free.shape == (len(positions),)
    status = driver.get(free(positions=given).status)
    checked = cpu.check(positions, pairs=ARM_PAIRS, joints="arm", margin=0.01)
    is_free, is_open = status == clearance.Status.BEYOND, status == clearance.Status.UNCONVERGED
    assert 100 < checked.free.sum() < 190 and is_open.sum() < 20
    np.testing.assert_array_equal(is_free[~is_open], checked.free[~is_open])
    assert not is_free[~checked.free].any()


@needs_gpu
def test_gradients_by_joints_in_pytorch_never_leave_the_device() -> None:
    torch = pytest.importorskip("torch")
    import clearance.torch

    engine, cpu = clearance.Engine(arm_scene(ARM), backend="cuda"), clearance.Engine(arm_scene(ARM), backend="cpu")
    numbers, fields = rows_of(engine.joints("arm"), 64), ["distance", "gradient_joints"]
    for reduce in ("none", "min"):
        requested = {"pairs": ARM_PAIRS, "joints": "arm", "reduce": reduce, "fields": fields, "max_distance": 0.5}
        distances = clearance.torch.JointDistances(engine.prepare("distances", **requested).on_device(64))
        positions = torch.tensor(numbers, device="cuda", requires_grad=True)
        (0.4 - distances(positions)).clamp(min=0).sum().backward()
        expected = cpu.distances(configurations=numbers, **requested)
        near = (expected.distance < 0.4)[..., None]
        slope = -np.where(near, np.nan_to_num(expected.gradient_joints), 0)
        slope = slope.reshape(64, -1, slope.shape[-1]).sum(axis=1)  # of all pairs
        apart = expected.distance.reshape(64, -1).min(axis=1) > 0
        assert apart.sum() > 40 and np.abs(slope[apart]).max() > 0.01
        np.testing.assert_allclose(positions.grad.cpu().numpy()[apart], slope[apart], atol=1e-9)


@needs_gpu
def test_a_loop_in_pytorch_never_leaves_the_device() -> None:
    torch = pytest.importorskip("torch")
    import clearance.torch

    engine = clearance.Engine(balls(), backend="cuda")
    cpu = clearance.Engine(balls(), backend="cpu")
    bodies = ["s1", "s4"]
    query = engine.prepare("distances", bodies=bodies, fields=["distance", "lower", "upper", "gradient"])
    plan = query.on_device(32)
    rng = np.random.default_rng(3)
    numbers = rng.normal(size=(32, 2, 7)) * [2, 2, 2, 1, 1, 1, 1]
    poses = torch.tensor(numbers, device="cuda", requires_grad=True)
    rows = plan(poses.detach(), stream=torch.cuda.current_stream())
    torch.cuda.synchronize()
    expected = cpu.distances(configurations=numbers, bodies=bodies, fields=["lower", "upper"])
    settled = torch.as_tensor(rows.upper, device="cuda").cpu().numpy() > 0
    assert settled.any()
    for name in ("lower", "upper"):
        got = torch.as_tensor(getattr(rows, name), device="cuda").cpu().numpy()
        np.testing.assert_array_equal(got[settled], getattr(expected, name)[settled])

    distances = clearance.torch.Distances(engine, plan)
    weights = torch.tensor(rng.uniform(0.5, 2, size=plan.shape), device="cuda")
    (distances(poses) * weights).sum().backward()
    step, got = 1e-6, poses.grad.cpu().numpy()
    apart = (expected.lower > 1e-3).all(axis=1)
    assert apart.sum() > 5
    for m in range(2):
        for i in range(7):
            moved = [numbers.copy(), numbers.copy()]
            moved[0][:, m, i] -= step
            moved[1][:, m, i] += step
            ends = [cpu.distances(configurations=x, bodies=bodies, rel_tol=1e-12).distance for x in moved]
            slope = ((ends[1] - ends[0]) * weights.cpu().numpy()).sum(axis=1) / (2 * step)
            np.testing.assert_allclose(got[apart, m, i], slope[apart], atol=1e-5)
