"""Phrases for the content of a report, and for the differences between two JSON values."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from hitplanes.planes.common.limits import FRAGILE_PX, SUB, WEIGHT_FULL

LINES_MAX = 12  # most lines of one list; the others are counted
VALUE_LETTERS = 80  # most letters of a value that a line shows
ABSENT = object()  # stands for a key that an object does not have

Entry = Mapping[str, Any]


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal as JSON: 1 differs from true, a tuple equals a list."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return isinstance(a, bool) == isinstance(b, bool) and bool(a == b)


def by_path(path: str, was: Any, now: Any) -> Iterator[str]:
    """Lines about the leaves that differ, each with its path."""
    if same(was, now):
        return
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*was, *now]):
            yield from by_path(f"{path}.{key}" if path else str(key), was.get(key, ABSENT), now.get(key, ABSENT))
    elif isinstance(was, list | tuple) and isinstance(now, list | tuple) and len(was) == len(now):
        for i, pair in enumerate(zip(was, now, strict=True)):
            yield from by_path(f"{path}[{i}]", *pair)
    elif isinstance(was, list | tuple) and isinstance(now, list | tuple):
        yield f"{path}: {len(now)} entries, was {len(was)}"
    else:
        yield f"{path}: {shown(now)}, was {shown(was)}"


Pair = tuple[Entry, Entry | None, Entry | None]
"""The present entry, or the earlier one if it is gone, to name both by; then the earlier and the present one."""


def pairs(was: Any, now: Any, *names: str) -> Iterator[Pair]:
    """Pair the entries of two lists that agree in the named fields, in the order of the first list, then the second."""
    before, after = ({key_of(entry, *names): entry for entry in entries(side)} for side in (was, now))
    for key in before | after:
        yield (before | after)[key], before.get(key), after.get(key)


def entries(value: Any) -> list[Entry]:
    """Objects of a list; empty for any other value."""
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list | tuple) else []


def key_of(entry: Entry, *names: str) -> str:
    """Named fields of an entry as one text."""
    return text_of_json([entry.get(name) for name in names])


def text_of_json(value: Any) -> str:
    """Value as JSON with sorted keys, or as Python shows it if it is not JSON."""
    return json.dumps(value, sort_keys=True, default=repr)


def first_of(lines: Iterable[str]) -> list[str]:
    """First LINES_MAX lines, and the number of the others."""
    every = list(lines)
    more = len(every) - LINES_MAX
    return every if more <= 0 else [*every[:LINES_MAX], f"and {more} more"]


def shown(value: Any) -> str:
    """Value as a short text without line breaks."""
    if value is None or value is ABSENT:
        return "missing" if value is ABSENT else "none"
    text = json.dumps(value, ensure_ascii=False, default=repr)
    if isinstance(value, float):
        text = text.removesuffix(".0")
    return text if len(text) <= VALUE_LETTERS else text[: VALUE_LETTERS - 3] + "..."


REASONS = {
    "category": "not an accepted category",
    "excluded": "its owner is excluded",
    "outside": "out of bounds",
    "inside": "it started inside of it",
    "tunnelled": "went through it between two tests",
    "budget": "no budget to begin with",
}

SLANT = 1 + 2**0.5  # tangent of 67.5 degrees: a direction within 22.5 degrees of an axis has one word, any other two
LEAST_TOLD = 0.05  # least distance that is not rounded to 0.0, px
NAME_MAX = 24  # most letters of a name on a label


def reason(entry: Mapping[str, Any], name_max: int | None = None) -> str:
    """Why an object was not hit, from any JSON; names are cut to `name_max` letters."""
    why = entry.get("reason")
    if why == "missed":
        distance = entry.get("distance")
        plain = isinstance(distance, int | float) and not isinstance(distance, bool)
        return f"missed by {distance:.1f} px" if plain else f"missed by {shown(distance)}"
    if why == "behind":
        names = [unquoted(by.get("name")) for by in entries(entry.get("by"))]
        return "behind " + ", ".join(name if name_max is None else short(name, name_max) for name in names)
    return REASONS.get(str(why), shown(why))


def apart(distance: float) -> str:
    """Distance above 0, px, as text that is never "0.0"."""
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
    words = ["up" if y < 0 else "down"] * (high * SLANT >= wide)
    words += ["left" if x < 0 else "right"] * (wide * SLANT >= high)
    return " ".join(words)


def short(name: str, most: int = NAME_MAX) -> str:
    """Name cut to at most so many letters."""
    return name if len(name) <= most else name[: most - 3] + "..."


def percent(share: float) -> str:
    """Share as a percentage."""
    return f"{100 * share:.1f} %" if share == 0 or share >= 0.001 else "< 0.1 %"


def unquoted(value: Any) -> str:
    """Name on one line, without quotes."""
    return shown(value)[1:-1] if isinstance(value, str) else shown(value)


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
    return [f"{_rays(n)} ended{f'{at}:' if at else ' at their'} {why}" for (at, why), n in alike.most_common()]


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
            text = f"{name} ends {_rays(entry['samples'])}"
            lines.append((text, f"in front of {behind}" if behind else "nothing behind it"))
    return lines


def _at(stop: Mapping[str, Any]) -> str:
    if stop["item"] is None:
        return ""
    return f" {'in' if stop['reason'] == 'budget' else 'at'} {stop['item']['name']}"


def _rays(n: int) -> str:
    return f"{n} ray" + ("" if n == 1 else "s")


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
