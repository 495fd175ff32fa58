"""Phrases for the content of a report: the cells and lines of its cards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

from hitplanes.planes.common.limits import FRAGILE_PX, SUB, WEIGHT_FULL
from hitplanes.planes.grid.spans import Box

SLANT = 1 + 2**0.5  # tangent of 67.5 degrees: a direction within 22.5 degrees of an axis has one word, any other two
LEAST_TOLD = 0.05  # least distance that is not rounded to 0.0, px
NAME_MAX = 24  # most letters of a name on a label


def apart(distance: float) -> str:
    """Distance above 0, px, as text that is never "0.0"."""
    return f"{distance:.1f} px" if distance >= LEAST_TOLD else "< 0.1 px"


def fragile(entry: Mapping[str, Any], turned: str) -> str | None:
    """What least shift turns a verdict over, if one pixel is enough; `turned` says into what."""
    margin = entry.get("margin")
    if margin is None or margin["distance"] > FRAGILE_PX:
        return None
    return f"! fragile: {margin['distance']:.2g} px {_way(margin['shift_xy'])} {turned}"


def _way(shift_xy: Sequence[float]) -> str:
    """Direction of a shift on the screen: straight within 22.5 degrees, else between."""
    (x, wide), (y, high) = ((v, abs(v)) for v in shift_xy)
    words = ["up" if y < 0 else "down"] * (high * SLANT >= wide)
    words += ["left" if x < 0 else "right"] * (wide * SLANT >= high)
    return " ".join(words)


def unseen(report: Mapping[str, Any], extent: Box) -> str:
    """How many shots do not fit the picture, and what it shows of a scene of an extent; empty if all shots fit."""
    x, y, x_max, y_max = view = report["view_xyxy"]
    shots, cut = report["shots"], sum(not _fits(shot, view) for shot in report["shots"])
    if not cut:
        return ""
    whole = x <= extent[0] and y <= extent[1] and x_max >= extent[2] and y_max >= extent[3]
    alone = "" if whole or len(shots) == 1 else f": report {'it' if cut == 1 else 'each'} alone"
    verb = "does" if cut == 1 else "do"
    return f"{cut} of {counted(len(shots), 'shot')} {verb} not fit this picture (x {x}..{x_max}, y {y}..{y_max}){alone}"


def _fits(shot: Mapping[str, Any], view: Box) -> bool:
    """Whether the pixel of a shot, and its samples within the bounds, lie in a view."""
    x, y = shot["at_xy"]
    within = (runs for verdict, runs in shot["samples"].items() if verdict not in ("outside", "beyond"))
    runs = chain([(y, x, x)], *within)
    return all(view[1] <= y <= view[3] and view[0] <= first and last <= view[2] for y, first, last in runs)


def short(name: str, most: int = NAME_MAX) -> str:
    """Name cut to at most so many letters, in its middle, as names often differ at their ends."""
    left, right = most // 2 - 1, most - most // 2 - 2
    return name if len(name) <= most else f"{name[:left]}...{name[-right:]}"


def percent(share: float) -> str:
    """Share as a percentage."""
    return f"{100 * share:.1f} %" if share == 0 or share >= 0.001 else "< 0.1 %"


RAY_HEADER = ("object hit", "in", "out", "material")
"""Header of the table of rays: distances of entry and exit, and length inside the object's pixels."""

WHY = {"occluder": "occluder", "hits": "last hit", "budget": "budget used up", "range": "range"}


