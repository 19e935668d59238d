"""clearance.wire is wire/protocol.h: sizes, offsets, numbers."""

import re

import numpy as np
import pytest

from clearance import _client, wire
from clearance._words import COLUMNS

LAYOUT = _client.wire_layout()


def test_every_struct_is_mirrored(root):
    header = (root / "wire" / "protocol.h").read_text()
    structs = set(re.findall(r"^struct (\w+) {", header, re.M))
    assert len(structs) >= 15
    assert set(wire.RECORDS) == structs == set(LAYOUT)


@pytest.mark.parametrize("name", sorted(LAYOUT))
def test_sizes_and_offsets(name):
    size, members = LAYOUT[name]
    record = wire.RECORDS[name]
    assert record.itemsize == size
    ours = {field: (offset, dtype.itemsize) for field, (dtype, offset, *_) in record.fields.items()}
    assert ours == members
    assert sum(n for _, n in members.values()) == size, "every byte is named"


@pytest.mark.parametrize("name", ["FrameType", "ErrorCode"])
def test_enums(root, name):
    header = (root / "wire" / "protocol.h").read_text()
    body = re.sub(r"//.*", "", re.search(rf"enum class {name} : [\w:]+ {{(.*?)}};", header, re.S).group(1))
    values = {}
    for key, value in re.findall(r"k(\w+)\s*=\s*(\w+)", body):
        values[re.sub(r"(?<=[a-z])(?=[A-Z])", "_", key).upper()] = int(value, 0)
    assert len(values) >= 9
    assert {member.name: int(member) for member in getattr(wire, name)} == values


def test_constants(root):
    header = (root / "wire" / "protocol.h").read_text() + (root / "wire" / "types.h").read_text()

    def constant(name):
        text = re.search(rf"{name} = ([^;]+);", header).group(1)
        return eval(re.sub(r"std::uint64_t\{(\d+)\}", r"\1", text))

    assert wire.MAGIC == constant("kMagic")
    assert wire.VERSION == constant("kVersion")
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
