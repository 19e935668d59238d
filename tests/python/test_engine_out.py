"""Columns provided by the caller (out=)."""

import numpy as np
import pytest

from scenes import IDENTITY, at, same


def empty_columns(shape, names=("lower", "upper", "status", "point_a", "gradient")):
    from clearance._words import COLUMNS

    return {name: np.empty(shape + COLUMNS[name].shape, COLUMNS[name].dtype) for name in names}


def test_out_dict_is_written_in_place(engine):
    out = empty_columns((1, 7))
    addresses = {name: array.ctypes.data for name, array in out.items()}
    r = engine.distances(out=out)
    assert r.lower is out["lower"] and r.gradient is out["gradient"]
    assert {name: array.ctypes.data for name, array in r.columns.items()} == addresses
    assert same(r, engine.distances(fields=list(out)))
    assert same(engine.distances(out=out, fields=("gradient", "lower", "upper", "status", "point_a")), r)


def test_out_result_is_written_over(engine):
    first = engine.distances(fields=("lower", "status"))
    lower, address = first.lower, first.lower.ctypes.data
    before = lower.copy()
    engine.set_poses({"link2": at(0.9, 0, 0.9)})
    second = engine.distances(out=first)
    assert second.lower.ctypes.data == address and list(second.columns) == ["lower", "status"]
    assert not np.array_equal(lower, before), "the old arrays show the new answer"
    assert same(second, engine.distances(fields=("lower", "status")))
    third = engine.distances(out=second)
    assert third.lower.ctypes.data == address


def test_out_within_needs_room_and_shows_what_was_found(crowd):
    engine, _ = crowd
    expected = engine.distances(reduce="within", max_distance=0.4)
    assert 0 < expected.total < 400
    out = empty_columns((400,), ("lower", "pair", "configuration"))
    r = engine.distances(reduce="within", max_distance=0.4, max_results=400, out=out)
    assert r.lower.shape == (expected.total,) and r.lower.base is out["lower"]
    assert r.pairs.tolist() == expected.pairs.tolist()
    again = engine.distances(reduce="within", max_distance=0.2, max_results=400, out=r)
    assert again.lower.ctypes.data == out["lower"].ctypes.data and again.total < r.total
    own = engine.distances(reduce="within", max_distance=0.2, max_results=400)
    wider = engine.distances(reduce="within", max_distance=0.4, max_results=400, out=own)
    assert wider.total == expected.total > own.total, "room that the first answer did not need is used"
    lower_only = engine.distances(
        reduce="within", max_distance=0.4, max_results=400, out=empty_columns((400,), ("lower",))
    )
    assert lower_only.pairs.tolist() == expected.pairs.tolist(), "pairs come anyway"


@pytest.mark.parametrize("out, error, text", [
    ([], TypeError, r"out: expected a dict of arrays or an earlier result, got list"),
    ({"lwer": np.empty((1, 7))}, ValueError, r"out: no column is named 'lwer'"),
    ({"lower": [0.0] * 7}, TypeError, r"out\['lower'\]: expected a numpy array, got list"),
    ({"lower": np.empty((1, 7), np.float32)}, TypeError, r"out\['lower'\]: expected dtype float64, got float32"),
    ({"status": np.empty((1, 7), np.int8)}, TypeError, r"out\['status'\]: expected dtype uint8, got int8"),
    ({"lower": np.empty((1, 6))}, ValueError, r"out\['lower'\]: expected shape \(1, 7\), got \(1, 6\)"),
    ({"lower": np.empty(7)}, ValueError, r"out\['lower'\]: expected shape \(1, 7\), got \(7,\)"),
    ({"point_a": np.empty((1, 7))}, ValueError, r"out\['point_a'\]: expected shape \(1, 7, 3\), got \(1, 7\)"),
    ({"gradient": np.empty((1, 7, 12))}, ValueError,
     r"out\['gradient'\]: expected shape \(1, 7, 2, 6\), got \(1, 7, 12\)"),
    ({"lower": np.empty((1, 14))[:, ::2]}, ValueError, r"out\['lower'\]: expected a C-contiguous, aligned array"),
    ({"lower": np.broadcast_to(0.0, (1, 7))}, ValueError,
     r"out\['lower'\]: (expected a C-contiguous|the array is read-only)"),
    ({}, ValueError, r"fields: expected at least one column"),
])  # fmt: skip
def test_bad_out(engine, out, error, text):
    with pytest.raises(error, match=text):
        engine.distances(out=out)


def test_read_only_out_and_disagreement_with_fields(engine):
    array = np.zeros((1, 7))
    array.flags.writeable = False
    with pytest.raises(ValueError, match=r"out\['lower'\]: the array is read-only"):
        engine.distances(out={"lower": array})
    with pytest.raises(ValueError, match=r"out: no array for the column 'upper', which fields names"):
        engine.distances(out={"lower": np.zeros((1, 7))}, fields=("lower", "upper"))
    with pytest.raises(ValueError, match=r"out: holds 'lower', which fields does not name"):
        engine.distances(out={"lower": np.zeros((1, 7)), "upper": np.zeros((1, 7))}, fields="upper")
    both = np.zeros((2, 1, 7))
    engine.distances(out={"lower": both[0], "upper": both[1]})
    with pytest.raises(ValueError, match=r"out\['lower'\] and out\['upper'\] share memory"):
        engine.distances(out={"lower": both[0], "upper": both[0]})
    with pytest.raises(ValueError, match=r"copy: out= is a copy"):
        engine.distances(out={"lower": np.zeros((1, 7))}, copy=False)
    with pytest.raises(ValueError, match=r"expected shape \(40,\) or more rows, got \(39,\)"):
        engine.distances(out={"lower": np.zeros(39)}, reduce="within", max_distance=9, configurations=np.tile(
            IDENTITY, (9, 3, 1)), max_results=40)  # fmt: skip


def test_memory_of_answers_that_are_gone_is_used_again(engine):
    poses = np.tile(np.array(at(0.3, 0, 0.3)), (4000, 1, 1))

    def evaluate():
        return engine.distances(configurations=poses, bodies=["link2"], fields="default")

    kept = evaluate()
    first, address = kept.lower.copy(), kept.lower.ctypes.data
    assert kept.lower.nbytes * 3 > 128 << 10, "small answers are the heap's business"
    engine.set_poses({"base": at(0, 0.1, 0)})
    assert evaluate().lower.ctypes.data != address, "an answer in use keeps its memory"
    view = kept.lower[1:]
    del kept
    assert evaluate().lower.ctypes.data != address, "so do views of its columns"
    assert np.array_equal(view, first[1:])
    del view
    assert evaluate().lower.ctypes.data == address
