"""Device queries of a daemon: accepted arguments, copies and rejections, with fakes of the daemon's plan and the CUDA
driver; and with a GPU compared with the CPU, through a daemon."""

from __future__ import annotations

import ctypes
import gc
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clearance
import test_device_plan
from clearance._device.cuda_driver import Driver, _load
from clearance._device.remote_plan import RemotePlan
from clearance._words import COLUMNS
from patience import PATIENCE_S, wait_until
from robots import ARM_YAML, rows_of
from test_device_plan import ARM_PAIRS, OnDevice, needs_gpu

K, M, P = 3, 4, 2
POSES_AT, POSITIONS_AT, LOWER_AT, STATUS_AT = 0, 1024, 2048, 2560
LOWER, STATUS = (1 << COLUMNS[name].bit for name in ("lower", "status"))


class FakeDriver:
    """Host memory in place of a GPU's."""

    number = 2

    def __init__(self) -> None:
        self.memory = np.zeros(4096, np.uint8)
        self.waits: list[Any] = []
        self.copies: list[tuple[int, int, int, bool]] = []
        self.said: list[Any] = []  # with the plan, in order

    def __call__(self, uuid: bytes) -> FakeDriver:
        assert uuid == b"u" * 16
        return self

    def open(self, handle: bytes) -> int:
        assert handle == b"h" * 64
        self.said.append("open")
        return self.memory.ctypes.data

    def close(self, address: int) -> None:
        assert address == self.memory.ctypes.data
        self.said.append("unmap")

    def copy(self, to: int, source: int, size: int, from_host: bool = False) -> None:
        self.copies.append((to, source, size, from_host))
        ctypes.memmove(to, source, size)

    def wait(self, stream: Any) -> None:
        self.waits.append(stream)


class FakePlan:
    """Replaces the extension module's plan: computes rows from the contents of the memory when it is run."""

    def __init__(self, driver: FakeDriver, joints: int = 0):
        self.driver, self.joints = driver, joints
        self.runs: list[tuple[Any, bool]] = []
        columns = [(LOWER, 8, LOWER_AT), (STATUS, 1, STATUS_AT)]
        self.info = (b"h" * 64, b"u" * 16, 4096, POSES_AT, POSITIONS_AT, K, P, columns, 7, 8)

    def run(self, timeout_s: Any, check_scene: bool) -> tuple[int, int]:
        self.runs.append((timeout_s, check_scene))
        memory = self.driver.memory
        poses = memory[POSES_AT : POSES_AT + K * M * 56].view("<f8").reshape(K, M, 7)
        positions = memory[POSITIONS_AT : POSITIONS_AT + K * self.joints * 8].view("<f8")
        memory[LOWER_AT : LOWER_AT + K * P * 8].view("<f8")[:] = poses[:, :P, 0].ravel() + positions.sum()
        return 9, 1000

    def close(self) -> None:
        self.driver.said.append("close")


@pytest.fixture()
def driver() -> FakeDriver:
    return FakeDriver()


@pytest.fixture()
def run(driver: FakeDriver) -> FakePlan:
    return FakePlan(driver)


@pytest.fixture()
def plan(driver: FakeDriver, run: FakePlan) -> RemotePlan:
    return RemotePlan(run, np.arange(M, dtype=np.uint32), np.array([[1, 2], [4, 9]]), None, False, driver)


