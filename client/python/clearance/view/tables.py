"""The page's tables in HTML. Numbers are rounded outward, so that a shown interval contains the engine's."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

import numpy as np

from .._query.path_report import PathReport
from .._words import Flag, Status
from .edge import Edge, Span, Verdict
from .model import Picture
from .path import ProvedPath

#: CSS colours of the results of proofs.
FREE, OPEN, HIT = "#2f9e62", "#d98a00", "#d64541"
#: Colours of nearest points and of lower bounds.
BLUE = "#0b57d0"
COLOURS = {Verdict.FREE: FREE, Verdict.OPEN: OPEN, Verdict.HIT: HIT}
_MOST_MOTIONS = 100  # rows of a path
_STATUS_COLOURS = {Status.OVERLAP: HIT, Status.CONTACT: OPEN, Status.UNCONVERGED: OPEN}
_STYLE = (
    "<style>.clr{width:100%;border-collapse:collapse;font-size:11px;font-variant-numeric:tabular-nums}"
    ".clr td,.clr th{padding:1px 4px;text-align:right;white-space:nowrap}"
    ".clr td:first-child,.clr th:first-child{text-align:left;white-space:normal;overflow-wrap:anywhere}"
    ".clr tr{border-bottom:1px solid #8883}.clr i{font-style:normal;font-weight:600}</style>"
)


def rounded_down(value: float, digits: int = 6) -> str:
    """Formats `value`, rounded down."""
    return _rounded(value, digits, ROUND_FLOOR)


def rounded_up(value: float, digits: int = 6) -> str:
    """Formats `value`, rounded up."""
    return _rounded(value, digits, ROUND_CEILING)


def _rounded(value: float, digits: int, way: str) -> str:
    if not math.isfinite(value):
        return {math.inf: "&infin;", -math.inf: "-&infin;"}.get(value, "")
    text = str(Decimal(value).quantize(Decimal(1).scaleb(-digits), rounding=way))
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def interval(lower: float, upper: float) -> str:
    """Returns two cells with an interval rounded outward, and tooltips with all digits."""
    return (
        f'<td class="lower" title="{lower!r}">{rounded_down(lower)}</td>'
        f'<td class="upper" title="{upper!r}">{rounded_up(upper)}</td>'
    )


def pairs_table(picture: Picture) -> str:
    """Returns a table with a row per pair: bodies, interval in metres, status, flags."""
    rows = []
    for (a, b), status, flags, lower, upper in zip(
        picture.pairs.tolist(),
        picture.status.tolist(),
        picture.flags.tolist(),
        picture.lower.tolist(),
        picture.upper.tolist(),
    ):
        word = Status(status).name.lower()
        said = ", ".join([word, *(flag.name.lower() for flag in Flag if flag.name and flags & flag)])
        colour = _STATUS_COLOURS.get(Status(status))
        style = f' style="color:{colour}"' if colour else ""
        names = f"{_name(picture.names, a)} &ndash; {_name(picture.names, b)}"
        rows.append(f'<tr{style} data-pair="{a},{b}"><td>{names}</td>{interval(lower, upper)}<td>{said}</td></tr>')
    if not rows:
        return paragraph("No pair is that near.")
    more = picture.total - len(rows)
    note = paragraph(f"and {more} more pairs, farther than these") if more > 0 else ""
    return _table(["bodies", "lower [m]", "upper [m]", "status"], rows) + note


def edge_table(edge: Edge, names: Sequence[str]) -> str:
    """Returns the result of an edge, and a row per span: times, interval in metres, deciding pair, evaluations."""
    rows = [_span_row(span, names, f"{span.begin:.3f} &ndash; {span.end:.3f}") for span in edge.spans]
    whole = _span_row(edge.whole, names, "all of it")
    head = ["time", "", "lower [m]", "upper [m]", "decided by", "steps"]
    return _where(edge.report, [0.0, 1.0]) + _table(head, [whole, *rows])


def path_table(proved: ProvedPath) -> str:
    """Returns the result of a path, and a row per motion: times and verdict."""
    times, check = proved.path.times.tolist(), proved.report.check
    rows = [
        f'<tr data-motion="{k}"><td>{times[k]:.3f} &ndash; {times[k + 1]:.3f} s</td><td>{_verdict(verdict)}</td></tr>'
        for k, verdict in enumerate(proved.verdicts)
    ]
    limits = paragraph("It is beyond the limits of joints.", HIT) if check.beyond_limits else ""
    more = paragraph(f"and {len(rows) - _MOST_MOTIONS} more motions") if len(rows) > _MOST_MOTIONS else ""
    return limits + _where(proved.report, times) + _table(["motion", ""], rows[:_MOST_MOTIONS]) + more


def _where(report: PathReport, times: Sequence[float]) -> str:
    """Returns lines on the nearest state of a path, or its contact and depth. times: of its waypoints."""
    where = [("first contact", report.contact), ("nearest" if report.nearest.upper > 0 else "deepest", report.nearest)]
    return "".join(
        paragraph(
            f"{what} at {np.interp(point.index + point.t, range(len(times)), times):.3f}: "
            f"{html.escape(point.pair_names[0])} &ndash; {html.escape(point.pair_names[1])}, "
            f"{rounded_down(point.lower)} to {rounded_up(point.upper)} m"
        )
        for what, point in where
        if point is not None
    )


def _span_row(span: Span, names: Sequence[str], times: str) -> str:
    a, b = span.decided_by
    return (
        f'<tr data-span="{span.begin!r},{span.end!r}"><td>{times}</td><td>{_verdict(span.verdict)}</td>'
        f"{interval(span.lower, span.upper)}<td>{_name(names, a)} &ndash; {_name(names, b)}</td>"
        f"<td>{span.steps}</td></tr>"
    )


def _verdict(verdict: Verdict) -> str:
    return f'<i style="color:{COLOURS[verdict]}">{verdict.value}</i>'


def service_table(picture: Picture, source: str) -> str:
    """Returns a table of the backend, its response times and the age of its poses."""
    oldest = max(((age, i) for i, age in enumerate(picture.ages_s.tolist()) if not math.isnan(age)), default=None)
    rows = [
        ("answered by", html.escape(source)),
        ("bodies", f"{len(picture.names)}, of which {int(picture.placed.sum())} have a pose"),
        ("scene, poses", f"revision {picture.scene_revision:x}, {picture.pose_revision}"),
        ("answer took", f"{1e3 * picture.took_s:.3f} ms, of which the engine {1e3 * picture.engine_s:.3f}"),
        ("oldest pose", f"{oldest[0]:.3f} s, of {_name(picture.names, oldest[1])}" if oldest else "none was received"),
    ]
    return _table([], [f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in rows])


def _name(names: Sequence[str], body: int) -> str:
    return html.escape(names[body]) if body < len(names) else "none"


def _table(head: Sequence[str], rows: Sequence[str]) -> str:
    titles = "<tr>" + "".join(f"<th>{title}</th>" for title in head) + "</tr>" if head else ""
    return f'{_STYLE}<div style="padding:0 10px"><table class="clr">{titles}{"".join(rows)}</table></div>'


def paragraph(text: str, colour: str = "inherit") -> str:
    """Returns a line of text that is already HTML."""
    return f'<p style="padding:0 10px;margin:4px 0;font-size:12px;color:{colour}">{text}</p>'
