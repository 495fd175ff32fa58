"""Differences between two JSON values, and those between two reports as lines in the game's words.

Each part that differs gets a line in words or, if there are no words for it, a line with its path; so no difference
that matters is left out.
"""

from __future__ import annotations

import difflib
import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from hitplanes.planes.common.checks import printable

from .phrases import short

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
    """Lines about the leaves that differ, each with its path; of weapons of two kinds, only of keys that both have."""
    if same(was, now):
        return
    if isinstance(was, dict) and isinstance(now, dict):
        if "kind" in was and "kind" in now and not same(was["kind"], now["kind"]):
            was, now = _common(was, now)
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
    for key, entry in (before | after).items():
        yield entry, before.get(key), after.get(key)


def entries(value: Any) -> list[Entry]:
    """Objects of a list; empty for any other value."""
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list | tuple) else []


def key_of(entry: Entry, *names: str) -> str:
    """Named fields of an entry as one text."""
    return text_of_json([entry.get(name) for name in names])


def text_of_json(value: Any) -> str:
    """Value as JSON with sorted keys, or as Python shows it if it is not JSON."""
    return json.dumps(value, sort_keys=True, default=repr)


def first_of(lines: Iterable[str], most: int = LINES_MAX) -> list[str]:
    """First lines, and the number of the others."""
    every = list(lines)
    more = len(every) - most
    return every if more <= 0 else [*every[:most], f"and {more} more"]


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


def reason(entry: Mapping[str, Any], name_max: int | None = None) -> str:
    """Why an object was not hit, from any JSON; names are cut to `name_max` letters."""
    why = entry.get("reason")
    if why == "missed":
        return f"missed by {_px(entry.get('distance'))}"
    if why == "behind":
        names = [unquoted(by.get("name")) for by in entries(entry.get("by"))]
        return "behind " + ", ".join(name if name_max is None else short(name, name_max) for name in names)
    return REASONS.get(str(why), shown(why))


def unquoted(value: Any) -> str:
    """Name on one line, without quotes."""
    return shown(value)[1:-1] if isinstance(value, str) else shown(value)


def _rays(was: Entry, now: Entry) -> list[str] | None:
    known = [*entries(was["rays"]), *entries(now["rays"])]
    pellets, rounds = (any(not same(ray.get(key), 0) for ray in known) for key in ("pellet", "round"))
    lines = []
    for ray, before, after in pairs(was["rays"], now["rays"], "round", "pellet"):
        name = f"ray {shown(ray.get('pellet'))}" if pellets else "ray"
        name += f" of round {shown(ray.get('round'))}" if rounds else ""
        if before is None or after is None:
            lines.append(f"{name} is {'new' if before is None else 'missing'}")
        else:
            lines += [f"{name}: {line}" for line in _lines_of(before, after, {"stop": _stop, "passes": _passes})]
    return first_of(lines) or None


def _stop(was: Entry, now: Entry) -> list[str] | None:
    """Line about where and why a ray stopped; None if it would read the same."""
    (place, far, why), (old_place, old_far, old_why) = (
        (_ray_at(stop.get("item")), _px(stop.get("distance")), unquoted(stop.get("reason")))
        for stop in (now["stop"], was["stop"])
    )
    if (place, far, why) == (old_place, old_far, old_why):
        return None
    before = [old_place] if old_place and place != old_place else []
    before += [] if far == old_far and before else [old_far]
    reason = f" ({old_why})" if why != old_why else ""
    return [f"stopped {place + ', ' if place else 'after '}{far} ({why}), was {', '.join(before)}{reason}"]


def _nearest_miss(was: Entry, now: Entry) -> list[str] | None:
    """Line about the object that was passed by most closely; None if it would read the same."""
    before, after = was["nearest_miss"], now["nearest_miss"]
    if not all(miss is None or isinstance(miss, dict) for miss in (before, after)):
        return None
    old, new = ("none" if miss is None else f"{_name(miss)} by {_px(miss.get('distance'))}" for miss in (before, after))
    if old == new:
        return None
    if before and after and _name(before) == _name(after):
        old = _px(before.get("distance"))
    return [f"nearest miss: {new}, was {old}"]


