"""clearance.wire equals the headers of the wire, and docs/service/wire_queries.md has the table of options."""

import re

import numpy as np
import pytest

from clearance import _client, wire
from clearance._words import COLUMNS


def _structs(root):
    return "".join((root / "wire" / name).read_text() for name in ("protocol.h", "payloads.h"))


def test_every_struct_is_a_dtype(root):
    header = _structs(root)
    structs = set(re.findall(r"^struct (\w+) {", header, re.M))
    assert len(structs) >= 15
    assert set(wire.RECORDS) == structs
    sizes = dict(re.findall(r"^CLEARANCE_WIRE\((\w+), (\d+)\)", header, re.M))
    assert {name: record.itemsize for name, record in wire.RECORDS.items()} == {
        n: int(size) for n, size in sizes.items()
    }


def test_dtypes_have_the_members_types_and_places_of_the_structs(root):
    header = _structs(root)
    kinds = {
        "double": "f8",
        "char": "S",
        **{f"std::{s}int{n}_t": f"{s or 'i'}{n // 8}" for s in ("", "u") for n in (8, 16, 32, 64)},
    }
    seen = 0
    for struct, body in re.findall(r"^struct (\w+) {\n(.*?)^};", header, re.M | re.S):
        offset = 0
        lines = re.sub(
            r"^  (\S+) (\w+ = \w+), (\w+ = \w+);", r"  \1 \2;\n  \1 \3;", re.sub(r"//.*", "", body), flags=re.M
        )
        members = re.findall(r"^  (\S+)\s+(\w+)(?:\[(\d+)\])?\s*=", lines, re.M)
        assert tuple(name for _, name, _ in members) == wire.RECORDS[struct].names
        for kind, name, count in members:
            dtype, at = wire.RECORDS[struct].fields[name][:2]
            expected = np.dtype(f"S{count}" if kind == "char" else (kinds[kind], int(count)) if count else kinds[kind])
            assert (at, dtype.itemsize, dtype.base) == (offset, expected.itemsize, expected.base), f"{struct}.{name}"
            offset += dtype.itemsize
            seen += 1
    assert seen > 100


def test_a_name_that_is_no_struct():
    with pytest.raises(AttributeError, match="no attribute 'QueryFooter'"):
        wire.QueryFooter


def test_the_page_has_every_option(root):
    rows = []
    for name, (tag, kind, default, words, unit, text, *_) in _client.OPTIONS.items():
        takes = words if kind == "word" else f"{kind}, {unit}" if unit else kind
        value = words.split()[default] if kind == "word" else str(default).lower()
        rows.append(f"| `{name}` | {f'record {tag}' if tag else 'header'} | {takes} | {value} | {text} |")
    page, table = "docs/service/wire_queries.md", "\n".join(rows)
    assert table in (root / page).read_text(), f"{page} should have:\n{table}"


def test_records_of_a_frame():
    record = wire.record(1, np.uint64(7).tobytes()) + wire.record(500, b"abc", required=False)
    frame = wire.frame(wire.FrameType.QUERY, wire.query_header().tobytes(), 5, records=record)
    header = np.frombuffer(frame, wire.FrameHeader, 1)[0]
    assert (header["version"], header["payload_bytes"], header["records_bytes"]) == (1, 128 + 32, 32)
    assert frame[-32:] == bytes.fromhex("0100010008000000 0700000000000000 f401000003000000 6162630000000000")


@pytest.mark.parametrize("name", ["FrameType", "ErrorCode", "ReplyRecord", "QueryRecord", "UpdateRecord"])
def test_enums(root, name):
    header = (root / "wire" / "protocol.h").read_text()
    body = re.sub(r"//.*", "", re.search(rf"enum class {name} : [\w:]+ {{(.*?)}};", header, re.S).group(1))
    values = {}
    for key, value in re.findall(r"k(\w+)\s*=\s*(\w+)", body):
        values[re.sub(r"(?<=[a-z])(?=[A-Z])", "_", key).upper()] = int(value, 0)
    assert values
    assert {member.name: int(member) for member in getattr(wire, name)} == values


def test_constants(root):
    header = (root / "wire" / "protocol.h").read_text() + (root / "wire" / "types.h").read_text()

    def constant(name):
        text = re.search(rf"{name} = ([^;]+);", header).group(1)
        return eval(re.sub(r"std::uint64_t\{(\d+)\}", r"\1", text))

    assert wire.MAGIC == constant("kMagic")
    assert wire.VERSION == constant("kVersion")
    assert wire.RECORD_REQUIRED == constant("kRecordRequired")
    assert wire.COLUMN_ALIGNMENT == constant("kColumnAlignment")
    assert wire.MAX_FRAME_BYTES == constant("kMaxFrameBytes")
    assert wire.MAX_REQUEST_BYTES == constant("kMaxRequestBytes")


def test_frame_and_query_header_hold_the_defaults_of_the_structs(root):
    frame = wire.frame(wire.FrameType.QUERY, b"abcd", request_id=9, scene_revision=3)
    header = np.frombuffer(frame, wire.FrameHeader, 1)[0]
    assert (header["magic"], header["version"], header["type"]) == (0x31524C43, 1, 3)
    assert (header["request_id"], header["payload_bytes"], header["scene_revision"]) == (9, 4, 3)
    assert frame[64:] == b"abcd"
    query = wire.query_header(reduce=2)
    assert (
        query["rel_tol"] == -1 and query["all_pairs"] == 1 and query["reduce"] == 2 and np.isinf(query["max_distance"])
    )
    with pytest.raises(ValueError):
        wire.query_header(radius=2)


def test_columns_lie_on_64_bytes():
    reply = np.zeros((), wire.ReplyHeader)
    reply["rows"] = 3
    reply["fields"] = sum(1 << COLUMNS[name].bit for name in ("distance", "status", "normal"))
    payload = bytearray(128 + 64 + 64 + 128)
    np.frombuffer(payload, "<f8", 3, 128)[:] = 1, 2, 3
    np.frombuffer(payload, "u1", 3, 192)[:] = 4, 5, 6
    np.frombuffer(payload, "<f8", 9, 256)[:] = range(9)
    columns = wire.columns(payload, reply)
    assert list(columns) == ["distance", "status", "normal"]
    assert columns["distance"].tolist() == [1, 2, 3] and columns["status"].tolist() == [4, 5, 6]
    assert columns["normal"].tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
