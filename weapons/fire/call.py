"""The call `fire`: check the arguments, and hand the shots to the areas or to the rays.

scene, weapon, at -> checked shots -> `areas` or `rays.ray_call` -> hits
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from copy import copy
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex, TypedDict, Unpack, overload

import numpy as np

from hitplanes.planes.common.backend import keep_arena, news
from hitplanes.planes.common.checks import InputError, Ints, choice, each, kind_of, reals, shown
from hitplanes.planes.common.limits import ALL
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.areas import Rays, are_followed, ray_parts_of
from ..kinds.placements import OWNER_MAX, Shots, checked_shots
from ..kinds.weapon import Weapon
from .areas import Request, leave_out_unused, traits_of
from .hits import Hits, Rows
from .plan import Plan, read_stack, unaimed
from .prefilter import may_refuse, prefilter_of, view_of
from .strategy import AUTO, BROADPHASES, STRATEGIES, chosen_candidates, chosen_way

if TYPE_CHECKING:
    import numpy.typing as npt

    from hitplanes.planes.scene.history import History

    from ..prepared.prepare import Ready
    from ..rays.ray_hits import RayHits

    Angles = SupportsFloat | Sequence[SupportsFloat] | npt.NDArray[Any]
    Places = Sequence[SupportsFloat] | Sequence[Sequence[SupportsFloat]] | Sequence[npt.NDArray[Any]] | npt.NDArray[Any]
    Wholes = SupportsIndex | Sequence[SupportsIndex] | npt.NDArray[Any]
    Categories = str | Sequence[str] | Sequence[Sequence[str]] | Wholes
    Owners = Wholes | Sequence[Sequence[SupportsIndex]]
    """Numbers (N,), points (N, 2), whole numbers (N,), names or bits, and owners (N, K), for type checkers."""

    class Filtered(TypedDict, total=False):
        """What shots pass over, and the seed of their pellets, for type checkers; see `fire`."""

        accept: Categories
        blocked_by: Categories
        exclude: Owners | None
        seed: Wholes

    class Fired(Filtered, total=False):
        """All named arguments of `fire`, for type checkers."""

        aim: Angles | None
        toward: Places | None
        shot: Wholes | None
        tick: Angles | None
        prefilter: str
        broadphase: str
        strategy: str


How = tuple[str, str, str]
"""Pre-filter, broad phase and strategy of a call."""

ONE_AIM = int | float | np.number | None
"""Types of the aim of one shot; several aims have one position, and their filters are those of several shots."""

OWNERS_READY = 16
"""Most owners that a filter which is kept excludes."""

LOOKED_AT = 1000  # most ids among which owners that an error names are looked for
OWNERS_NAMED = 3
"""Most owners that an error names: those of the greatest ids, which are nearest to one that is too great."""


@overload
def fire(scene: Scene | History, weapon: Rays, at: Places, **how: Unpack[Fired]) -> RayHits: ...
@overload
def fire(scene: Scene | History, weapon: Weapon, at: Places, **how: Unpack[Fired]) -> Hits: ...
def fire(
    scene: Scene | History,
    weapon: Weapon,
    at: Any,
    *,
    aim: Any = None,
    toward: Any = None,
    accept: object = ALL,
    blocked_by: object = ALL,
    exclude: object = None,
    seed: object = 0,
    shot: Any = None,
    tick: object = None,
    prefilter: str = "auto",
    broadphase: str = "auto",
    strategy: str = "auto",
) -> Hits:
    """Decide what shots hit.

    Parameters
    ----------
    scene : the Scene that is fired at, or a History, fired at the given ticks
    weapon : one weapon for all shots
    at : (2,) position of one shot, or (N, 2) of a batch, px; with N aims or targets, (2,) is the position of all shots
    aim : () or (N,) angle in degrees, 0 along +x, clockwise on the screen
    toward : (2,) or (N, 2) point that the weapon is aimed at, px; it replaces `aim`
    accept : category names or bits of the objects that may be hit; all by default
    blocked_by : category names or bits of the occluders that block; all by default, and none for [] or 0
    exclude : owners whose items are skipped, such as the shooter: a number, or for one shot a list (K,); for a batch
        (N,), (N, K), or (1, K) for all shots, padded with -1. They are ids of objects that the scene has or had.
    seed : seed of the pellets, 0 .. 2**64 - 1
    shot : numbers of the shots, 0 .. N-1 by default; a shot fired again alone under its number has the same pellets
    tick : time of each shot, if `scene` is a History
    prefilter : "auto", "none", "box", "circle", "oriented box", "4 boxes" (1 to 64), "polygon", "swept": the test
        before the pixels; it changes no row
    broadphase : "auto", "none", "grid", "quadtree", "bvh": how boxes that meet are found; it changes no row, and
        needs a pre-filter
    strategy : how the shots are answered; it changes no row. A way that cannot serve a call is passed over, and the
        plan says why.

        - "auto": the cheapest way; a weapon that was fired alone before is made ready, as by `prepare`
        - "direct": one that needs nothing but the scene; "built": one for which what is visible, labels or distances
          are worked out first, if they are not there
        - a way by its name: of areas "spans" (the reference), "tiles", "visible", "labels", "integers"; of rays "walk"
          (the reference), "cast", "march"

    Each of aim, toward, accept, blocked_by, exclude, seed, shot and tick is one value for all shots, or one for each.

    Raises
    ------
    InputError
        If an argument is invalid; the text names the argument and the row.
    """
    _check_words(prefilter, broadphase, strategy)
    how = prefilter, broadphase, strategy
    if how == AUTO and is_one(at) and (toward is None or is_one(toward)) and isinstance(aim, ONE_AIM):
        filters = accept, blocked_by, exclude, seed
        ready = ready_for(scene, weapon, filters) if tick is None else _ready_then(scene, weapon, filters, tick)
        if ready is not None:
            return ready.fire(at, aim, toward, shot)
    return fire_anew(scene, weapon, at, aim, toward, (accept, blocked_by, exclude), seed, shot, tick, how)


def fire_anew(
    scene: Scene | History,
    weapon: Weapon,
    at: object,
    aim: object,
    toward: object,
    filters: tuple[object, object, object],
    seed: object,
    shot: object,
    tick: object = None,
    how: How = AUTO,
) -> Hits:
    """Decide what shots hit by what the scene keeps, not by weapons that are ready for it.

    Arguments and errors are those of `fire`; `filters` are (accept, blocked_by, exclude).
    """
    plan, (accept, blocked_by, exclude) = Plan(), filters
    present = present_of(scene)
    bits = category_bits(present, "accept", accept), category_bits(present, "blocked_by", blocked_by)
    shots = checked_shots(weapon, at, aim, toward, *bits, exclude, seed, shot)
    if exclude is not None:
        check_owners(present, shots.owners, exclude)
    plan.run("shots", f"{len(shots)} checked", shots.nbytes)
    if aim is None and toward is None:
        plan.leave_out_all(unaimed, weapon)
    if isinstance(scene, Scene) and tick is None:
        return fired(scene, weapon, shots, how, plan)
    moments = moments_of(scene, tick, len(shots))
    parts: list[Hits] = []
    plan.run("past", f"moments of it: {len(moments)}")
    for past, rows in moments:
        parts.append(fired(past, weapon, shots.pick(rows), how, plan))
    if len(parts) == 1:
        return parts[0]
    hits = parts[0].gathered(parts, [rows for _, rows in moments], shots)
    hits.plan.run("rows", "", hits.nbytes)
    return hits


def is_one(at: object) -> bool:
    """Whether this may be the position of one shot; a batch of two shots is not."""
    if type(at) is np.ndarray:
        return bool(at.shape == (2,))
    return isinstance(at, tuple | list) and len(at) == 2 and isinstance(at[0], int | float)


Filtering = tuple[Any, Any, Any, Any]
"""(accept, blocked_by, exclude, seed) of a call."""


def ready_for(scene: Scene | History, weapon: Weapon, filters: Filtering) -> Ready[Hits] | None:
    """The weapon as `prepare` makes it, if it was fired at the scene before, one shot a call."""
    accept, blocked_by, exclude, seed = filters
    if type(scene) is not Scene or not isinstance(weapon, Weapon):
        return None
    parts = ray_parts_of(weapon)
    if parts is not None and not are_followed(parts):
        return None  # `prepare` leaves other rays to `fire`
    accepts: Any = category_bits(scene, "accept", accept)
    blocks: Any = category_bits(scene, "blocked_by", blocked_by)
    owners = _plain_owners(exclude)
    if owners is None or not (type(accepts) is type(blocks) is type(seed) is int):
        return None  # also of True, which would find what is kept for 1

    def make() -> Ready[Hits]:
        own = copy(weapon)  # what a scene keeps holds no weapon of a caller, nor the patterns that it knows
        return late.prepare.prepare(scene, own)

    ready = scene.derived.when_asked_again(weapon.text, make)
    return None if ready is None else late.prepare.filtered(ready, accepts, blocks, owners, seed)


def _plain_owners(exclude: Any) -> tuple[int, ...] | None:
    """Owners that one shot excludes; None if they are many, or not plain whole numbers in range."""
    if exclude is None:
        return ()
    if isinstance(exclude, np.ndarray) and exclude.ndim == 1 and exclude.dtype.kind in "iu":
        exclude = exclude.tolist()
    given = exclude if isinstance(exclude, tuple | list) else (exclude,)
    owners = tuple([int(owner) if isinstance(owner, np.integer) else owner for owner in given[: OWNERS_READY + 1]])
    plain = all(type(owner) is int and -1 <= owner <= OWNER_MAX for owner in owners)
    return owners if plain and len(owners) <= OWNERS_READY else None


def _ready_then(scene: Scene | History, weapon: Weapon, filters: Filtering, tick: object) -> Ready[Hits] | None:
    """A weapon of few rays, ready for the scene of a tick; it pays for a single shot, for which nothing is kept."""
    parts = ray_parts_of(weapon) if isinstance(tick, int | float) else None
    if parts is None or not are_followed(parts) or present_of(scene) is scene:
        return None
    ((past, _),) = moments_of(scene, tick, 1)
    accept, blocked_by, exclude, seed = filters
    return late.prepare.prepare(past, weapon, accept=accept, blocked_by=blocked_by, exclude=exclude, seed=seed)


def _check_words(prefilter: object, broadphase: object, strategy: object) -> None:
    """Refuse names that are not strings; the functions that read them check which strings are known."""
    if not (isinstance(prefilter, str) and isinstance(broadphase, str) and isinstance(strategy, str)):
        prefilter_of(prefilter)
        choice("broadphase", broadphase, BROADPHASES)
        choice("strategy", strategy, STRATEGIES)


def present_of(scene: object) -> Scene:
    """The scene itself, or the present scene of a history."""
    if isinstance(scene, Scene):
        return scene
    from hitplanes.planes.scene.history import History

    if not isinstance(scene, History):
        raise InputError(f"scene: expected a Scene or a History, got {kind_of(scene)}")
    return scene.scene


def moments_of(history: Scene | History, tick: object, n: int) -> list[tuple[Scene, Ints]]:
    """Scenes that shots are fired at, of a history those of their ticks, each with the rows of its shots."""
    if isinstance(history, Scene):
        if tick is not None:
            raise InputError(f"tick: expected none, as a Scene has no past, got {shown(tick)}: fire at its History")
        return [(history, np.arange(n))]
    if tick is None:
        raise InputError("tick: expected one, or one for each shot, as it is a History that is fired at, got none")
    if n and isinstance(tick, int | float) and not isinstance(tick, bool):
        return [(history.at(tick), np.arange(n))]
    ticks = reals("tick", each("tick", tick, n), (n,))
    if not n:
        return [(history.at(history.ticks[-1]) if history.ticks else history.scene, np.arange(0))]
    distinct, which = np.unique(ticks, return_inverse=True)
    moments: list[tuple[Scene, Ints]] = []
    for k, time in enumerate(distinct.tolist()):
        rows = np.flatnonzero(which == k)
        try:
            moments.append((history.at(int(time) if time.is_integer() else time), rows))
        except InputError as error:
            raise InputError(str(error).replace("tick:", f"tick[{rows[0]}]:", 1) if n > 1 else str(error)) from error
    return moments


def fired(scene: Scene, weapon: Weapon, shots: Shots, how: How = AUTO, plan: Plan | None = None) -> Hits:
    """Decide what checked shots hit; a plan is continued."""
    plan = plan or Plan()
    if len(shots) > 1:
        keep_arena()
    parts = ray_parts_of(weapon)
    if parts is not None:
        hits: Hits = late.ray_call.fired_rays(scene, weapon, parts, shots, how, plan)
    else:
        hits = _fired_areas(scene, weapon, shots, how, plan)
    if texts := news():
        plan.run("kernels", "; ".join(texts))
    return hits


def _fired_areas(scene: Scene, weapon: Weapon, shots: Shots, how: How, plan: Plan) -> Hits:
    """Decide what shots of an area weapon hit, by the way that the strategy chooses."""
    request = request_of(scene, read_stack(scene, plan), weapon, shots, how, plan)
    way, why = chosen_way(how[2], request)
    plan.run("plan", f"{way.name}: {why}")
    parts = way.engine(request)
    rows = Rows.joined(parts)
    stack = request.stack
    hits = Hits(rows, lambda: late.verdicts.verdicts_of(request, rows, way.name), scene, stack, weapon, shots, plan)
    leave_out_unused(request, way.name)
    plan.run("rows", "in their order", rows.nbytes if len(parts) > 1 else 0)
    return hits


def request_of(scene: Scene, stack: Stack, weapon: Weapon, shots: Shots, how: How, plan: Plan) -> Request:
    """What a call asks of an area weapon, and what its shots are tested against."""
    traits = traits_of(weapon)
    view, placements, blockers = view_of(traits.pierces, shots), traits.placements * len(shots), None
    if traits.sight:
        near = late.shelter.ways_box(weapon, shots)
        blockers = late.shelter.blockers_of(scene, stack, traits.sight, traits.inside, view, near)
        if blockers is None:
            plan.leave_out("line of sight", "no item near the shots may shelter")
        else:
            plan.run("line of sight", f"items that may shelter: {len(blockers.rank)}", blockers.nbytes)
    filtered = how[:2] != AUTO[:2]
    looked_up = filtered or how[2] == "spans" or not traits.fits  # else boxes are compared as samples are counted
    candidates = chosen_candidates(*how[:2], scene, stack, placements if looked_up else 0)
    return Request(
        stack, scene.bounds, traits.pierces, candidates, plan, blockers, scene=scene, weapon=weapon, shots=shots,
        traits=traits, view=view, choosy=may_refuse(stack, shots), filtered=filtered, placements=placements,
        covers=stack.covers,
    )  # fmt: skip


def category_bits(scene: Scene, field: str, value: object) -> object:
    """Category bits of a name or a list of names, or of a list for each shot; any other value unchanged."""
    if type(value) is int:
        return value
    names = (value,) if isinstance(value, str) else value
    expected = "category names or bits, or ALL"
    if value is None or isinstance(value, Mapping | Set):
        raise InputError(f"{field}: expected {expected}, got {shown(value)}")
    if not isinstance(names, list | tuple):
        return value
    if all(isinstance(name, str) for name in names):
        return scene.category_bits(*names, field=field)
    if all(isinstance(own, list | tuple) and all(isinstance(name, str) for name in own) for own in names):
        return np.array([scene.category_bits(*own, field=f"{field}[{row}]") for row, own in enumerate(names)])
    if any(isinstance(own, str | list | tuple) for own in names):
        raise InputError(f"{field}: expected {expected}, or a list of names for each shot, got {shown(value)}")
    return value


def check_owners(scene: Scene, owners: Ints | tuple[int, ...], exclude: object) -> None:
    """Check that each excluded owner (N, K), or (K,), is the id of an object that a scene has or had, or -1.

    `exclude` is the argument that they are read from.
    """
    items = scene.latest.items
    greatest = max(owners, default=-1) if isinstance(owners, tuple) else int(owners.max(initial=-1))
    if greatest < items.count:
        return
    every = np.atleast_2d(owners)
    row, column = np.argwhere(every >= items.count)[0].tolist()
    last = range(max(items.count - LOOKED_AT, 0), items.count)
    parts = set(items.ids[items.owner[items.rows] != items.ids].tolist())
    whole = [owner for owner in last if owner not in parts and items.name_of(owner)]
    near = ", ".join(f"{owner} {items.name_of(owner)!r}" for owner in whole[-OWNERS_NAMED:])
    known = f"the nearest are {near}" if near else "it never had any"
    dimensions = 0 if every.size == 1 else np.ndim(exclude)  # type: ignore[arg-type]
    place = ("", f"[{row + column}]", f"[{row}][{column}]")[dimensions]
    got = every[row, column]
    raise InputError(f"exclude{place}: expected an owner that the scene has or had, got {got}; {known}")
