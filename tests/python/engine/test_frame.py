"""Results as tables: names of bodies, and DataFrames."""

import pickle
import sys
import types
from typing import Any

import numpy as np
import pytest

import clearance
from scenes import ARM_PAIRS, ARM_POSES, arm, at


class Frame(dict):
    """A fake of pandas.DataFrame."""

    def __init__(self, columns):
        super().__init__({name: np.asarray(column) for name, column in columns.items()})
        assert len({len(column) for column in self.values()}) == 1, "columns of one length"

    @property
    def columns(self):
        return list(self)


@pytest.fixture(params=["fake", "pandas"])
def pandas(request, monkeypatch):
    """pandas, and a fake of it that every machine has."""
    if request.param == "pandas":
        return pytest.importorskip("pandas")
    codes = types.SimpleNamespace(from_codes=lambda codes, labels: np.array(labels)[codes])
    module: Any = types.ModuleType("pandas")
    module.DataFrame, module.Categorical = Frame, codes
    monkeypatch.setitem(sys.modules, "pandas", module)
    return module


@pytest.fixture
def engine():
    engine = clearance.Engine(arm(), covers="off")
    engine.set_poses(ARM_POSES)
    return engine


def test_a_row_for_each_pair_and_configuration(engine, pandas):
    X = np.array([[at(0.5, 0, 0.5)], [at(0, 0.9, 0.4)], [at(0, 0, 9)]])
    fields = ("default", "point_a", "gradient", "bounds", "pieces", "flags", "pair")
    result = engine.distances(configurations=X, bodies=["cup"], fields=fields)
    frame = result.to_pandas()
    assert list(frame.columns) == [
        "configuration", "body_a", "body_b", "distance", "lower", "upper", "status", "flags", "point_a_x", "point_a_y",
        "point_a_z", "pieces_a", "pieces_b", *(f"gradient_{i}" for i in range(12)), "bounds_lower", "bounds_upper",
    ]  # fmt: skip
    pairs = len(result.pairs)
    assert np.asarray(frame["configuration"]).tolist() == np.repeat(range(3), pairs).tolist()
    names = [body.name for body in engine.bodies]
    assert list(frame["body_b"]) == [names[b] for _, b in result.pairs] * 3
    assert np.array_equal(frame["lower"], result.lower.reshape(-1))
    assert np.array_equal(frame["point_a_y"], result.point_a[..., 1].reshape(-1), equal_nan=True)
    assert np.array_equal(frame["gradient_7"], result.gradient.reshape(-1, 12)[:, 7], equal_nan=True)
    assert [clearance.Status[status] for status in frame["status"]] == result.status.reshape(-1).tolist()


@pytest.mark.parametrize("query", [
    {"reduce": "min", "fields": ("default", "pair_lower")},
    {"reduce": "nearest"},
    {"reduce": "within", "max_distance": 0.6},
    {"reduce": "any", "margin": 0.001, "fields": ("status",)},
], ids=str)  # fmt: skip
def test_reductions(engine, pandas, query):
    result = engine.distances(**query)
    again = pickle.loads(pickle.dumps(result))
    for each in (result, again):
        frame = each.to_pandas()
        pairs = each.pairs.reshape(-1, 2)
        assert len(frame["status"]) == len(pairs) > 0
        found = np.stack((frame["body_a"], frame["body_b"]), axis=1)
        assert found.tolist() == each.pair_names.reshape(-1, 2).tolist()
        assert (np.asarray(found[:, 0], dtype=object) == None).tolist() == (pairs[:, 0] == clearance.NONE).tolist()  # noqa: E711
    assert again.names == result.names == tuple(body.name for body in engine.bodies)
    if "pair_lower" in result.columns:
        assert [engine.body_id(name) for name in frame["lower_body_a"]] == result.pair_lower[:, 0].tolist()


@pytest.mark.parametrize("with_pair", [False, True])
def test_verdicts(engine, pandas, with_pair):
    result = engine.distances(reduce="any", margin=0.001, fields=["verdict", "pair"] if with_pair else "verdict")
    for each in (result, pickle.loads(pickle.dumps(result))):
        frame = each.to_pandas()
        assert list(frame.columns) == ["configuration", *(["body_a", "body_b"] if with_pair else []), "verdict"]
        assert [clearance.Status[verdict] for verdict in frame["verdict"]] == result.verdict.tolist()


def test_motions(engine, pandas):
    ends = np.array([[at(0.5, 0, 0.5)], [at(0, 0.9, 0.4)]])
    result = engine.motions(ends, ends[::-1].copy(), bodies=["cup"])
    frame = result.to_pandas()
    assert np.asarray(frame["configuration"]).tolist() == [0, 1]
    assert np.array_equal(frame["first_contact_free_until"], result.first_contact[:, 0])
    assert np.array_equal(frame["first_contact_hit"], result.first_contact[:, 1])


def test_names(engine):
    assert engine.distances().pair_names.tolist() == [
        [engine.bodies[a].name, engine.bodies[b].name] for a, b in ARM_PAIRS
    ]


@pytest.fixture(params=["fake", "pyarrow"])
def pyarrow(request, monkeypatch):
    """pyarrow, and a fake of it that every machine has."""
    if request.param == "pyarrow":
        return pytest.importorskip("pyarrow")
    module: Any = types.ModuleType("pyarrow")
    module.table = lambda columns: types.SimpleNamespace(
        column_names=list(columns), to_pydict=lambda: {name: list(column) for name, column in columns.items()}
    )
    module.DictionaryArray = types.SimpleNamespace(from_arrays=lambda codes, labels: np.array(labels)[codes])
    monkeypatch.setitem(sys.modules, "pyarrow", module)
    return module


def test_a_table_of_arrow_has_the_columns_of_pandas(engine, pyarrow):
    X = np.array([[at(0.5, 0, 0.5)], [at(0, 0.9, 0.4)]])
    result = engine.distances(configurations=X, bodies=["cup"], fields=("default", "point_a", "bounds"))
    table = result.to_arrow()
    assert table.column_names == [
        "configuration", "body_a", "body_b", "distance", "lower", "upper", "status", "point_a_x", "point_a_y",
        "point_a_z", "bounds_lower", "bounds_upper",
    ]  # fmt: skip
    columns = table.to_pydict()
    assert list(zip(columns["body_a"], columns["body_b"])) == [tuple(names) for names in result.pair_names.tolist()] * 2
    assert [clearance.Status[status] for status in columns["status"]] == result.status.reshape(-1).tolist()
    assert columns["lower"] == result.lower.reshape(-1).tolist()
    assert columns["bounds_upper"] == result.bounds[..., 1].reshape(-1).tolist()
    nearest = engine.distances(reduce="any", margin=0.001, fields=("verdict", "pair")).to_arrow().to_pydict()
    assert set(nearest) == {"configuration", "body_a", "body_b", "verdict"}


@pytest.mark.parametrize("package, method", [("pandas", "to_pandas"), ("pyarrow", "to_arrow")])
def test_packages_are_imported_by_their_calls_alone(engine, monkeypatch, package, method):
    monkeypatch.setitem(sys.modules, package, None)
    result = engine.distances()
    with pytest.raises(ImportError):
        getattr(result, method)()
