"""Prepared weapons, which fire one shot a call at little cost.

scene, weapon -> rounds and position cache -> one look-up a shot -> hits
"""

from __future__ import annotations

import threading
from math import floor
from types import ModuleType
from typing import TYPE_CHECKING, Any, Generic, NoReturn, TypeVar, Unpack, cast, overload

import numpy as np

from hitplanes.planes.common.backend import LruCache, kernels_of
from hitplanes.planes.common.checks import InputError, Ints, kind_of
from hitplanes.planes.common.limits import ALL, HALF, POSITION_MAX, SUB
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from ..fire.call import category_bits, check_owners, fire_anew
from ..fire.hits import Hits
from ..kinds.areas import Rays, are_followed, parts_of, ray_parts_of
from ..kinds.placements import accepted_of, blocking_of, checked_filter, checked_owners, checked_seeds
from ..kinds.weapon import Weapon
from . import position_cache
from .one_shot import Arguments, Filter, OneShot, Present, reach_of, rounds_of
from .position_cache import CELL_SHIFT, FARTHEST, FILTER_BYTES, KEPT_BYTES, ODD, PIXEL, Look

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..fire.call import Angles, Filtered, Places, Wholes
    from ..rays.ray_hits import RayHits

AnyHits = TypeVar("AnyHits", bound=Hits, covariant=True)

AIMS_BYTES = 32 * 2**20
"""Most memory of the patterns of aims and shot numbers, as integer rows, bytes."""

AIM_BYTES = 200
"""Memory of an aim or a shot number in addition to its patterns, bytes."""

FILTERS_MOST = 128
"""Filters and seeds of a weapon that are kept ready: those of the last shots, as each shooter excludes itself."""

Looks = list[tuple[int, int, Look]]
"""Each round of a shot: its pixel relative to the shot's, and the function that looks up what it hits."""

PLAIN = float, int
NUMPY_NUMBERS = frozenset((np.float64, np.float32, np.float16, *(np.dtype(k).type for k in "bBhHiIlLqQ")))


class Ready(Generic[AnyHits]):
    """A weapon that `prepare` made ready for a scene: `ready.fire(at)` equals `fire(scene, weapon, at)` at less cost.

    A shot looks up data that is made once, when a shot first needs it:

    - the pattern of each aim, and of each shot number of a `Spread`, as bits;
    - the visible set, which `fire` uses, too, once it has paid for itself; before, shots walk the tiles of the items;
    - for each square of 32 x 32 px, the tiles of the visible set that shots in the square may reach (see
      `position_cache`).

    With compiled kernels there are no squares: one call of a kernel looks up the cells of the visible set (see
    `compiled`).

    Every shot compares versions. If the scene has changed, all that was looked up is discarded first, so that no answer
    is of an older scene. The choice between numpy and compiled kernels is made at the same time.

    Patterns of up to 1000 px are looked up; weapons of one ray are cast, and bursts, spreads and sweeps of a few rays
    that end at their first hit (see `prepared_ray`). These are left to `fire`:

    - other weapons of several rays, and rays that must walk (see `prepared_ray`)
    - weapons with a line of sight, and spreads of many or far pellets
    - larger patterns, and in numpy large patterns near which there are many items
    - bursts whose recoil is not a whole number of pixels
    - batches and bad input

    Threads may fire one Ready at a scene that none of them changes.
    """

    def __init__(self, scene: Scene, weapon: Weapon, kept: Filter) -> None:
        self.scene, self.weapon = scene, weapon
        self._filter = kept
        self._items, self._version, self._lock = scene.items, -1, threading.Lock()
        self._filtered: LruCache[tuple[object, ...], Ready[AnyHits]] = LruCache(FILTERS_MOST, lambda _: 1)

    def __reduce__(self) -> NoReturn:
        how = "pickle or copy its scene and its weapon instead, and prepare the weapon again"
        raise InputError(f"ready: a prepared weapon cannot be pickled or copied: {how}")

    def _with(self, kept: Filter) -> Ready[AnyHits]:
        return Ready(self.scene, self.weapon, kept)

    def fire(
        self, at: Places, aim: Angles | None = None, toward: Places | None = None, shot: Wholes | None = None
    ) -> AnyHits:
        """Decide what one shot hits; all other arguments of `fire`, such as `accept`, are given to `prepare`."""
        kept = self._filter
        exclude = [kept.exclude] if kept.exclude else None  # one row for all shots
        filters = accepted_of(kept.meets), blocking_of(kept.meets), exclude
        hits = fire_anew(self.scene, self.weapon, at, aim, toward, filters, kept.seed, shot)
        return cast("AnyHits", hits)

    def _follow(self) -> None:
        """Read the scene as it is now, once, also if several threads fire."""
        with self._lock:
            items = self.scene.items  # so masks that were not made yet are made
            version = items.version
            if version != self._version:
                self._read(version, items.stack())
                self._version = version

    def _read(self, version: int, stack: Stack) -> None:
        """Read the scene at a version."""

    def _snapshot(self, version: int, stack: Stack, near: Any = None, cost: Ints | None = None) -> Present:
        scene = self.scene
        weapon, imagery = self.weapon, scene.items.imagery()
        return Present(scene, version, stack, scene.bounds, weapon, self._filter, imagery, near, cost)