def table(shot: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Table of the hits of rays, px; for several rays the first entry, the last exit, and the sum of the lengths."""
    rays, rows = shot["rays"], shot["rows"]
    if not rows:
        return []
    several, rounds = len(rays) > 1, len({ray["round"] for ray in rays}) > 1
    faded = any(row["weight"] != WEIGHT_FULL * row["pellets"] for row in rows)
    lines = [(RAY_HEADER[0], *(["rays"] * several), *RAY_HEADER[1:], *(["weight"] * faded))]
    of: dict[tuple[int, int], list[Mapping[str, Any]]] = {}
    for ray in rays:
        for entry in ray["passes"]:
            of.setdefault((ray["round"], entry["object"]), []).append(entry)
    for row in rows:
        passes = of[row["round"], row["object"]]
        name = row["name"] if several else f"{passes[0]['order'] + 1}. {row['name']}"
        ends = min(entry["entry_px"] for entry in passes), max(entry["exit_px"] for entry in passes)
        material = sum(entry["material"] for entry in passes)
        cells = [f"{name}, round {row['round']}" if rounds else name, *([str(row["pellets"])] * several)]
        cells += [f"{value:.1f} px" for value in (*ends, material)]
        lines.append((*cells, *([f"{row['weight'] / WEIGHT_FULL:.2f}"] * faded)))
    return lines


def ended(rays: Sequence[Mapping[str, Any]]) -> list[str]:
    """Why rays ended; for one ray with its distance, for several with their numbers, the greatest first."""
    if len(rays) == 1:
        stop = rays[0]["stop"]
        return [f"ended{_at(stop)}{',' if stop['item'] else ' after'} {stop['distance']:.1f} px: {WHY[stop['reason']]}"]
    alike = Counter((_at(ray["stop"]), WHY[ray["stop"]["reason"]]) for ray in rays)
    return [f"{counted(n, 'ray')} ended{f'{at}:' if at else ' at their'} {why}" for (at, why), n in alike.most_common()]


def missed(shot: Mapping[str, Any]) -> tuple[str, str] | None:
    """Nearest object that was not hit, and how it was missed: on which side, or because the ray ended before it.

    None if there is none, or if the ray was inside it; the reason for that is in another line.
    """
    miss = shot["nearest_miss"]
    if miss is None or not miss["distance"]:
        return None
    gap = apart(miss["distance"])
    if any(_short(ray, miss) for ray in shot["rays"]):
        return f"nearest {miss['name']}", f"ended {gap} short of it"
    way = " and ".join(_sides(miss["ray_xy"], miss["object_xy"]))
    return f"nearest {miss['name']}", f"missed {way} by {gap}" if way else f"missed by {gap}"


def blocked(shot: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Number of samples or rays that each occluder ended, and the objects behind it; for one ray only if it has any."""
    lines = []
    for entry in shot["blockers"]:
        name = short(entry["name"])
        if "rays" not in shot:
            behind = ", ".join(f"{hidden['samples']} on {short(hidden['name'])}" for hidden in entry["blocked"])
            lines.append((f"{name} blocks {entry['samples']}", behind or "nothing behind it"))
            continue
        behind = ", ".join(short(hidden["name"]) for hidden in entry["blocked"])
        if behind or len(shot["rays"]) > 1:
            text = f"{name} ends {counted(entry['samples'], 'ray')}"
            lines.append((text, f"in front of {behind}" if behind else "nothing behind it"))
    return lines


def _at(stop: Mapping[str, Any]) -> str:
    if stop["item"] is None:
        return ""
    return f" {'in' if stop['reason'] == 'budget' else 'at'} {stop['item']['name']}"


def counted(n: int, what: str) -> str:
    """Number of things, whose name gets an s if there is not one."""
    return f"{n} {what}" + ("" if n == 1 else "s")


def _short(ray: Mapping[str, Any], miss: Mapping[str, Any]) -> bool:
    """Whether a ray ended at its point nearest to the missed object, with the object ahead rather than beside."""
    if any(abs(v - w) * SUB >= 1 for v, w in zip(miss["ray_xy"], ray["stop"]["point"], strict=True)):
        return False
    (ax, ay), (dx, dy) = (
        (to[0] - at[0], to[1] - at[1]) for at, to in ((ray["start"], ray["end"]), (miss["ray_xy"], miss["object_xy"]))
    )
    return bool(ax * dx + ay * dy > abs(ax * dy - ay * dx))


def _sides(ray_xy: Sequence[float], object_xy: Sequence[float]) -> list[str]:
    """Sides of an object on which a ray went by."""
    dx, dy = (there - here for there, here in zip(ray_xy, object_xy, strict=True))
    sides = [(dy, dx, ("high", "low")), (dx, dy, ("left", "right"))]
    return [words[step > 0] for step, other, words in sides if step and abs(step) * SLANT >= abs(other)]
