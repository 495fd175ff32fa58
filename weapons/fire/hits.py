"""Hits, the answer of a call: a row for each object that a round of a shot hit, verdict counts, and explanations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from operator import index
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from hitplanes.planes.bits.span_walk import Verdict
from hitplanes.planes.common.backend import cached_attribute
from hitplanes.planes.common.checks import Bools, InputError, Ints, integer, shown
from hitplanes.planes.common.limits import WEIGHT_FULL
from hitplanes.planes.grid.spans import Spans
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import parts_of, ray_parts_of
from ..kinds.placements import ONES, ZEROS, ShotColumns, Shots
from ..kinds.weapon import Weapon
from .plan import Plan
from .prefilter import QueryContext

if TYPE_CHECKING:
    from ..explain.margins import Margin
    from ..explain.owners import OwnerRow, Pellet
    from ..explain.samples import Blocked, Detail, Samples, Share, WhyNot


class HitRow(NamedTuple):
    """One object hit by one round of one shot.

    `shot` counts within the batch; `samples` counts pixels of all pellets, `pixels` each pixel once; `weight` adds
    whole weights (65,535 a sample at full strength, of rays a pass); `pellets` counts those that hit; `first_xy` is the
    hit pixel nearest to the round's pixel and `distance2` its squared distance, px^2.
    """

    shot: int
    round: int
    object: int
    samples: int
    pixels: int
    weight: int
    pellets: int
    first_xy: tuple[int, int]
    distance2: int


@dataclass(frozen=True, eq=False, init=False)
class Rows(ShotColumns):
    """Columns of rows, ordered by (shot, round, distance2, first y, first x, place in the stack).

    A column that is not given is made by DEFAULTS when it is read; `distinct` then counts `pixels`, if it is given.
    """

    __slots__ = ("_distinct",)

    round: Ints
    object: Ints
    samples: Ints
    pixels: Ints
    weight: Ints
    pellets: Ints
    first_xy: Ints
    distance2: Ints

    def __init__(self, *columns: Ints | None, distinct: Callable[[], Ints] | None = None, **named: Any) -> None:
        """Columns in the order of a `HitRow`, or by their names; those of DEFAULTS may be missing, or None."""
        object.__setattr__(self, "_distinct", distinct)
        given = dict(zip(HitRow._fields[: len(columns)], columns, strict=True)) | named
        vars(self).update({name: column for name, column in given.items() if column is not None})

    def __getattr__(self, name: str) -> Any:
        """Make a column that was not given."""
        if name not in DEFAULTS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        column = vars(self)[name] = DEFAULTS[name](self)
        return column

    @property
    def nbytes(self) -> int:
        """Bytes of the columns that were given or made."""
        return 8 * len(self.shot) * (len(vars(self)) + 1)  # `first_xy` has two numbers a row

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Rows, **self._counted()), ()

    def _counted(self) -> dict[str, Any]:
        """Columns by their names, without those that DEFAULTS make of others."""
        return vars(self) if self._distinct is None else {**vars(self), "pixels": self.pixels}

    def take(self, rows: Ints | Bools | slice) -> Rows:
        """Some of the rows."""
        return Rows(**{name: column[rows] for name, column in self._counted().items()})

    def later(self, shots: int) -> Rows:
        """The same rows, with `shots` added to each shot number."""
        return Rows(**vars(self) | {"shot": self.shot + shots}, distinct=self._distinct) if shots else self

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """Rows of several parts, one after another."""
        if len(parts) == 1:
            return parts[0]
        given = [name for name in HitRow._fields if any(name in vars(part) for part in parts)]
        columns = {name: _joined(parts, name) for name in given}
        distinct = partial(_joined, parts, "pixels") if any(part._distinct for part in parts) else None
        return cls(**columns, distinct=distinct) if parts else cls.none()

    @classmethod
    def none(cls) -> Rows:
        """No rows."""
        none = np.zeros(0, np.int64)
        return cls(shot=none, object=none, first_xy=np.zeros((0, 2), np.int64))


def _joined(parts: Sequence[Rows], name: str) -> Ints:
    """A column of several parts, one after another."""
    return np.concatenate([getattr(part, name) for part in parts])


DEFAULTS: dict[str, Callable[[Rows], Ints]] = {
    "round": lambda rows: ZEROS[: len(rows)],
    "samples": lambda rows: ONES[: len(rows)],
    "pixels": lambda rows: rows.samples if rows._distinct is None else rows._distinct(),
    "weight": lambda rows: rows.samples * WEIGHT_FULL,
    "pellets": lambda rows: ONES[: len(rows)],
    "distance2": lambda rows: ZEROS[: len(rows)],
}
"""Columns that may be missing, and how each is made: round 0, one sample, full weight, one pellet, distance 0."""


def _column(name: str, doc: str) -> cached_attribute[Ints]:
    """A column of hits, read-only."""

    def made(hits: Hits) -> Ints:
        rows = hits._rows
        given: Ints | None = vars(rows).get(name)
        column = DEFAULTS[name](rows) if given is None else given
        column.flags.writeable = False
        return column

    made.__doc__ = doc
    return cached_attribute(made)


BEFORE = "read this before the scene changes, or fire at scene.copy() or at a History, which stay as they are"
"""How to keep what an answer still needs of a scene."""


class Hits:
    """What a call of `fire` hit.

    Its columns (`shot`, `round`, `object`, `samples`, `pixels`, `weight`, `pellets`, `first_xy`, `distance2`) are
    arrays with one entry a row, in a total order. It has a length (rows), is true if anything was hit, and yields named
    rows; `hits[k]` is one of them, and a slice a list. Two are equal when their rows and verdict counts are equal; plan
    and version are not compared.

    Parameters
    ----------
    starts : (N + 1,) the rows of shot i are starts[i] .. starts[i + 1] - 1
    verdicts : (N, 5), of rays (N, 6): samples of each shot by verdict, in the order of `Verdict`
    fired : (N,) samples of each shot
    plan : what ran and what was left out
    scene, version : the scene, and its version when it was fired at; the first scene, if there are several ticks
    weapon, shots : the weapon, and the checked shots
    """

    shot = _column("shot", "Number of the shot in the batch.")
    round = _column("round", "Number of the round in its burst.")
    object = _column("object", "Id of the object that was hit.")
    samples = _column("samples", "Hit pixels of all pellets; of rays hit cells.")
    pixels = _column("pixels", "Hit pixels, each once.")
    weight = _column(
        "weight", "Sum of whole weights: 65,535 a sample at full strength; of rays 65,535 a pass, at its first cell."
    )
    pellets = _column("pellets", "Pellets that hit.")
    first_xy = _column("first_xy", "Hit pixel (n, 2) nearest to the round's pixel; of rays the first cell.")
    distance2 = _column("distance2", "Squared distance of `first_xy` from the round's pixel, px^2.")
    _scenes: list[Scene] | None = None
    _versions: Mapping[int, int] = MappingProxyType({})  # of scenes of the past that came out of a pickle, by id
    _walked: tuple[int, Any] | None = None

    def __init__(
        self,
        rows: Rows,
        counted: Callable[[], Ints],
        scene: Scene,
        stack: Stack,
        weapon: Weapon,
        shots: Shots,
        plan: Plan,
    ) -> None:
        self._keep(rows, scene, stack, weapon, shots, plan)
        self._counted = counted

    def _keep(self, rows: Rows, scene: Scene, stack: Stack, weapon: Weapon, shots: Shots, plan: Plan) -> None:
        self._rows, self.weapon, self.shots, self.plan = rows, weapon, shots, plan
        self.scene, self.version, self._stack = scene, scene.items.version, stack

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the answer, worked out, with its scenes; the copy of a stale one is stale, too."""
        behind = 0 if self._scenes is not None else self.scene.version - self.version
        kept = self._rows, self.scene, self._stack if behind else None, self.weapon, self.shots, self.plan
        return _restored, (self._kind(), self._answers(), kept, behind, self._scenes)

    def _kind(self) -> type[Hits]:
        """Class of a copy."""
        return Hits

    def _answers(self) -> dict[str, Any]:
        """What is worked out from the scene, for a copy."""
        return {"verdicts": self.verdicts}

    @property
    def nbytes(self) -> int:
        """Bytes of the columns."""
        return self._rows.nbytes

    @cached_attribute
    def starts(self) -> Ints:
        """The rows of shot i are starts[i] .. starts[i + 1] - 1."""
        starts = np.concatenate([[0], np.cumsum(np.bincount(self.shot, minlength=len(self.shots)))])
        starts.flags.writeable = False
        return starts

    @cached_attribute
    def verdicts(self) -> Ints:
        """Samples of each shot by verdict, counted when they are first asked for."""
        verdicts = self._counted()
        verdicts.flags.writeable = False
        return verdicts

    @property
    def fired(self) -> Ints:
        """Samples of each shot."""
        fired = np.asarray(self.verdicts.sum(axis=1))
        fired.flags.writeable = False
        return fired

    def __len__(self) -> int:
        return len(self._rows)

    def __bool__(self) -> bool:
        return len(self._rows) > 0

    def __iter__(self) -> Iterator[HitRow]:
        columns = [getattr(self, name).tolist() for name in HitRow._fields]
        for row in zip(*columns, strict=True):
            yield _named(row)

    @overload
    def __getitem__(self, row: SupportsIndex) -> HitRow: ...
    @overload
    def __getitem__(self, row: slice) -> list[HitRow]: ...
    def __getitem__(self, row: SupportsIndex | slice) -> HitRow | list[HitRow]:
        if isinstance(row, slice):
            columns = [getattr(self, name)[row].tolist() for name in HitRow._fields]
            return [_named(values) for values in zip(*columns, strict=True)]
        try:
            number = range(len(self))[index(row)]
        except (TypeError, IndexError) as error:
            said = f"hits: expected the number of one of {len(self)} rows, from 0, or a slice, got {shown(row)}"
            raise type(error)(said) from None
        return _named(tuple(getattr(self, name)[number].tolist() for name in HitRow._fields))

    def __eq__(self, other: Any) -> bool:
        if not isinstance(other, Hits):
            return NotImplemented
        names = (*HitRow._fields, "verdicts")
        return all(np.array_equal(getattr(self, n), getattr(other, n)) for n in names)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Hits: {len(self)} rows of {len(self.shots)} shots, {self.verdict_counts()}>"

    def of(self, shot: int) -> list[HitRow]:
        """Rows of one shot."""
        row = self._checked(shot)
        return self[self.starts[row] : self.starts[row + 1]]

    def verdict_counts(self, shot: int | None = None) -> dict[str, int]:
        """Samples by verdict, of one shot or of all; they add up to the samples fired."""
        counts = self.verdicts.sum(axis=0) if shot is None else self.verdicts[self._checked(shot)]
        return {verdict.name.lower(): n for verdict, n in zip(Verdict, counts.tolist(), strict=False)}

    def by_owner(self) -> list[OwnerRow]:
        """Rows of each shot and owner added up, ordered by (shot, first row of the owner).

        Owners are those that the objects had when they were fired at.
        """
        several = (ray_parts_of(self.weapon) or parts_of(self.weapon))[1] is not None
        return late.owners.owner_rows(self, lambda shot: self._then(shot)[1], self._pellets if several else None)

    def _pellets(self, shots: Sequence[int]) -> Iterator[Pellet]:
        """Pellets of some shots that hit, each with each of its objects."""
        for _, same in groupby(shots, lambda shot: id(self._then(shot)[0])):
            own = list(same)
            found = late.owners.area_pellets(self._context(own[0]), self.weapon, self.shots.pick(np.array(own)))
            yield from ((own[shot], round_, pellet, item) for shot, round_, pellet, item in found)

    def to_rows(self) -> list[dict[str, Any]]:
        """Rows as JSON."""
        return self._rows.to_rows()

    def to_dict(self) -> dict[str, Any]:
        """Rows and verdict counts as JSON."""
        return {
            "rows": self.to_rows(),
            "verdicts": [self.verdict_counts(shot) for shot in range(len(self.shots))],
            "plan": self.plan.to_dict(),
        }

    def to_numpy(self) -> npt.NDArray[np.void]:
        """Rows as a structured array (n,) of their own, with the columns as fields; `first_xy` is (n, 2)."""
        columns = {name: getattr(self, name) for name in HitRow._fields}
        table = np.empty(len(self), [(name, column.dtype, column.shape[1:]) for name, column in columns.items()])
        for name, column in columns.items():
            table[name] = column
        return table

    def to_shot(self, shot: int = 0) -> dict[str, Any]:
        """One shot as a scene file has it, for `scene.shots`: fired from there it hits the same.

        Its weapon is the name of an equal one in `scene.weapons`, or the weapon as JSON. Positions are in 1/256 px. An
        `aim` is as it was given; one beyond 10^9 degrees, which files refuse, is its remainder by 360. Excluded owners
        of nothing that could be hit or block are left out. A shot of the past is one of `hits.scene_of(shot).copy()`.
        """
        row = self._checked(shot)
        return late.shot_log.shot_json(self.weapon, self._one(row), *self._then(row))

    def samples_at(self, shot: int = 0) -> Samples:
        """All samples of one shot: pixel, pellet, verdict, and the item that decided it."""
        return late.samples.samples_of(self._detail(shot))

    def pixels_at(self, shot: int = 0) -> dict[tuple[int, int], Spans]:
        """Pixels that each round of one shot hit of each object, as {(round, object): pixels}."""
        return late.samples.hit_spans(self._detail(shot))

    def object_pixels(self) -> dict[int, Spans]:
        """Pixels that all shots together hit of each object, as {object: pixels}; `Scene.carve` takes them away."""
        self._scene_then(0)  # raises if the scene has changed, also if nothing was hit
        shots_of: dict[int, list[int]] = {}
        for shot in np.unique(self.shot).tolist():
            shots_of.setdefault(id(self.scene_of(shot)), []).append(shot)
        rows = (np.array(shots) for shots in shots_of.values())
        parts = (self._pixels_of(self.scene_of(int(own[0])), self.shots.pick(own)) for own in rows)
        return late.samples.united(part for own in parts for part in own)

    def _pixels_of(self, scene: Scene, shots: Shots) -> Iterator[tuple[int, Spans]]:
        """Pixels of objects of a scene that shots hit, as (object, pixels), in any number of parts."""
        context = late.spans.context_of(scene, scene.items.stack(), self.weapon, shots)
        return late.samples.object_spans(context, self.weapon, shots)

    def shares(self, shot: int | None = None) -> list[Share]:
        """Samples of each row as shares of the pattern, of the visible object and of its mask; for a shot, or all."""
        if self._scenes is None:
            rows = list(self) if shot is None else self.of(shot)
            return late.samples.shares_of(self._context(0), self.weapon, self.shots, rows)
        numbers = range(len(self.shots)) if shot is None else [self._checked(shot)]
        return [
            share
            for i in numbers
            for share in late.samples.shares_of(self._context(i), self.weapon, self.shots, self.of(i))
        ]

    def why_not(self, shot: int = 0) -> list[WhyNot]:
        """Objects within 32 px of one shot that it did not hit, and why."""
        hit = {row.object for row in self.of(shot)}
        return late.samples.why_not_of(self._detail(shot), hit)

    def blockers(self, shot: int = 0) -> list[Blocked]:
        """Occluders that ended samples of one shot, most samples first, and the objects behind them there."""
        return late.samples.blockers_of(self._detail(shot))

    def margins(self, shot: int | None = None) -> list[Margin]:
        """How far the verdicts of one shot, or of all, are from flipping, by (shot, object).

        A margin is the shortest whole-pixel shift of the pattern, up to 8 px, that turns an object from hit to not
        hit or back. A margin of 1 px is fragile.
        """
        found: list[Margin] = []
        for row in range(len(self.shots)) if shot is None else [self._checked(shot)]:
            found += late.margins.pattern_margins(*self._then(row), self.weapon, self._one(row), row)
        return found

    @property
    def has_margins(self) -> bool:
        """Whether margins can be computed; some rays have none."""
        return True

    def _detail(self, shot: int) -> Detail:
        """One shot, sample by sample; the last one asked for is kept."""
        row = self._checked(shot)
        if self._walked is None or self._walked[0] != row:
            own = self.shots.take(row, row + 1)
            context = late.spans.context_of(*self._then(row), self.weapon, own)
            self._walked = row, late.samples.detail_of(context, self.weapon, own)
        return self._walked[1]

    def _one(self, shot: int) -> Shots:
        row = self._checked(shot)
        return self.shots.take(row, row + 1)

    def _checked(self, shot: int) -> int:
        return integer("shot", shot, 0, len(self.shots) - 1)

    def scene_of(self, shot: int) -> Scene:
        """The scene that a shot was fired at; an InputError if the scene has changed since."""
        return self._scene_then(self._checked(shot))

    def _scene_then(self, row: int) -> Scene:
        """The scene of a checked shot; row 0 also serves a call without shots, which has one scene."""
        scene, version = self.scene, self.version
        if self._scenes is not None:
            scene = self._scenes[row]  # of the past, which does not change unless it is a copy
            version = self._versions.get(id(scene), scene.version)
        if scene.version != version:
            raise InputError(f"hits: expected the scene at version {version}, got version {scene.version}: {BEFORE}")
        return scene

    def _then(self, shot: int) -> tuple[Scene, Stack]:
        """The scene that a shot was fired at, which may have changed since, and its stack of then, which stays."""
        if self._scenes is None:
            return self.scene, self._stack
        scene = self.scene_of(shot)
        return scene, scene.items.stack()

    def _context(self, shot: int) -> QueryContext:
        """What a shot of an area weapon was tested against."""
        return late.spans.context_of(*self._then(shot), self.weapon)

    @property
    def one_scene(self) -> bool:
        """Whether all shots were fired at one scene, at one tick."""
        return self._scenes is None or len(set(map(id, self._scenes))) == 1

    @classmethod
    def gathered(cls, parts: Sequence[Hits], rows: Sequence[Ints], shots: Shots) -> Hits:
        """Hits of shots that were fired at several ticks, in the order of the shots.

        Parameters
        ----------
        parts, rows : hits of each tick, which share a plan, and the numbers of its shots
        """
        found = cls(
            cls._gathered_rows(parts, rows),
            lambda: cls._gathered_verdicts(parts, rows),
            *parts[0]._then(0),
            parts[0].weapon,
            shots,
            parts[0].plan,
        )
        found._remember(parts, rows)
        return found

    @staticmethod
    def _gathered_rows(parts: Sequence[Hits], rows: Sequence[Ints]) -> Rows:
        return Rows.gathered([part._rows for part in parts], rows)

    @staticmethod
    def _gathered_verdicts(parts: Sequence[Hits], rows: Sequence[Ints]) -> Ints:
        return np.concatenate([part.verdicts for part in parts])[np.argsort(np.concatenate(rows))]

    def _remember(self, parts: Sequence[Hits], rows: Sequence[Ints]) -> None:
        """Keep the scene of each shot."""
        scene_of = {row: part.scene for part, own in zip(parts, rows, strict=True) for row in own.tolist()}
        self._scenes = [scene_of[row] for row in range(len(self.shots))]


def _restored(
    kind: type[Hits], answers: dict[str, Any], kept: tuple[Any, ...], behind: int, scenes: list[Scene] | None
) -> Hits:
    """Hits of the parts that copies and pickles take."""
    hits = object.__new__(kind)
    rows, scene, stack, *rest = kept
    hits._keep(rows, scene, scene.items.stack() if stack is None else stack, *rest)
    vars(hits).update(answers)
    for columns in answers.values():
        for array in (columns, *getattr(columns, "__dict__", {}).values()):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
    hits.version -= behind
    if scenes is not None:
        hits._scenes, hits._versions = scenes, {id(scene): scene.version for scene in scenes}
    return hits


def _named(row: tuple[Any, ...]) -> HitRow:
    return HitRow._make((*row[:7], tuple(row[7]), row[8]))