class AimCache:
    """What a weapon looks up at each of its aims and shot numbers; all of its filters share it.

    Parameters
    ----------
    kernels : `position_cache`, or its compiled form
    """

    def __init__(self, scene: Scene, weapon: Weapon, kernels: Any) -> None:
        _, spread, plain = parts_of(weapon)
        self.ground = kernels.GroundCache(scene, plain.pierce)
        self._weapon, self._look = weapon, kernels.look
        self._directed, self._drawn = plain.directed, spread is not None
        self._looks: dict[object, Looks] = {}
        self._looks_of: dict[tuple[object, object, int], Looks] = {}
        self._lock = threading.Lock()
        self.nbytes = 0

    def known(self, aim: object, toward: object, shot: object, seed: int) -> Looks:
        """Looks of an aim and a shot number that were used before; KeyError if they were not."""
        plain = toward is None and (type(aim) is float or aim is None or type(aim) is int)
        if plain and (shot is None or type(shot) is int):  # True is refused, though it equals the key 1
            return self._looks_of[aim, shot, seed if self._drawn else 0]
        raise KeyError

    def looks(
        self, place: tuple[float, float], aim: object, toward: object, shot: object, kept: Filter
    ) -> Looks | None:
        """Looks of a shot; None if an argument must be checked by `fire`."""
        number, offset = 0, None
        if shot is not None:
            if type(shot) is not int or not 0 <= shot < 2**63:
                return None
            number = shot if self._drawn else 0
        if toward is not None:
            target = plain_pair(toward)
            if target is None or aim is not None:
                return None
            offset = round(SUB * target[0]) - round(SUB * place[0]), round(SUB * target[1]) - round(SUB * place[1])
            if offset == (0, 0):
                return None
        elif aim is not None and not (isinstance(aim, float | int) and type(aim) in PLAIN and abs(aim) <= POSITION_MAX):
            return None
        seed = kept.seed if self._drawn else 0
        key = (number, seed, aim, offset) if self._directed else (number, seed)
        looks = self._looks.get(key)
        if looks is None:
            looks = self._looks[key] = self._made(aim, offset, number, kept)
        if looks and toward is None:
            self._looks_of[aim, shot, seed] = looks
            self._grow(AIM_BYTES)
        return looks

    def _made(self, aim: Any, offset: tuple[int, int] | None, number: int, kept: Filter) -> Looks:
        looks: Looks = []
        for fired in rounds_of(self._weapon, kept.shot_at_origin(aim, number), offset):
            look, size = self._look(fired)
            looks.append((fired.x, fired.y, look))
            self._grow(size)
        self._grow(AIM_BYTES)
        return looks

    def _grow(self, size: int) -> None:
        """Count the memory of aims, and discard all of them if it exceeds AIMS_BYTES."""
        with self._lock:
            self.nbytes += size
            if self.nbytes > AIMS_BYTES:
                self._looks, self._looks_of, self.nbytes = {}, {}, size