def some_poses(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((K, M, 7))


def seen(array: Any) -> np.ndarray:
    """The contents of a DeviceArray's memory."""
    interface = array.__cuda_array_interface__
    count = int(np.prod(interface["shape"])) * np.dtype(interface["typestr"]).itemsize
    raw = (ctypes.c_uint8 * count).from_address(interface["data"][0])
    return np.frombuffer(raw, interface["typestr"]).reshape(interface["shape"]).copy()


def test_poses_of_numpy_are_copied_and_rows_are_the_plans(plan: RemotePlan, run: FakePlan) -> None:
    assert plan.shape == (K, P) and plan.fields == ("lower", "status") and plan.device == 2
    assert (plan.scene_revision, plan.snapshot_revision) == (7, 8)
    for seed in (1, 2):
        poses = some_poses(seed)
        rows = plan(poses)
        np.testing.assert_array_equal(seen(rows.lower), poses[:, :P, 0])
    assert rows.status.shape == (K, P) and rows.status.dtype == np.uint8
    assert run.runs == [(None, True)] * 2
    with pytest.raises(AttributeError, match=r"no column 'uper'|did you mean"):
        _ = rows.lowr


def test_poses_on_the_gpu_are_copied_there_unless_they_are_the_plans(plan: RemotePlan, driver: FakeDriver) -> None:
    poses = some_poses(3)
    on_device = OnDevice(poses.ctypes.data, poses.shape, "<f8")
    rows = plan(on_device, stream=77)
    np.testing.assert_array_equal(seen(rows.lower), poses[:, :P, 0])
    assert driver.waits == [77], "before they are read"
    assert [copy[2:] for copy in driver.copies] == [(K * M * 56, False)]
    driver.copies.clear()
    plan(plan.poses)
    plan()
    assert driver.copies == [] and driver.waits[1:] == [None, None]


def test_rows_go_to_arrays_of_the_callers(plan: RemotePlan, driver: FakeDriver) -> None:
    lower = np.zeros((K, P))
    out = {"lower": OnDevice(lower.ctypes.data, lower.shape, "<f8")}
    poses = some_poses(4)
    rows = plan(poses, out=out)
    assert rows.lower is out["lower"] and not hasattr(rows, "status")
    np.testing.assert_array_equal(lower, poses[:, :P, 0])


def test_positions_and_options_of_a_run(driver: FakeDriver) -> None:
    run = FakePlan(driver, joints=5)
    plan = RemotePlan(run, None, np.array([[1, 2], [4, 9]]), np.arange(5, dtype=np.uint32), True, driver)
    assert plan.shape == (K,) and plan.poses is None and plan.positions is not None
    positions = np.random.default_rng(1).random((K, 5))
    plan(positions=positions, timeout_s=3, check_scene=False)
    np.testing.assert_array_equal(seen(plan.positions), positions)
    assert run.runs == [(3, False)]
    with pytest.raises(ValueError, match="poses: the plan has no bodies that they move"):
        plan(some_poses(1), positions=positions)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"poses": np.zeros((K, M, 7), np.float32)}, TypeError, "poses: expected float64, got float32"),
        ({"poses": np.zeros((M, K, 7))}, ValueError, r"poses: expected shape \(3, 4, 7\), got \(4, 3, 7\)"),
        ({"poses": [1, 2]}, TypeError, r"poses: expected an array in a GPU's memory .*got list"),
        ({"poses": OnDevice(64, (K, M, 7), "<f4")}, TypeError, "poses: expected float64, got float32"),
        ({"positions": np.zeros((K, 5))}, ValueError, "positions: the plan has no joints that they move"),
        ({"out": {"uper": 1}}, ValueError, "out: the plan has no column 'uper'"),
        ({"out": {"lower": np.zeros((K, P))}}, TypeError, r"out\['lower'\]: expected an array in a GPU's memory"),
        ({"out": [1]}, TypeError, "out: expected a dict of arrays, got list"),
        ({"stream": "0"}, TypeError, "stream: expected the address"),
    ],
)
def test_what_is_refused(
    plan: RemotePlan,
    run: FakePlan,
    driver: FakeDriver,
    arguments: dict[str, Any],
    error: type[Exception],
    text: str,
) -> None:
    with pytest.raises(error, match=text):
        plan(**arguments)
    assert run.runs == [] and driver.copies == [], "before anything was done"
    with pytest.raises(TypeError, match="answers in its own memory"):
        plan.run_at(1, 0, {}, 0)


def test_a_closed_plan_is_unmapped_first(plan: RemotePlan, driver: FakeDriver) -> None:
    with plan:
        plan(some_poses(1))
    assert driver.said == ["open", "unmap", "close"]
    plan.close()
    assert driver.said == ["open", "unmap", "close"]
    with pytest.raises(ValueError, match="this plan is closed"):
        plan()


def test_rows_keep_the_memory_mapped(driver: FakeDriver) -> None:
    plan = RemotePlan(FakePlan(driver), np.arange(M), np.array([[1, 2], [4, 9]]), None, False, driver)
    rows = plan(some_poses(1))
    lower = rows.lower
    del plan, rows
    gc.collect()
    assert driver.said == ["open"]
    del lower
    gc.collect()
    assert driver.said == ["open", "unmap"], "and the plan goes with the last who held it"


class NoSuchDevice:
    """A driver with one device, of another UUID; cuDeviceGet fails on request."""

    def __init__(self, fails: str = ""):
        self.fails = fails

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any) -> int:
            if name == "cuGetErrorString":
                arguments[1]._obj.value = b"planted"
            if name == "cuDeviceGetCount":
                arguments[0]._obj.value = 1
            return 100 if name == self.fails else 0

        call.argtypes = None  # type: ignore[attr-defined]
        self.__dict__[name] = call
        return call