def _passes(was: Entry, now: Entry) -> list[str] | None:
    lines = []
    for entry, before, after in pairs(was["passes"], now["passes"], "object"):
        name = _name(entry)
        if before is None or after is None:
            lines.append(f"{'newly' if before is None else 'no longer'} in {name}{_way(entry)}")
        elif _way(before) != _way(after):
            lines.append(f"in {name}{_way(after)}, was{_way(before)}")
        else:
            lines += [f"in {name}: {line}" for line in first_of(by_path("", before, after))]
    return first_of(lines) or None


def _way(entry: Entry) -> str:
    return f" from {_px(entry.get('entry_px'))} to {_px(entry.get('exit_px'))}"


def _ray_at(item: Any) -> str:
    return "" if item is None else f"at {unquoted(item.get('name')) if isinstance(item, dict) else shown(item)}"


def _px(value: Any) -> str:
    """Distance to a tenth of a px, or any other value in its place."""
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:.1f} px" if plain else shown(value)


PIXELS_NAMED = 2  # most gained or lost pixels that a line names

ABOUT = {
    "report": ("version", "times", "filter"),
    "scene": ("version", "hash"),
    "shot": ("plan", "tested"),
    "batch": ("plan", "times"),
}
"""Keys that say how a report was made; equality leaves them out."""

SHOT_DERIVED, ROW_DERIVED, BATCH_DERIVED = (
    ("at_xy", "samples", "sheltered", "nearest_miss"),
    ("distance2", "shares", "margin"),
    ("shots_that_hit", "objects", "heat"),
)
"""Keys of a shot, of a row and of a batch that follow from the rest; reported only if nothing else has changed."""

BATCH_COLUMNS = ("shot", "round", "object", "samples", "pixels", "weight", "pellets", "x", "y", "distance2")


def differences(expected: Entry, got: Entry) -> list[str]:
    """Differences between two reports, as `report_of` makes them or as their JSON reads, as lines.

    There are none if and only if all that decides is equal: plans, versions, the scene's hash and times do not count.
    """
    was, now = decisive(expected), decisive(got)
    if same(was, now):
        return []
    if _form_of(was) != _form_of(now):
        return [f"{_form_of(now)}, was {_form_of(was)}"]
    words: dict[str, Words] = {"scene": _scene, "weapons": _weapons, "batch": _batch, "shots": _shots}
    return list(map(printable, _lines_of(was, now, words) or by_path("", was, now)))


def decisive(report: Entry) -> dict[str, Any]:
    """Copy of a report without the keys that equality leaves out."""
    kept: dict[str, Any] = _without(dict(report), ABOUT["report"])
    for key in kept.keys() & {"scene", "batch"}:
        kept[key] = _without(kept[key], ABOUT[key])
    if isinstance(kept.get("shots"), list | tuple):
        kept["shots"] = [_without(shot, ABOUT["shot"]) for shot in kept["shots"]]
    return kept


def _without(part: Any, keys: Sequence[str]) -> Any:
    """Copy of an object without some of its keys; any other value as it is."""
    return {key: v for key, v in part.items() if key not in keys} if isinstance(part, dict) else part


Words = Callable[[Entry, Entry], list[str] | None]
"""Function (was, now) that returns lines about one part of both; None if there are no words for the change."""


def _lines_of(was: Entry, now: Entry, words: Mapping[str, Words]) -> list[str]:
    """Lines about each part that differs: first those in words, then the others by their paths."""
    lines = []
    for key in dict.fromkeys([*words, *was, *now]):
        before, after = was.get(key, ABSENT), now.get(key, ABSENT)
        if same(before, after):
            continue
        known = ABSENT not in (before, after)
        known &= key not in OBJECTS or (isinstance(before, dict) and isinstance(after, dict))
        phrases = words[key](was, now) if key in words and known else None
        lines += first_of(by_path(key, before, after)) if phrases is None else phrases
    return lines


OBJECTS = ("scene", "weapons", "batch", "verdicts", "samples", "stop")  # keys whose words are only for objects


def _scene(was: Entry, now: Entry) -> list[str] | None:
    before, after = was["scene"], now["scene"]
    return [f"scene: {line}" for line in _fields(before, after, dict.fromkeys([*before, *after]))]