class ReadyPattern(Ready[Hits]):
    """Prepared weapon whose pattern is looked up; `aims` are by kernels."""

    def __init__(
        self, scene: Scene, weapon: Weapon, kept: Filter, reach: int, aims: dict[ModuleType, AimCache] | None = None
    ) -> None:
        super().__init__(scene, weapon, kept)
        self._reach = reach
        self._kernels: ModuleType | None = None
        self._aims_by: dict[ModuleType, AimCache] = {} if aims is None else aims
        self._room = KEPT_BYTES if aims is None else FILTER_BYTES
        self._aims: AimCache
        self._near: Any
        self._present: Present
        self._straight: Look
        self._quick: Any = {}

    def _with(self, kept: Filter) -> ReadyPattern:
        return ReadyPattern(self.scene, self.weapon, kept, self._reach, self._aims_by)

    def fire(self, at: Any, aim: object = None, toward: object = None, shot: object = None) -> Hits:
        """Decide what one shot hits; all other arguments of `fire`, such as `accept`, are given to `prepare`."""
        if self._items.version != self._version:
            self._follow()
        try:
            if type(at) is tuple:
                x, y = at
                kind = type(x)
                if kind is type(y) and (kind is float or kind is int):
                    if aim is None and toward is None and shot is None:
                        hits: OneShot = OneShot()
                        quick = self._quick
                        hits._present, hits._at = self._present, at
                        if quick is None:
                            self._straight(x, y, hits)
                            return hits
                        column, row = floor(x + PIXEL), floor(y + PIXEL)
                        if quick[column >> CELL_SHIFT, row >> CELL_SHIFT]:
                            if x == ODD or y == ODD:  # its pixel would be wrong by one
                                return self._looked_up(at, aim, toward, shot)
                            self._straight(column, row, hits)
                        return hits
                    looks = self._aims.known(aim, toward, shot, self._filter.seed)
                    if -FARTHEST < x < FARTHEST and -FARTHEST < y < FARTHEST and x != ODD and y != ODD:
                        return self._answer_at(at, (aim, None, shot), floor(x + PIXEL), floor(y + PIXEL), looks)
        except (KeyError, ValueError, OverflowError, TypeError):  # not made yet, too far, or not a pair
            pass
        return self._looked_up(at, aim, toward, shot)

    def _looked_up(self, at: Any, aim: Any, toward: Any, shot: Any) -> Hits:
        """Fire with arguments that are not in the cache yet, or of unusual types."""
        place, angle, number = plain_pair(at), plain_number(aim), plain_number(shot)
        looks = None if place is None else self._aims.looks(place, angle, toward, number, self._filter)
        if place is None or looks is None or max(map(abs, place)) > FARTHEST:
            return super().fire(at, aim, toward, shot)
        if aim is None is toward and shot is None and len(looks) == 1 and looks[0][:2] == (0, 0):
            self._straight, self._quick = looks[0][2], self._near.quick
        x, y = ((round(SUB * v) + HALF) >> 8 for v in place)
        arguments = angle, None if toward is None else plain_pair(toward), number
        try:
            return self._answer_at(place, arguments, x, y, looks)
        except KeyError:  # too many items are near
            return super().fire(at, aim, toward, shot)

    def _answer_at(self, at: tuple[float, float], arguments: Arguments, x: int, y: int, looks: Looks) -> OneShot:
        """Look up all rounds of a shot at a pixel."""
        hits: OneShot = OneShot()
        hits._present, hits._at, hits._arguments = self._present, at, arguments
        for dx, dy, look in looks:
            look(x + dx, y + dy, hits)
        return hits

    def _read(self, version: int, stack: Stack) -> None:
        kernels = kernels_of(position_cache)
        if kernels is not self._kernels:
            if kernels not in self._aims_by:
                self._aims_by[kernels] = AimCache(self.scene, self.weapon, kernels)
            self._kernels, self._aims, self._quick = kernels, self._aims_by[kernels], {}
            self._near = kernels.PositionCache(self.scene, self._aims.ground, self._filter, self._reach, self._room)
        self._near.follow(stack)
        self._present = self._snapshot(version, stack, self._near)


