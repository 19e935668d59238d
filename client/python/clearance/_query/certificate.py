"""Certificates: proofs of the rows of an answer, checked by a separate program."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .._arguments import to_path


class Certificate:
    """Rows of a query with proofs of their bounds, as a JSON document (docs/trust/certificates.md).

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
