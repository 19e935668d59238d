"""Plots of the page as SVG, which a browser also draws in a tab that is not open."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_WIDTH, _HEIGHT = 420.0, 150.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 8.0, 22.0, 20.0


@dataclass(frozen=True)
class Series:
    """A line of a plot."""

    label: str
    colour: str
    values: np.ndarray  #: (N,); NaN leaves a gap


def plot(title: str, x: np.ndarray, series: Sequence[Series], x_range: tuple[float, float], x_label: str) -> str:
    """Returns an SVG of the series over (N,) x. Values must be >= 0; the axis starts at 0."""
    finite = [s.values[np.isfinite(s.values)] for s in series]
    most = max((float(values.max()) for values in finite if len(values)), default=0.0)
    step = nice_step(most)
    top = step * max(1, math.ceil(most / step * (1 - 1e-9)))
    low, high = x_range
    across = (_WIDTH - _LEFT - _RIGHT) / (high - low)
    down = (_HEIGHT - _TOP - _BOTTOM) / top
    base = _HEIGHT - _BOTTOM
    parts = [f'<text x="{_LEFT}" y="12" class="t">{html.escape(title)}</text>']
    for i in range(round(top / step) + 1):
        y = base - i * step * down
        parts.append(f'<path d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}" class="g"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{y + 3:.1f}" text-anchor="end">{i * step:g}</text>')
    for at, anchor in ((low, "start"), ((low + high) / 2, "middle"), (high, "end")):
        place = _LEFT + (at - low) * across
        parts.append(f'<text x="{place:.1f}" y="{_HEIGHT - 6}" text-anchor="{anchor}">{at:g}{x_label}</text>')
    for i, s in enumerate(series):
        parts.append(f'<path d="{_way(_LEFT + (x - low) * across, base - s.values * down)}" stroke="{s.colour}"/>')
        at = _WIDTH - _RIGHT - 58 * (len(series) - i)
        parts.append(f'<text x="{at + 12:.0f}" y="12">{html.escape(s.label)}</text>')
        parts.append(f'<path d="M{at:.0f} 9h9" stroke="{s.colour}"/>')
    style = (
        "<style>.clrplot path{fill:none;stroke-width:1.6}.clrplot .g{stroke:#8884;stroke-width:.6}"
        ".clrplot text{font-size:9px;fill:currentColor}.clrplot .t{font-size:10.5px;font-weight:600}</style>"
    )
    return f'{style}<svg class="clrplot" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" width="100%">{"".join(parts)}</svg>'


def nice_step(most: float) -> float:
    """Returns 1, 2 or 5 times a power of ten, such that `most` is two to five steps."""
    if not 0 < most < math.inf:
        return 1.0
    power = 10.0 ** math.floor(math.log10(most / 2))
    return next(step for step in (power, 2 * power, 5 * power, 10 * power) if most <= 5 * step)


def _way(x: np.ndarray, y: np.ndarray) -> str:
    """Returns an SVG path through points, with gaps at those that are not finite."""
    there = np.isfinite(x) & np.isfinite(y)
    words = []
    for i in np.flatnonzero(there).tolist():
        words.append(f"{'L' if i and there[i - 1] else 'M'}{x[i]:.1f} {y[i]:.1f}")
    return "".join(words)