def _weapons(was: Entry, now: Entry) -> list[str] | None:
    lines = []
    before, after = was["weapons"], now["weapons"]
    for name in dict.fromkeys([*before, *after]):
        if name not in before or name not in after:
            lines.append(f"weapon {shown(name)} is {'new' if name in after else 'gone'}")
        else:
            lines += [f"weapon {shown(name)}: {line}" for line in by_path("", before[name], after[name])]
    return first_of(lines)


def _shots(was: Entry, now: Entry) -> list[str] | None:
    groups = []
    numbers = {id(shot): number for side in (was, now) for number, shot in enumerate(entries(side["shots"]))}
    for shot, before, after in _paired_shots(entries(was["shots"]), entries(now["shots"])):
        title = f"shot {numbers.get(id(shot), 0)} ({unquoted(shot.get('weapon'))} at {_place(shot.get('at'))})"
        if before is None or after is None:
            groups.append([f"{title} is {'missing' if after is None else 'new'}"])
        elif not same(before, after):
            lines = _shot(before, after)
            if not same(_weapon_of(was, before), _weapon_of(now, after)):
                lines = _shot(*_common(before, after)) or lines
            groups.append([f"{title}: {line}" for line in lines])
    lines = [line for group in groups[:LINES_MAX] for line in group]
    return lines + [f"and {len(groups) - LINES_MAX} more shots"] * (len(groups) > LINES_MAX) or None


def _shot(was: Entry, now: Entry) -> list[str]:
    words: dict[str, Words] = {
        "at": lambda was, now: [f"fired at {_place(now['at'])}, was {_place(was['at'])}"],
        "rows": _rows, "blockers": _blockers, "why_not": _why_not, "verdicts": _verdicts, "rays": _rays,
        "samples": _samples, "nearest_miss": _nearest_miss,
    }  # fmt: skip
    return _lines_of(_chief(was), _chief(now), words) or _lines_of(was, now, words)


def _weapon_of(report: Entry, shot: Entry) -> Any:
    """Weapon of a shot as JSON, which decides what keys the shot has; None if the report has none."""
    weapons = report.get("weapons")
    return weapons.get(str(shot.get("weapon"))) if isinstance(weapons, dict) else None


def _common(was: Any, now: Any) -> tuple[Any, Any]:
    """Both values without the keys of objects, at any depth, that only one of them has."""
    if not (isinstance(was, dict) and isinstance(now, dict)):
        return was, now
    both = {key: _common(was[key], now[key]) for key in was if key in now}
    return {key: before for key, (before, _) in both.items()}, {key: after for key, (_, after) in both.items()}


def _chief(shot: Entry) -> dict[str, Any]:
    """Copy of a shot without the keys that follow from the rest."""
    chief: dict[str, Any] = _without(shot, SHOT_DERIVED)
    for part in ("rows", "why_not"):
        if isinstance(shot.get(part), list | tuple):
            chief[part] = [_without(row, ROW_DERIVED) for row in shot[part]]
    return chief


def _verdicts(was: Entry, now: Entry) -> list[str] | None:
    before, after = was["verdicts"], now["verdicts"]
    counts = []
    for key in dict.fromkeys([*after, *before]):
        had, has = before.get(key, ABSENT), after.get(key, ABSENT)
        counts += [] if same(had, has) else [f"{shown(has)} {key}, was {shown(had)}"]
    return ["verdicts: " + "; ".join(counts)]


def _rows(was: Entry, now: Entry) -> list[str] | None:
    rounds = any(row.get("round") != 0 for row in [*entries(was["rows"]), *entries(now["rows"])])
    reasons = [{key_of(e, "object"): e for e in entries(shot.get("why_not"))} for shot in (was, now)]
    lines = []
    for row, before, after in pairs(was["rows"], now["rows"], "object", "round"):
        name = _name(row) + (f", round {shown(row.get('round'))}" if rounds else "")
        why = reasons[after is None].get(key_of(row, "object"))
        lines += _row(name, before, after, "" if why is None else reason(why))
    return first_of(lines) or None


