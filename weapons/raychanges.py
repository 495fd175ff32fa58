"""What changed between the rays of two shots: where and why they stopped, and what they went through."""

from __future__ import annotations

from typing import Any

from weapons.jsondiff import ABSENT, Entry, by_path, entries, first_of, pairs, same, shown
from weapons.words import unquoted

__all__ = ["ray_changes"]


def ray_changes(was: Entry, now: Entry) -> list[str] | None:
    """Lines about the rays of a shot, of any JSON; None if there are no words for what has changed."""
    known = [*entries(was["rays"]), *entries(now["rays"])]
    lines = []
    for before, after in pairs(was["rays"], now["rays"], "round", "pellet"):
        name = _name(after or before or {}, known)
        if before is None or after is None:
            lines.append(f"{name} is {'new' if before is None else 'missing'}")
        else:
            lines += [f"{name}: {line}" for line in _changes(before, after)]
    return first_of(lines) or None


def _name(ray: Entry, known: list[Entry]) -> str:
    """A ray by its pellet and round, where a shot has several."""
    pellet, rounds = (any(not same(other.get(key), 0) for other in known) for key in ("pellet", "round"))
    told = f"ray {shown(ray.get('pellet'))}" if pellet else "ray"
    return f"{told} of round {shown(ray.get('round'))}" if rounds else told


def _changes(was: Entry, now: Entry) -> list[str]:
    lines = []
    for key in dict.fromkeys(["stop", "passes", *was, *now]):
        before, after = was.get(key, ABSENT), now.get(key, ABSENT)
        if not same(before, after):
            words = {"stop": _stop, "passes": _passes}.get(key)
            lines += (words(before, after) if words else None) or first_of(by_path(key, before, after))
    return lines


def _stop(was: Any, now: Any) -> list[str] | None:
    """Line about where and why a ray stopped; None if that reads the same."""
    if not (isinstance(was, dict) and isinstance(now, dict)):
        return None
    (place, far, why), (old_place, old_far, old_why) = (
        (_at(stop.get("item")), _px(stop.get("distance")), unquoted(stop.get("reason"))) for stop in (now, was)
    )
    if (place, far, why) == (old_place, old_far, old_why):
        return None
    before = [old_place] if old_place and place != old_place else []
    before += [] if far == old_far and before else [old_far]
    reason = f" ({old_why})" if why != old_why else ""
    return [f"stopped {place + ', ' if place else 'after '}{far} ({why}), was {', '.join(before)}{reason}"]


def _passes(was: Any, now: Any) -> list[str] | None:
    lines = []
    for before, after in pairs(was, now, "object"):
        told = after or before or {}
        name = f"object {shown(told.get('object'))} {shown(told.get('name'))}"
        if before is None or after is None:
            lines.append(f"{'newly' if before is None else 'no longer'} goes through {name}{_way(told)}")
        elif _way(before) != _way(after):
            lines.append(f"goes through {name}{_way(after)}, was{_way(before)}")
        else:
            lines += [f"in {name}: {line}" for line in first_of(by_path("", before, after))]
    return first_of(lines) or None


def _way(told: Entry) -> str:
    return f" from {_px(told.get('entry_px'))} to {_px(told.get('exit_px'))}"


def _at(item: Any) -> str:
    return "" if item is None else f"at {unquoted(item.get('name')) if isinstance(item, dict) else shown(item)}"


def _px(value: Any) -> str:
    """A distance to a tenth of a px, or whatever stands in its place."""
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:.1f} px" if plain else shown(value)
