"""What proves rows of an answer, as a document that a separate program checks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Optional, Protocol

import numpy as np

from ._arguments import to_count, to_list, to_path
from ._motions import HasJoints, motion_arguments
from ._query import Query


class Certificate:
    """Rows of a query with what proves their bounds: a JSON document, which docs/certificates.md describes.

    tools/check_certificate.py checks it in exact arithmetic, and needs nothing of Clearance.
    """

    def __init__(self, text: str):
        self._text = text

    def to_json(self) -> str:
        """The document."""
        return self._text

    def save(self, path: Any) -> None:
        """Writes the document to a file (str or os.PathLike), which check_certificate.py reads."""
        Path(to_path(path, "path")).write_text(self._text, encoding="utf-8")

    @property
    def document(self) -> dict[str, Any]:
        """The document as Python's json reads it, anew each time: "rows" holds status, lower and upper of each."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    def __repr__(self) -> str:
        rows = self.document["rows"]
        return f"<clearance.Certificate: {sum(row['proved'] for row in rows)} of {len(rows)} rows are proved>"


class Certifier(HasJoints, Protocol):
    """What Certificates needs of the class that it is part of."""

    def _parse_named(self, arguments: dict[str, Any]) -> Query: ...
    def _certify(self, query: Query, rows: Optional[np.ndarray]) -> str: ...


class Certificates:
    """What Front says about certificates."""

    def certificate(self: Certifier, rows: Optional[Sequence[int]] = None, **arguments: Any) -> Certificate:
        """Answers rows of a query anew, on the newest poses, and gives with each what proves its bounds.

        rows: numbers of rows, k * P + p for pair p in configuration, or motion, k; of motions that are reduced k; None:
            all.
        arguments: those of distances(), by name, but for reduce, which must be "none". The bounds are those that
            distances() answers to the same poses with warm=False, bit for bit, unless their slack grows with age. Or
            those of motions(), `start` and `end` among them, of any reduction; `first_contact` is proved, too, unless
            `fields` leaves it out.

        Takes ten times as long as the rows do. The reduction of a configuration is proved by the rows of its pairs.
        Raises as distances() and motions(), and QueryError for a row that the answer has not; a daemon also for a
        document of more than 64 MiB.
        """
        if "start" in arguments or "end" in arguments:
            arguments = motion_arguments(self, **arguments)
        query = self._parse_named(arguments)
        if rows is None:
            return Certificate(self._certify(query, None))
        numbers = [to_count(row, f"rows[{i}]") for i, row in enumerate(to_list(rows, "rows", "row numbers"))]
        return Certificate(self._certify(query, np.array(numbers, dtype=np.uint64)))