def _row(name: str, was: Entry | None, now: Entry | None, why: str) -> list[str]:
    """Line about a row that is new, missing or changed; `why` is the reason why its object is not, or was not, hit."""
    if now is None:
        return [f"{name} is no longer hit" + (f": {why}" if why else "")]
    if was is None:
        hit = f"{_count(now.get('pixels'))}, first at ({_place(now.get('first_xy'))})"
        return [f"{name} is newly hit: {hit}" + (f"; was {why}" if why else "")]
    if same(was, now):
        return []
    pixels = [row.get("pixels", ABSENT) for row in (was, now)]
    parts = [] if same(*pixels) else [f"{_count(pixels[1])}, was {shown(pixels[0])}"]
    parts += _gained_and_lost(was.get("runs"), now.get("runs"))
    single = parts and all(same(row.get("samples"), row.get("pixels")) for row in (was, now))
    follow = {"pixels", "runs", *(["samples"] if single else []), *(["weight", "distance2"] if parts else [])}
    parts += _fields(was, now, [key for key in dict.fromkeys([*was, *now]) if key not in follow])
    return [f"{name}: " + "; ".join(parts or by_path("", was, now))]


def _blockers(was: Entry, now: Entry) -> list[str] | None:
    lines = []
    for entry, before, after in pairs(was["blockers"], now["blockers"], "object"):
        name = _name(entry)
        if after is None:
            lines.append(f"{name} no longer blocks")
        elif before is None:
            lines.append(f"{name} newly blocks {_count(after.get('samples'), 'sample')}")
        elif not same(before, after):
            lines.append(f"{name} " + "; ".join(_blocker(before, after)))
    return first_of(lines) or None


def _blocker(was: Entry, now: Entry) -> list[str]:
    parts = []
    if not same(was.get("samples"), now.get("samples")):
        parts = [f"ends {_count(now.get('samples'), 'sample')}, was {shown(was.get('samples'))}"]
    for entry, before, after in pairs(was.get("blocked"), now.get("blocked"), "object"):
        counts = [0 if side is None else side.get("samples") for side in (before, after)]
        if not same(*counts):
            parts.append(f"in front of {_name(entry)}: {_count(counts[1], 'sample')}, was {shown(counts[0])}")
    return parts or [f"as a blocker: {line}" for line in first_of(by_path("", was, now))]


def _why_not(was: Entry, now: Entry) -> list[str] | None:
    """Lines about the objects near that were not hit, without those whose row is new or missing."""
    hits = [{key_of(row, "object") for row in entries(shot.get("rows"))} for shot in (was, now)]
    changed = hits[0] ^ hits[1]
    lines = []
    for entry, before, after in pairs(was["why_not"], now["why_not"], "object"):
        if key_of(entry, "object") in changed:
            continue
        if before is None or after is None:
            lines.append(f"{_name(entry)} is {'newly' if before is None else 'no longer'} near: {reason(entry)}")
        elif not same(before, after):
            lines.append(f"{_name(after)}: " + "; ".join(_why_changed(before, after)))
    return first_of(lines) if lines or changed else None


def _why_changed(was: Entry, now: Entry) -> list[str]:
    before, after = reason(was), reason(now)
    if before != after:
        prefix = "missed by "
        return [f"{after}, was {before.removeprefix(prefix) if after.startswith(prefix) else before}"]
    return [f"{after}: {line}" for line in first_of(by_path("", was, now))]


def _samples(was: Entry, now: Entry) -> list[str] | None:
    before, after = was["samples"], now["samples"]
    lines = []
    for verdict in dict.fromkeys([*after, *before]):
        phrases = _gained_and_lost(before.get(verdict, []), after.get(verdict, []))
        lines += [f"{verdict} samples: " + "; ".join(phrases)] if phrases else []
    return lines or None


def _batch(was: Entry, now: Entry) -> list[str] | None:
    """Lines about a batch; totals and heat only if nothing else has changed."""
    before, after = was["batch"], now["batch"]
    words: dict[str, Words] = {"rows": lambda *_: _batch_rows(before, after), "verdicts": _verdicts}
    rest = [_without(batch, BATCH_DERIVED) for batch in (before, after)]
    return [f"batch: {line}" for line in _lines_of(rest[0], rest[1], words) or _lines_of(before, after, {})]


def _batch_rows(was: Entry, now: Entry) -> list[str] | None:
    rows = [batch["rows"] for batch in (was, now)]
    if not all(isinstance(row, list | tuple) and len(row) == len(BATCH_COLUMNS) for side in rows for row in side):
        return None
    known = [{text_of_json(row) for row in side} for side in rows]
    sides: list[list[Entry]] = []
    for batch, others in zip((was, now), reversed(known), strict=True):
        names = {text_of_json(entry.get("object")): entry.get("name") for entry in entries(batch.get("objects"))}
        sides.append([_as_row(row, names) for row in batch["rows"] if text_of_json(row) not in others])
    lines = []
    for row, old, new in pairs(sides[0], sides[1], "shot", "object", "round"):
        name = f"shot {shown(row['shot'])}: {_name(row)}"
        lines += _row(name + (f", round {shown(row['round'])}" if row["round"] else ""), old, new, "")
    return first_of(lines) or None


