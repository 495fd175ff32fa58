"""Slow reference for margins of rays: every shift is tried, from the shortest on, until one changes a hit."""

import math
from collections.abc import Collection, Mapping, Set

__all__ = ["SHIFTS", "Shift", "margins"]

Shift = tuple[float, float]
Told = tuple[int, bool, float, Shift]
"""An object, whether it is hit, and how far and whither it is to the first shift that changes this."""


def _shifts() -> list[Shift]:
    """Whole px up to 8 px, quarters up to 2 px, 16ths up to 1/2 px, 64ths up to 1/8 px, 256ths up to 1/32 px."""
    found = set()
    for part in (1, 4, 16, 64, 256):
        for y in range(-8, 9):
            found |= {(x / part, y / part) for x in range(-8, 9) if x * x + y * y <= 64}
    return sorted(found, key=lambda s: (s[0] ** 2 + s[1] ** 2, s[1], s[0]))


SHIFTS = _shifts()


def margins(hit_at: Mapping[Shift, Set[int]], objects: Collection[int]) -> list[Told]:
    """Margins of objects from what the shot hits at each shift; shifts from which it cannot be fired are missing."""
    found = []
    for item in sorted(objects):
        hit = item in hit_at[0, 0]
        flips = (s for s in SHIFTS if s in hit_at and (item in hit_at[s]) != hit)
        shift = next(flips, None)
        if shift is not None:
            found.append((item, hit, math.hypot(*shift), shift))
    return found
