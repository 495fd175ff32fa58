"""Words for what a report tells of rays: what they went through, where and why they ended, what they missed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from planes.constants import SUB, WEIGHT_FULL
from weapons.words import SLANT, apart, short

__all__ = ["RAY_HEADER", "blocked", "ended", "missed", "table"]

RAY_HEADER = ("object hit", "in", "out", "material")
"""Along the ray: where it goes in and comes out, and how much of the object's own pixels lies between."""

WHY = {"occluder": "occluder", "hits": "last hit", "budget": "budget used up", "range": "range"}


def table(shot: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Rows of what was hit, px along the rays; of several rays the first way in, the last way out, and the sum."""
    rays, rows = shot["rays"], shot["rows"]
    if not rows:
        return []
    several, rounds = len(rays) > 1, len({ray["round"] for ray in rays}) > 1
    faded = any(row["weight"] != WEIGHT_FULL * row["pellets"] for row in rows)
    lines = [(RAY_HEADER[0], *(["rays"] * several), *RAY_HEADER[1:], *(["weight"] * faded))]
    of: dict[tuple[int, int], list[Mapping[str, Any]]] = {}
    for ray in rays:
        for told in ray["passes"]:
            of.setdefault((ray["round"], told["object"]), []).append(told)
    for row in rows:
        passes = of[row["round"], row["object"]]
        name = row["name"] if several else f"{passes[0]['order'] + 1}. {row['name']}"
        ends = min(told["entry_px"] for told in passes), max(told["exit_px"] for told in passes)
        material = sum(told["material"] for told in passes)
        lines.append(
            (
                f"{name}, round {row['round']}" if rounds else name,
                *([str(row["pellets"])] * several),
                *(f"{value:.1f} px" for value in (*ends, material)),
                *([f"{row['weight'] / WEIGHT_FULL:.2f}"] * faded),
            )
        )
    return lines


def ended(rays: Sequence[Mapping[str, Any]]) -> list[str]:
    """Where and why rays ended: of one how far, of more how many ended alike, most first."""
    if len(rays) == 1:
        stop = rays[0]["stop"]
        return [f"ended{_at(stop)}{',' if stop['item'] else ' after'} {stop['distance']:.1f} px: {WHY[stop['reason']]}"]
    alike = Counter((_at(ray["stop"]), WHY[ray["stop"]["reason"]]) for ray in rays)
    return [f"{_rays(n)} ended{f'{at}:' if at else ' at their'} {why}" for (at, why), n in alike.most_common()]


def missed(shot: Mapping[str, Any]) -> tuple[str, str] | None:
    """The nearest object that was not hit, and how it was missed: where the ray went by, or that it ended before.

    None where there is none, or where the ray was in it: why that is no hit is told elsewhere.
    """
    miss = shot["nearest_miss"]
    if miss is None or not miss["distance"]:
        return None
    told = apart(miss["distance"])
    if any(_short(ray, miss) for ray in shot["rays"]):
        return f"nearest {miss['name']}", f"ended {told} short of it"
    way = " and ".join(_sides(miss["ray_xy"], miss["object_xy"]))
    return f"nearest {miss['name']}", f"missed {way} by {told}" if way else f"missed by {told}"


def blocked(shot: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How many rays each occluder ended, and what lies behind it; of one ray only if something does."""
    lines = []
    for entry in shot["blockers"]:
        behind = ", ".join(short(told["name"]) for told in entry["blocked"])
        if behind or len(shot["rays"]) > 1:
            told = f"{short(entry['name'])} ends {_rays(entry['samples'])}"
            lines.append((told, f"in front of {behind}" if behind else "nothing behind it"))
    return lines


def _at(stop: Mapping[str, Any]) -> str:
    if stop["item"] is None:
        return ""
    return f" {'in' if stop['reason'] == 'budget' else 'at'} {stop['item']['name']}"


def _rays(n: int) -> str:
    return f"{n} ray" + ("" if n == 1 else "s")


def _short(ray: Mapping[str, Any], miss: Mapping[str, Any]) -> bool:
    """Whether a ray ended where it was nearest to what it missed, with that rather ahead of it than beside."""
    if any(abs(v - w) * SUB >= 1 for v, w in zip(miss["ray_xy"], ray["stop"]["point"], strict=True)):
        return False
    (ax, ay), (dx, dy) = (
        (to[0] - at[0], to[1] - at[1]) for at, to in ((ray["start"], ray["end"]), (miss["ray_xy"], miss["object_xy"]))
    )
    return bool(ax * dx + ay * dy > abs(ax * dy - ay * dx))


def _sides(ray_xy: Sequence[float], object_xy: Sequence[float]) -> list[str]:
    """On which sides of an object a ray went by."""
    dx, dy = (there - here for there, here in zip(ray_xy, object_xy, strict=True))
    sides = [(dy, dx, ("high", "low")), (dx, dy, ("left", "right"))]
    return [words[step > 0] for step, other, words in sides if step and abs(step) * SLANT >= abs(other)]
