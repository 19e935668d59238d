"""Arguments of plan_on_device() for an engine or a daemon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np

from ._arguments import to_count
from ._front import Front
from ._names import BodyRef
from ._query import Query


def plan_query(
    front: Front,
    configurations: int,
    bodies: Optional[Sequence[BodyRef]],
    pairs: Any,
    fields: Union[str, Sequence[str], None],
    joints: Any,
    reduce: str,
    more: Mapping[str, Any],
) -> tuple[Query, int]:
    """Returns the query, with one configuration of zeros in place of K, and K."""
    count = to_count(configurations, "configurations")
    if fields is None:
        fields = "status" if reduce == "any" else ("lower", "upper")
    requested: dict[str, Any] = {"pairs": pairs, "fields": fields, "reduce": reduce, **more}
    if count == 0 and (bodies is not None or joints is not None):
        raise ValueError(f"{'joints' if bodies is None else 'bodies'}: only together with configurations")
    if count > 0:
        if joints is not None:
            ids = front._joint_table.ids_of(joints, "joints")
            requested.update(joints=ids, positions=np.zeros((1, len(ids))))
        if joints is None or bodies is not None:
            moved = front._names.movable if bodies is None else front._names.bodies_array(bodies, "bodies")
            requested.update(configurations=np.zeros((1, len(moved), 7)), bodies=moved)
    return front._parse_named(requested), count