def test_a_gpu_that_this_process_does_not_see() -> None:
    with pytest.raises(clearance.ConnectionError, match=r"on the GPU 7575.* which is none of the 1 that this process"):
        Driver(NoSuchDevice(), b"u" * 16)
    with pytest.raises(clearance.ConnectionError, match=r"CUDA: cuInit: planted \(100\)"):
        Driver(NoSuchDevice("cuInit"), b"u" * 16)


def test_without_a_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("clearance._device.cuda_driver._LIBRARIES", ("libno-such-driver.so.1",))
    with pytest.raises(
        clearance.ConnectionError, match=r"the CUDA driver.* cannot be loaded: libno-such-driver\.so\.1"
    ):
        _load()


@pytest.mark.skipif("cuda" in clearance.Engine.backends(), reason="the daemon has a GPU")
def test_a_daemon_without_a_gpu_says_so(daemon: Any, kind: str) -> None:
    client = clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S)
    is_local = kind in ("shm", "ipc")
    why = "the engine has no device" if is_local else "over shm:// and ipc://; this client is not one of them"
    with pytest.raises(clearance.QueryError, match=f"a plan on a device: .*{why}"):
        client.prepare("distances").on_device(4)
    with pytest.raises(ValueError, match="configurations: expected 1 or more, since bodies or joints move"):
        client.prepare("distances", bodies=[0]).on_device(0)
    assert client.stats()["plans.open"] == 0
    client.distances()


@needs_gpu
def test_rows_of_a_daemons_gpu(urdf: str, tmp_path: Path, start_daemon: Any) -> None:
    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML)
    daemon = start_daemon(tmp_path / "scene.yaml", ["shm", "ipc"], "--backend", "cuda")
    cpu = clearance.Engine(clearance.Scene.load(tmp_path / "scene.yaml"), backend="cpu", covers="off")
    positions = rows_of(cpu.joints("arm"), 200)
    device = test_device_plan.Driver()
    given = device.put(positions)
    columns = ["distance", "lower", "upper", "status", "gradient_joints"]
    for url in daemon.urls.values():
        client = clearance.connect(url, timeout_s=PATIENCE_S)
        for reduce in ("none", "min"):
            query = client.prepare("distances", pairs=ARM_PAIRS, fields=columns, joints="arm", reduce=reduce)
            with query.on_device(len(positions)) as plan:
                expected = cpu.distances(
                    ARM_PAIRS, joints="arm", configurations=positions, reduce=reduce, fields=columns
                )
                for array in (given, positions):
                    rows = plan(positions=array)
                    got = {name: device.get(getattr(rows, name)) for name in columns}
                    apart = (expected.lower > 0) & (got["lower"] > 0)  # the CPU completes some overlapping pairs
                    assert apart.mean() > 0.7
                    for name in columns:
                        np.testing.assert_array_equal(got[name][apart], getattr(expected, name)[apart], err_msg=name)
        wait_until(lambda c=client: c.stats()["plans.open"] == 0)  # freed by a thread of its own


@needs_gpu
def test_pytorch_asks_a_daemons_gpu(urdf: str, tmp_path: Path, start_daemon: Any) -> None:
    torch = pytest.importorskip("torch")
    import clearance.torch

    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML)
    daemon = start_daemon(tmp_path / "scene.yaml", ["shm"], "--backend", "cuda")
    engine = clearance.Engine(clearance.Scene.load(tmp_path / "scene.yaml"), backend="cuda", covers="off")
    client = clearance.connect(daemon.urls["shm"], timeout_s=PATIENCE_S)
    numbers = rows_of(engine.joints("arm"), 64)
    arguments = {"pairs": ARM_PAIRS, "fields": ["distance", "gradient_joints"], "joints": "arm"}
    for reduce in ("none", "min"):
        of_engine, of_client = (one.prepare("distances", reduce=reduce, **arguments) for one in (engine, client))
        with of_client.on_device(64) as theirs:
            of_plan = []
            for plan in (of_engine.on_device(64), theirs):
                positions = torch.tensor(numbers, device="cuda", requires_grad=True)
                distances = clearance.torch.JointDistances(plan)(positions)
                (0.4 - distances).clamp(min=0).sum().backward()
                of_plan.append([tensor.detach().cpu().numpy() for tensor in (distances, positions.grad)])
            assert np.abs(of_plan[0][1]).max() > 0.01
            for ours, got in zip(*of_plan):
                np.testing.assert_array_equal(got, ours)