def _as_row(row: Any, names: Mapping[str, Any]) -> dict[str, Any]:
    """Row of a batch in the form of a row of a shot."""
    fields = dict(zip(BATCH_COLUMNS, row, strict=True))
    first_xy = [fields.pop("x"), fields.pop("y")]
    return {**fields, "first_xy": first_xy, "name": names.get(text_of_json(fields["object"]))}


def _paired_shots(was: list[Entry], now: list[Entry]) -> Iterator[Pair]:
    """Pair shots by their places in the lists or, if a shot was added or removed, by how they were fired."""
    parts = [[0, len(was), 0, len(now)]]
    if len(was) != len(now):
        keys = [[key_of(shot, "weapon", "at", "aim") for shot in shots] for shots in (was, now)]
        matcher = difflib.SequenceMatcher(a=keys[0], b=keys[1], autojunk=False)
        parts = [places for _, *places in matcher.get_opcodes()]
    for first, last, begin, end in parts:
        for before, after in itertools.zip_longest(was[first:last], now[begin:end]):
            yield before if after is None else after, before, after


def _gained_and_lost(was: Any, now: Any) -> list[str]:
    """Phrases about the pixels that are in only one of two lists of runs [y, x_first, x_last]."""
    if not (_are_runs(was) and _are_runs(now)):
        return []
    phrases = []
    for word, kept, others in (("gained", now, was), ("lost", was, now)):
        runs = _left(kept, others)
        count = sum(last - first + 1 for _, first, last in runs)
        pixels = itertools.islice(((x, y) for y, first, last in runs for x in range(first, last + 1)), PIXELS_NAMED)
        names = ", ".join(f"({x}, {y})" for x, y in pixels)
        more = f" and {count - PIXELS_NAMED} more" if count > PIXELS_NAMED else ""
        phrases += [f"{word} at {names}{more}"] if count else []
    return phrases


def _left(runs: Any, taken: Any) -> list[tuple[int, int, int]]:
    """Runs without the pixels of others."""
    rows: dict[int, list[Any]] = {}
    for run in sorted(taken):
        rows.setdefault(run[0], []).append(run)
    left = []
    for y, first, last in runs:
        free = first
        for _, begin, end in rows.get(y, ()):
            if begin <= last and end >= free:
                left.append((y, free, begin - 1))
                free = end + 1
        left.append((y, free, last))
    return [run for run in left if run[1] <= run[2]]


def _are_runs(value: Any) -> bool:
    return isinstance(value, list | tuple) and all(
        isinstance(run, list | tuple) and len(run) == 3 and all(type(v) is int for v in run) for run in value
    )


def _fields(was: Entry, now: Entry, keys: Iterable[str]) -> list[str]:
    """Phrases about the given fields that differ."""
    phrases = []
    for key in keys:
        before, after = was.get(key, ABSENT), now.get(key, ABSENT)
        if not same(before, after) and key == "first_xy":
            phrases.append(f"first at ({_place(after)}), was ({_place(before)})")
        elif isinstance(before, dict) and isinstance(after, dict):
            phrases += by_path(key, before, after)
        elif not same(before, after):
            phrases.append(f"{key} {shown(after)}, was {shown(before)}")
    return phrases


def _form_of(report: Entry) -> str:
    """Whether a report lists its shots one by one or as a batch, in words."""
    return f"shots listed {'as a batch' if isinstance(report.get('batch'), dict) else 'one by one'}"


def _name(entry: Entry) -> str:
    return f"object {shown(entry.get('object'))} {shown(entry.get('name'))}"


def _count(n: Any, what: str = "px") -> str:
    return f"{shown(n)} {what}" + ("" if what == "px" or n == 1 else "s")


def _place(at: Any) -> str:
    """Position or pixel as text, without brackets."""
    return ", ".join(map(shown, at)) if isinstance(at, list | tuple) else shown(at)
