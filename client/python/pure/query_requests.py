"""Queries as frames, and the sizes of their replies."""

from __future__ import annotations

import struct
from typing import Any, Optional

import numpy as np

from .. import wire
from .._words import COLUMNS, GROUP_BIT, Field, Reduce
from ..wire import MAX_FRAME_BYTES, FrameType, QueryRecord
from .answers import column_shape
from .frames import malformed, record
from .scenes import SceneRequests

#: struct format of an option in a record, by kind and size in bytes.
_OPTION_FORMATS = {
    ("bool", 1): "<B", ("word", 1): "<B", ("number", 8): "<d", ("integer", 8): "<q", ("count", 8): "<Q",
    ("count", 4): "<I",
}  # fmt: skip


#: Array records of a query, in the order of their tags, which are above those of options.
_ARRAY_TAGS = {record.name.lower(): record for record in QueryRecord if record != QueryRecord.ROWS}
#: Upper bound on the size of a reply about a plan.
_PLAN_BYTES = 1024
_NO_PAIRS = np.zeros((0, 2), np.uint32)


class QueryRequests(SceneRequests):
    """Requests for queries, their pairs, certificates and plans."""

    def send_query(
        self,
        query: Any,
        poses: Optional[np.ndarray] = None,
        positions: Optional[np.ndarray] = None,
        type: FrameType = FrameType.QUERY,
        count: Optional[int] = None,
        rows: Optional[np.ndarray] = None,
    ) -> int:
        """Sends a query. count: number of configurations; by default those that are given."""
        self.check_scene(query.scene_revision)
        requested = query.__dict__
        revision = self._revision_of_ids()
        pairs, bodies = query.pairs, query.bodies
        configurations = poses if poses is not None else positions
        header = wire.query_header(
            pair_count=0 if pairs is None else len(pairs),
            body_count=0 if bodies is None else len(bodies),
            configuration_count=count if count is not None else 0 if configurations is None else len(configurations),
            all_pairs=pairs is None,
            **{name: requested[name] for name, row in self._options.items() if not row[0]},
        )
        parts = [header]
        if pairs is not None:
            parts.append(pairs)
        if bodies is not None:
            parts.append(np.concatenate([bodies, np.zeros(len(bodies) % 2, np.uint32)]))
        if poses is not None:
            parts.append(poses)
        later = {n: r for n, r in self._options.items() if r[0] and requested[n] != r[2]}
        tagged = {r[0]: struct.pack(_OPTION_FORMATS[r[1], r[6]], requested[name]) for name, r in later.items()}
        given = {name: positions if name == "positions" else requested[name] for name in _ARRAY_TAGS}
        arrays = {name: array for name, array in given.items() if array is not None and len(array)}
        tagged.update((_ARRAY_TAGS[name], np.ascontiguousarray(array).tobytes()) for name, array in arrays.items())
        if rows is not None:
            tagged[QueryRecord.ROWS] = np.ascontiguousarray(rows, np.uint64).tobytes()
        records = b"".join(record(tag, tagged[tag]) for tag in sorted(tagged))
        joints = 0 if query.joints is None else len(query.joints)
        expected = _PLAN_BYTES if type == FrameType.OPEN_PLAN else 0
        if type == FrameType.QUERY:
            expected = self._expected_reply_bytes(header, pairs, joints, query.k)
        return self._send(type, parts, revision, records, expected)

    def pairs(self, query: Any) -> np.ndarray:
        count = int(query.bodies is not None or query.joints is not None)
        frame = self._receive(self.send_query(query, type=FrameType.PAIRS, count=count), "PAIR_TABLE")
        count = int(self._records(frame, 0, "PairsHeader", 1)[0]["count"])
        if len(frame.payload) != 16 + 8 * count:
            raise malformed(self.connection.url, f"{count} pairs in {len(frame.payload)} bytes")
        return np.frombuffer(frame.payload, np.uint32, 2 * count, 16).reshape(-1, 2).copy() if count else _NO_PAIRS

    def open_plan(self, query: Any, configurations: int) -> tuple[Any, list[tuple[int, int, int]]]:
        """Opens a plan. Returns its PlanHeader, and its columns as [(field, bytes per row, offset)]."""
        frame = self._receive(self.send_query(query, type=FrameType.OPEN_PLAN, count=configurations), "PLAN")
        header = self._records(frame, 0, "PlanHeader", 1)[0]
        columns = self._records(frame, header.nbytes, "PlanColumnRecord")
        inside = all(
            int(c["offset"]) + int(header["rows"]) * int(c["row_bytes"]) <= int(header["memory_bytes"]) for c in columns
        )
        if len(columns) != header["column_count"] or not inside:
            raise malformed(self.connection.url, "a plan whose columns do not lie in its memory")
        return header, [(int(c["field"]), int(c["row_bytes"]), int(c["offset"])) for c in columns]

    def run_plan(self, number: int, scene_revision: int, timeout_s: Optional[float]) -> tuple[int, int]:
        request = self._send(FrameType.RUN_PLAN, [_plan_record(number)], scene_revision, b"", _PLAN_BYTES)
        done = self._whole(self._receive(request, "PLAN_DONE", timeout_s), "PlanResult")
        return int(done["snapshot_revision"]), int(done["took_ns"])

    def send_close_plan(self, number: int) -> int:
        return self._send(FrameType.CLOSE_PLAN, [_plan_record(number)], 0, b"", _PLAN_BYTES)

    def close_plan(self, number: int) -> None:
        self._receive(self.send_close_plan(number), "PLAN_DONE")

    def certificate(
        self,
        query: Any,
        poses: Optional[np.ndarray],
        positions: Optional[np.ndarray],
        rows: Optional[np.ndarray],
    ) -> str:
        """Returns the document of a certificate. rows: (R,) row numbers, by default all."""
        frame = self._receive(self.send_query(query, poses, positions, FrameType.CERTIFY, rows=rows), "CERTIFICATE")
        try:
            return bytes(frame.payload).decode()
        except UnicodeDecodeError as error:
            raise malformed(self.connection.url, f"the certificate is not UTF-8: {error}") from None

    def _expected_reply_bytes(self, q: np.ndarray, pairs: Optional[np.ndarray], joints: int, k: int) -> int:
        """Estimates the size of the reply in bytes; 0 leaves the size to the daemon."""
        rows = max(int(q["configuration_count"]), 1)
        reduce, scene = int(q["reduce"]), self._scene
        if reduce not in (Reduce.MIN, Reduce.ANY):
            selects = pairs is not None and bool((pairs & GROUP_BIT).any())
            if scene is None and (pairs is None or selects or reduce == Reduce.NEAREST):
                return 0
            if pairs is not None and not selects:
                each = len(pairs)
            else:
                each = (scene.pair_count if scene else 0) * (len(pairs) if pairs is not None else 1)
            if reduce == Reduce.NEAREST:
                each = min(k, each) if k else len(scene.bodies) if scene else 0
            rows *= each
            if reduce == Reduce.WITHIN:
                rows = min(rows, int(q["max_results"]))
        fields = int(q["fields"])
        if reduce != Reduce.NONE:
            fields |= Field.PAIR | Field.CONFIGURATION
        size = 64 + wire._wire.ReplyHeader.itemsize + 2 * 16  # records with the epoch and the number of joints
        for name, column in COLUMNS.items():
            if fields >> column.bit & 1:
                each = int(np.prod(column_shape(name, joints), dtype=int))
                size += -(-rows * column.dtype.itemsize * each // 64) * 64
        return size if size <= MAX_FRAME_BYTES else 0


def _plan_record(number: int) -> bytes:
    return struct.pack("<QQ", number, 0)
