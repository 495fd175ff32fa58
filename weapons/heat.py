"""The heat of a batch: how many samples of each verdict fell on each pixel of a view, as runs of equal counts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from planes.arrays import Ints
from planes.constants import CHUNK_SAMPLES
from planes.sampling import OF_PATTERNS, Verdict
from planes.spans import Box
from weapons.explain import detail_of
from weapons.hits import Hits
from weapons.rayhits import RayHits

__all__ = ["heat_of"]

CELLS_MAX = 2**18
"""Cells of a view that are told apart: larger views share a cell between 2 x 2, 4 x 4, ... pixels."""


def heat_of(fired: Sequence[Hits], view_xyxy: Box) -> dict[str, Any]:
    """Count the samples of all shots in a view.

    Returns
    -------
    JSON: "cell", the side of a cell, px; "origin_xy", the pixel of cell (0, 0); "beyond", samples out of view; and
    "counts", for each verdict that occurs runs [row, column_first, column_last, samples] of cells
    """
    x, y, x_max, y_max = view_xyxy
    cell = 1
    while -(-(x_max - x + 1) // cell) * -(-(y_max - y + 1) // cell) > CELLS_MAX:
        cell *= 2
    width, height = (x_max - x) // cell + 1, (y_max - y) // cell + 1
    counts, beyond = np.zeros((len(OF_PATTERNS), height * width), np.int64), 0
    for xy, verdict in _parts(fired):
        seen = (xy >= (x, y)).all(axis=1) & (xy <= (x_max, y_max)).all(axis=1)
        column, row = ((xy[seen] - (x, y)) // cell).T
        for kind in np.unique(verdict[seen]).tolist():
            own = verdict[seen] == kind
            cells, samples = np.unique(row[own] * width + column[own], return_counts=True)
            counts[kind, cells] += samples
        beyond += int((~seen).sum())
    runs = {v.name.lower(): _runs(counts[v].reshape(height, width)) for v in OF_PATTERNS if counts[v].any()}
    return {"cell": cell, "origin_xy": [x, y], "beyond": beyond, "counts": runs}


def _parts(fired: Sequence[Hits]) -> Iterator[tuple[Ints, Ints]]:
    """Pixels (n, 2) and verdicts of all samples, some shots at a time."""
    for hits in fired:
        if isinstance(hits, RayHits):
            for shot in range(len(hits.shots)):
                cells = hits.samples_at(shot)
                walked = cells.verdict != Verdict.BEYOND
                yield cells.xy[walked], cells.verdict[walked]
            continue
        step = max(1, CHUNK_SAMPLES // max(int(hits.fired.max(initial=1)), 1))
        for first in range(0, len(hits.shots), step):
            detail = detail_of(hits.scene, hits.weapon, hits.shots.take(first, first + step))
            yield np.stack([detail.x, detail.runs.y[detail.run]], axis=1), detail.verdict


def _runs(counts: Ints) -> list[list[int]]:
    """Runs of equal counts in the rows of a plane, those of 0 left out."""
    height, width = counts.shape
    flat = counts.reshape(-1)
    changed = np.flatnonzero(np.diff(flat, prepend=-1) != 0)
    first = np.union1d(changed, np.arange(height) * width)
    last = np.append(first[1:], len(flat)) - 1
    some = flat[first] > 0
    first, last = first[some], last[some]
    runs: list[list[int]] = np.stack([first // width, first % width, last % width, flat[first]], axis=1).tolist()
    return runs