def plain_number(value: Any) -> Any:
    """Number of numpy as one of Python; any other value unchanged."""
    return value.item() if type(value) in NUMPY_NUMBERS else value


def plain_pair(value: object) -> tuple[float, float] | None:
    """Pair of Python numbers within the limits; None for anything that `fire` must check."""
    if type(value) is tuple and len(value) == 2 and type(value[0]) is float is type(value[1]):
        pair: Any = value
    elif type(value) is np.ndarray and value.shape == (2,) and value.dtype.kind in "iuf" and value.itemsize <= 8:
        pair = tuple(value.tolist())
    elif type(value) in (tuple, list) and len(value) == 2:  # type: ignore[arg-type]
        pair = tuple([plain_number(v) for v in value])  # type: ignore[attr-defined]
    else:
        return None
    for v in pair:
        if type(v) not in PLAIN or not -POSITION_MAX <= v <= POSITION_MAX:
            return None
    x, y = pair
    return x, y


@overload
def prepare(scene: Scene, weapon: Rays, **how: Unpack[Filtered]) -> Ready[RayHits]: ...
@overload
def prepare(scene: Scene, weapon: Weapon, **how: Unpack[Filtered]) -> Ready[Hits]: ...
def prepare(
    scene: Scene,
    weapon: Weapon,
    *,
    accept: object = ALL,
    blocked_by: object = ALL,
    exclude: object = None,
    seed: object = 0,
) -> Ready[Any]:
    """Make a weapon ready to be fired at a scene one shot a call.

    Parameters
    ----------
    scene : the scene that is fired at; it may change at any time, and each shot sees it as it is then
    weapon, accept, blocked_by, exclude, seed : arguments of `fire`, the same for all shots; `exclude` is a number or a
        list (K,)

    Raises
    ------
    InputError
        Naming the argument.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {kind_of(scene)}")
    kept = _filter_of(scene, accept, blocked_by, exclude, seed)
    parts = ray_parts_of(weapon)
    if parts is not None:
        if not are_followed(parts):
            return Ready(scene, weapon, kept)
        from .prepared_ray import ReadyRay, ReadyRays

        single = parts[:2] == (None, None)
        return ReadyRay(scene, weapon, kept, parts[2]) if single else ReadyRays(scene, weapon, kept, parts)
    reach = reach_of(weapon)
    return Ready(scene, weapon, kept) if reach is None else ReadyPattern(scene, weapon, kept, reach)


def filtered(
    ready: Ready[AnyHits], accept: int, blocked_by: int, exclude: tuple[int, ...], seed: int
) -> Ready[AnyHits]:
    """The same weapon with another filter and seed; those of the last shots are kept, and share its patterns."""
    key = accept, blocked_by, exclude, seed
    return ready._filtered.get(key, lambda: ready._with(_filter_of(ready.scene, *key)))


def _filter_of(scene: Scene, accept: object, blocked_by: object, exclude: object, seed: object) -> Filter:
    """Check the filter of one shot."""
    bits = category_bits(scene, "accept", accept), category_bits(scene, "blocked_by", blocked_by)
    meets, owners = checked_filter(*bits, 1), checked_owners(exclude, 1, single=True)
    check_owners(scene, owners, exclude)
    of_shot = owners if isinstance(owners, tuple) else tuple(owners[0].tolist())
    return Filter(_only(meets), of_shot, _only(checked_seeds(seed, 1)))


def _only(value: npt.NDArray[Any] | int) -> int:
    """A value of one shot."""
    return value if isinstance(value, int) else int(value[0])
