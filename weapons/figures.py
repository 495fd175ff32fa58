"""Diagrams by matplotlib, an optional library: one look for all of them, written aside and renamed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planes.image import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FAINT", "HATCH", "INK", "PAPER", "looking_alike", "save_figure"]

DPI = 160
"""A picture of 11 inches then is 1760 px wide, and is still read when it is shown at 1000."""

INK, FAINT, PAPER, HATCH = "#1d2733", "#66707c", "#ffffff", "#cfd5db"

LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "hatch.color": HATCH,
    "hatch.linewidth": 0.8,
    "savefig.facecolor": PAPER,
}
"""What all diagrams have in common."""


@contextmanager
def looking_alike() -> Iterator[None]:
    """Within it, figures are made and drawn in the common look, whatever the user's own settings are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(LOOK)
        yield


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG aside and rename it; the same figure gives the same bytes.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    data = io.BytesIO()
    with looking_alike():
        figure.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
    write_bytes(path, data.getvalue())
