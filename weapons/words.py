"""Words for what a report holds: why an object was not hit, names and shares in short."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from planes.constants import FRAGILE_PX
from weapons.jsondiff import entries, shown

__all__ = ["SLANT", "apart", "fragile", "percent", "reason", "short", "unquoted"]

REASONS = {
    "category": "not an accepted category",
    "excluded": "its owner is excluded",
    "outside": "out of bounds",
    "inside": "it started inside of it",
    "tunnelled": "went through it between two tests",
}

SLANT = 1 + 2**0.5
"""Tangent of 67.5 degrees: a way is told as straight within 22.5 degrees, else as one of two sides."""

LEAST_TOLD = 0.05
"""Least distance that is not rounded to 0.0, px."""

NAME_MAX = 24
"""Letters of a name on a label."""


def reason(entry: Mapping[str, Any], name_max: int | None = None) -> str:
    """Why an object was not hit, of any JSON; names are cut to a number of letters."""
    told = entry.get("reason")
    if told == "missed":
        distance = entry.get("distance")
        plain = isinstance(distance, int | float) and not isinstance(distance, bool)
        return f"missed by {distance:.1f} px" if plain else f"missed by {shown(distance)}"
    if told == "behind":
        names = [unquoted(by.get("name")) for by in entries(entry.get("by"))]
        return "behind " + ", ".join(name if name_max is None else short(name, name_max) for name in names)
    return REASONS.get(str(told), shown(told))


def apart(distance: float) -> str:
    """A distance that is not 0, px: never told as if it were."""
    return f"{distance:.1f} px" if distance >= LEAST_TOLD else "< 0.1 px"


def fragile(entry: Mapping[str, Any], turned: str) -> str | None:
    """What least shift turns a verdict over, if one pixel is enough; `turned` says into what."""
    margin = entry.get("margin")
    if margin is None or margin["distance"] > FRAGILE_PX:
        return None
    if not margin["distance"]:
        return "! fragile: it only touches"
    return f"! fragile: {margin['distance']:.2g} px {_way(margin['shift_xy'])} {turned}"


def _way(shift_xy: Sequence[float]) -> str:
    """Direction of a shift on the screen: straight within 22.5 degrees, else between."""
    (x, wide), (y, high) = ((v, abs(v)) for v in shift_xy)
    told = ["up" if y < 0 else "down"] * (high * SLANT >= wide)
    told += ["left" if x < 0 else "right"] * (wide * SLANT >= high)
    return " ".join(told)


def short(name: str, most: int = NAME_MAX) -> str:
    """A name of at most so many letters."""
    return name if len(name) <= most else name[: most - 3] + "..."


def percent(share: float) -> str:
    """A share, short."""
    return f"{100 * share:.1f} %" if share == 0 or share >= 0.001 else "< 0.1 %"


def unquoted(value: Any) -> str:
    """A name without quotes, on one line."""
    return shown(value)[1:-1] if isinstance(value, str) else shown(value)
