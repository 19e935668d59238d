"""Certificates: proofs of the rows of an answer, checked by a separate program."""

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
    """Rows of a query with proofs of their bounds, as a JSON document (docs/certificates.md).

    tools/check_certificate.py checks it in exact arithmetic, independently of Clearance.
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
        """The parsed document, a new one for each access; "rows" has the status, lower and upper of each row."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    def __repr__(self) -> str:
        rows = self.document["rows"]
        return f"<clearance.Certificate: {sum(row['proved'] for row in rows)} of {len(rows)} rows are proved>"


class Certifier(HasJoints, Protocol):
    """The members of Front that Certificates uses."""

    def _parse_named(self, arguments: dict[str, Any]) -> Query: ...
    def _certify(self, query: Query, rows: Optional[np.ndarray]) -> str: ...


class Certificates:
    """The method of Front for certificates."""

    def certificate(self: Certifier, rows: Optional[Sequence[int]] = None, **arguments: Any) -> Certificate:
        """Evaluates rows of a query on the current poses, and returns them with proofs of their bounds.

        rows: row numbers: k * P + p for pair p in configuration or motion k, or k for reduced motions. Default: all.
        arguments: those of distances(), by name, with reduce="none". The bounds have the bits of distances() with
            the same poses, unless their uncertainty grows with age. Or those of motions(), including
            `start` and `end`, with any reduction; `first_contact` is proved, too, unless `fields` excludes it.

        Takes ten times as long as the query. The rows of a configuration's pairs prove its reduction. Raises as
        distances() and motions(), and QueryError for a row outside the answer; a daemon also for a document of more
        than 64 MiB.
        """
        if "start" in arguments or "end" in arguments:
            arguments = motion_arguments(self, **arguments)
        query = self._parse_named(arguments)
        if rows is None:
            return Certificate(self._certify(query, None))
        numbers = [to_count(row, f"rows[{i}]") for i, row in enumerate(to_list(rows, "rows", "row numbers"))]
        return Certificate(self._certify(query, np.array(numbers, dtype=np.uint64)))
