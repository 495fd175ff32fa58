"""Memory that is freed between the steps of a batch, kept for its next step."""

from __future__ import annotations

from functools import cache

import numpy as np

__all__ = ["keep_freed"]

LARGEST = 2**24
"""Bytes of the largest block that is kept: more than a batch makes at a time."""


@cache
def keep_freed() -> None:
    """Let the C library keep the memory that is freed, up to twice LARGEST, from the first call on.

    glibc gives a large block back to the system when it is freed, and takes the next one from there page by page, until
    it has seen one as large freed: from then on it keeps such blocks (`mallopt(3)`, M_MMAP_THRESHOLD). A picture that
    was freed does that, too. A batch works in arrays of up to a megabyte; with new pages for each, discs took twice as
    long. Other C libraries are not changed by this.
    """
    np.empty(LARGEST, np.uint8)
