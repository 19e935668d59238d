"""Edges checked at samples at most a step apart, as planners do."""

import numpy as np


def within_samples(engine, joints, start, end, margin, step):
    """One check for all samples of a batch. start, end: (K, J).

    Returns (K,) whether each edge is free at all of its samples, and (K,) their number.
    """
    counts = np.maximum(np.ceil(np.abs(end - start).max(axis=1) / step).astype(int), 1) + 1
    rows = np.concatenate([s + np.linspace(0, 1, n)[:, None] * (e - s) for s, e, n in zip(start, end, counts)])
    free = engine.check(rows, joints=joints, margin=margin).free
    return np.logical_and.reduceat(free, np.concatenate([[0], np.cumsum(counts)[:-1]])), counts
