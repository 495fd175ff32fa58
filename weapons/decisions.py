"""What a method decided, and by how much that differs from the truth: the error axis of the study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planes.arrays import Floats, Ints
from weapons.columns import Columns

__all__ = ["Curve", "Decisions", "Errors", "Method", "Question", "errors_of"]


@dataclass(frozen=True, eq=False)
class Decisions(Columns):
    """Pairs (shot, object) that are hit; a pair that is not there is not hit.

    Parameters
    ----------
    shot, object : (K,) int64
    xy : (K, 2) float, px: where, as the method tells it; NaN where it tells nothing
    share : (K,) float: how much of the shot lies on the object, 0 to 1; NaN where the method tells nothing
    """

    object: Ints
    xy: Floats
    share: Floats

    @classmethod
    def of(cls, shot: Ints, object: Ints, xy: Floats | None = None, share: Floats | None = None) -> Decisions:  # noqa: A002
        """Decisions without what the method does not tell."""
        n = len(shot)
        return cls(
            np.asarray(shot, np.int64),
            np.asarray(object, np.int64),
            np.full((n, 2), np.nan) if xy is None else xy,
            np.full(n, np.nan) if share is None else share,
        )


class Errors(NamedTuple):
    """How wrong a method was.

    `missed` are hits that it did not see, `false` are hits that were none; `share` is the mean of the absolute error of
    the share over all pairs that are hit in truth or by the method, `position` the mean distance of the place hit from
    the true one, px, over pairs that both hit; None where there is nothing to compare. `objects` has the object of each
    wrong decision.
    """

    missed: int
    false: int
    share: float | None
    position: float | None
    objects: Ints

    @property
    def wrong(self) -> int:
        """Wrong decisions, of both kinds."""
        return self.missed + self.false


def errors_of(found: Decisions, truth: Decisions) -> Errors:
    """Compare what a method decided with the truth; both have each pair once."""
    shot, item = (np.concatenate([getattr(found, n), getattr(truth, n)]) for n in ("shot", "object"))
    objects = int(item.max(initial=0)) + 1
    pairs, where = np.unique(shot * objects + item, return_inverse=True)
    row = np.full((2, len(pairs)), -1)
    row[0, where[: len(found)]] = np.arange(len(found))
    row[1, where[len(found) :]] = np.arange(len(truth))
    both = (row >= 0).all(axis=0)
    share = [np.where(r >= 0, np.append(d.share, 0.0)[r], 0.0) for r, d in zip(row, (found, truth), strict=True)]
    apart = found.xy[row[0, both]] - truth.xy[row[1, both]]
    missed, false = row < 0
    return Errors(
        int(missed.sum()),
        int(false.sum()),
        None if len(found) and np.isnan(found.share).all() else _mean(np.abs(share[0] - share[1])),
        _mean(_lengths(apart)),
        pairs[missed | false] % objects,
    )


def _lengths(xy: Floats) -> Floats:
    return np.asarray(np.sqrt((xy**2).sum(axis=1)))


def _mean(values: Floats) -> float | None:
    """Mean of what is known; None where nothing is, or where the method tells nothing."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None


@dataclass(frozen=True, eq=False)
class Method:
    """One point of a curve: a way to decide, at one setting.

    Parameters
    ----------
    setting : its value, in the unit of the curve; None where there is nothing to set; or a word
    prepare : makes what is kept for all shots, and returns the run; its time is the set-up's
    read : what a run returns, as decisions; not timed
    kept_bytes : bytes that are kept, of what a run returned; None where they are traced, which slows a set-up down
    """

    setting: float | str | None
    prepare: Callable[[], Callable[[], Any]]
    read: Callable[[Any], Decisions]
    kept_bytes: Callable[[Any], int] | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """A method over its own setting.

    Parameters
    ----------
    name : of the method
    setting : what is set, with its unit; "" where nothing is
    methods : in the order of the curve, from coarse to fine
    note : what a reader must know to compare it, as that it answers an easier question
    left_out : why it was not measured; then there are no methods
    """

    name: str
    setting: str = ""
    methods: tuple[Method, ...] = ()
    note: str = ""
    left_out: str = ""


@dataclass(frozen=True, eq=False)
class Question:
    """What is decided, of which shots, what is true, and the methods that try.

    Parameters
    ----------
    name : one word, for files
    asks : the question, a sentence
    shots : number of shots
    truth : the right answers
    truth_told : where they come from
    curves : of the methods
    aimed : (N,) the object near which each shot is, to tell kinds of objects apart; None where that means nothing
    by_share : whether the share is what is asked for: then its error is the error, and not the wrong decisions
    """

    name: str
    asks: str
    shots: int
    truth: Decisions
    truth_told: str
    curves: tuple[Curve, ...]
    aimed: Ints | None = None
    by_share: bool = False
