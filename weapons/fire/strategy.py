"""The strategy tables of areas and rays: for each way when it serves, what it costs, and its engine; and the choice.

A way is chosen by the call and by the scene, so that the same call at the same scene takes the same way. The plan says
why. What a way needs of the scene is made once calls have lost as much time without it as it takes to make (rent or
buy), so that the total is at most twice that of the better choice (Karlin et al., "Competitive snoopy caching", 1988).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, NamedTuple

from hitplanes.planes.bits.bit_rows import WORD
from hitplanes.planes.bits.tiles import integers_ns, tiles_in, visible_ns
from hitplanes.planes.common.backend import jit_is_on
from hitplanes.planes.common.checks import InputError, choice
from hitplanes.planes.common.costs import costs
from hitplanes.planes.common.limits import STRUCTURES
from hitplanes.planes.scene.derived import View
from hitplanes.planes.scene.items import Stack
from hitplanes.planes.scene.scene import Scene

from .. import late
from ..kinds.rays import RayWeapon, ends_at_first, is_moving, is_stepped, is_thin_first
from .areas import Request, by_integers, by_labels, by_tiles, by_visible_set, labels_for
from .hits import Rows
from .prefilter import BOX, Candidates, prefilter_of

if TYPE_CHECKING:
    from hitplanes.planes.bits.distance_field import DistanceField
    from hitplanes.planes.bits.label_plane import LabelPlane

BROADPHASES = ("auto", *STRUCTURES)

AUTO = "auto", "auto", "auto"
"""Pre-filter, broad phase and strategy of a call that names none."""


INTEGERS_REACH, INTEGERS_PLACEMENTS, INTEGERS_PAIRS = 500, 64, 2**15
"""Largest reach of patterns, px, most placements, and most pairs of placements and items counted in integers."""

CROWD = 64
"""Most tiles that are thought to lie near a placement when it is asked whether an estimate is worth its time."""


class Way(NamedTuple):
    """A way to answer a call.

    Parameters
    ----------
    name : by which it is asked for
    refuses : why it cannot serve a call, or ""
    cost : ns that the call takes, and ns to make what it needs of the scene and is not there, by the expected number of
        tiles near all placements
    engine : returns rows, in parts
    """

    name: str
    refuses: Callable[[Request], str]
    cost: Callable[[Request, float], tuple[float, float]]
    engine: Callable[[Request], list[Rows]]


def expected_near(stack: Stack, reach: int) -> float:
    """Expected number of tiles near a placement, if they are spread evenly over the box around all."""
    if not len(stack):
        return 0.0
    mean, around = stack.sizes
    (wide, high), (width, height), reached = mean, around, 2 * reach + 1
    across, down = (min(wide, WORD) + reached) / width, (min(high, WORD) + reached) / height
    return float(tiles_in(stack) * min(across, 1.0) * min(down, 1.0))


def _tiles_refuse(request: Request) -> str:
    return "" if request.traits.fits else "the patterns are too large for bit rows"


def _near(request: Request) -> float:
    """Expected number of tiles near all placements; 0 for single pixels, and where a crowd takes less than a call."""
    now, stack = costs(), request.stack
    most = request.placements * min(tiles_in(stack), CROWD)
    if request.traits.is_point or most * now.tiles_near < now.tiles_call:
        return 0.0
    return request.placements * expected_near(stack, request.traits.reach)


def _tiles_cost(request: Request, near: float) -> tuple[float, float]:
    now = costs()
    each = now.tiles_placement + tiles_in(request.stack) * now.tiles_pair
    return now.tiles_call + request.placements * each + near * now.tiles_near, 0.0


def _visible_refuse(request: Request) -> str:
    if request.view is None:
        return "shots accept different items"
    return "a pre-filter is asked for" if request.filtered else _tiles_refuse(request)


def _visible_cost(request: Request, near: float) -> tuple[float, float]:
    now, scene = costs(), request.scene
    known = request.view is not None and scene.derived.visible(request.view).made(scene.items) is not None
    made = 0.0 if known else visible_ns(request.stack, now)
    return now.visible_call + request.placements * now.visible_placement + near * now.visible_near, made


SIGHTED = "the weapon needs a line of sight"


def _labels_refuse(request: Request) -> str:
    if not request.traits.is_point:
        return "shots are not one pixel"
    if request.blockers is not None:
        return SIGHTED
    if request.view is None or request.view.pierce:
        return "shots accept different items, or pierce"
    if request.filtered:
        return "a pre-filter is asked for"
    plane = labels_for(request)
    return "" if plane is not None else "the scene has no bounds that fit one plane"


def _labels_cost(request: Request, _: float) -> tuple[float, float]:
    plane = labels_for(request)
    assert plane is not None  # else it refuses
    return costs().labels_call, _drawing_ns(plane, request.scene, request.stack)


def _drawing_ns(plane: LabelPlane, scene: Scene, stack: Stack) -> float:
    """Time to draw what is not drawn of a label plane: all of it, or the boxes of items that changed."""
    now, pixels = costs(), plane.cost(scene.items)
    if plane.labels is None:
        return pixels * now.labels_pixel + len(stack) * now.labels_item
    return plane.dirty_boxes * now.labels_box


def _integers_refuse(request: Request) -> str:
    if jit_is_on():
        return "kernels are compiled"
    if request.filtered:
        return "a pre-filter is asked for"
    if request.traits.scattered:
        return "there are pellets"
    if request.traits.reach > INTEGERS_REACH:
        return f"patterns reach farther than {INTEGERS_REACH} px"
    if request.blockers is not None:
        return SIGHTED
    few = 0 < request.placements <= INTEGERS_PLACEMENTS
    return "" if few and request.placements * len(request.stack) <= INTEGERS_PAIRS else "there are too many shots"


def _integers_cost(request: Request, _: float) -> tuple[float, float]:
    size, now = 2 * request.traits.reach + 1, costs()
    each = now.integers_placement + integers_ns(expected_near(request.stack, request.traits.reach), size, size)
    return now.integers_call + request.placements * each, 0.0


def _by_spans(request: Request) -> list[Rows]:
    return late.spans.by_spans(request)


WAYS = (
    Way("integers", _integers_refuse, _integers_cost, by_integers),
    Way("labels", _labels_refuse, _labels_cost, by_labels),
    Way("visible", _visible_refuse, _visible_cost, by_visible_set),
    Way("tiles", _tiles_refuse, _tiles_cost, by_tiles),
    Way("spans", lambda _: "", lambda request, _: (0.0 if _tiles_refuse(request) else inf, 0.0), _by_spans),
)
"""All ways of areas. The reference costs more than any other, so it is chosen only where bit rows do not serve."""

BY_NAME = {way.name: way for way in WAYS}

ASKED = {"direct": ("tiles", "spans"), "built": ("labels", "visible", "tiles", "spans")}
"""Ways of the strategies that name several; the first that serves is taken."""


def chosen_way(strategy: str, request: Request) -> tuple[Way, str]:
    """The way that answers a call, and why: the one asked for if it serves, else the cheapest."""
    choice("strategy", strategy, STRATEGIES)
    passed_over = ""
    for name in ASKED.get(strategy, (strategy,)):
        if name in BY_NAME:
            why = BY_NAME[name].refuses(request)
            if not why:
                return BY_NAME[name], f"{passed_over}asked for"
            passed_over += f"not {name}, as {why}; "
    return _cheapest(request, passed_over)


def _cheapest(request: Request, passed_over: str) -> tuple[Way, str]:
    """The way that takes the least time, and why; what it needs of the scene is made by rent or buy."""
    ready, least, wanted, near = BY_NAME["spans"], inf, None, _near(request)
    if not (near or request.traits.is_point or _tiles_refuse(request)) and jit_is_on():
        return BY_NAME["tiles"], f"{passed_over}so few items can be near that nothing made before would save much"
    for way in WAYS:
        if way.refuses(request):
            continue
        cost, made = way.cost(request, near)
        if made and wanted is None:
            wanted = way, cost, made
        if not made and cost < least:
            ready, least = way, cost
    if wanted is not None and wanted[1] < least and request.view is not None:
        (way, cost, made), visible = wanted, request.scene.derived.visible(request.view)
        if visible.worth_building(least - cost, made):
            return way, f"{passed_over}calls have lost the {made / 1e3:.0f} us that it takes to make what it needs"
        lost = visible.regret / 1e3
        passed_over += f"{way.name} would take {made / 1e3:.0f} us to make, {lost:.0f} us lost so far; "
    return ready, passed_over + (_tiles_refuse(request) or f"about {least / 1e3:.0f} us")


def _not_cast(ray: RayWeapon, scene: Scene, *_: object) -> str:
    if ray.inside != "hit" and not ends_at_first(ray):
        return "items in which rays start are not hit"
    if is_stepped(ray):
        return "a projectile is tested at moments of the frame"
    return "items move while rays fly" if is_moving(ray, scene.items, scene.items.stack()) else ""


def _not_marched(ray: RayWeapon, scene: Scene, view: View | None) -> str:
    if not is_thin_first(ray):
        return "only thin rays that end at their first hit do"
    if view is None:
        return "rays accept different items"
    return "" if scene.derived.distance_field(view) else "no bounds that fit one plane"


RAY_WAYS: dict[str, Callable[[RayWeapon, Scene, View | None], str]] = {
    "walk": lambda *_: "", "cast": _not_cast, "march": _not_marched
}  # fmt: skip
"""Why each way of rays cannot serve a weapon at a scene, or "". The walk is the reference, and follows any ray.

The walk is `ray_walk.trace`, the cast `raycast.cast_rays`, the march `first_hit.ends_by_march`.
"""

RAYS_ASKED = {"direct": "walk", "built": "march"}
"""Ways that are meant by the strategies which areas and rays share."""

STRATEGIES = ("auto", *ASKED, *BY_NAME, *RAY_WAYS)
"""Names that a call may ask for. A way that cannot serve a call is passed over."""


class RayChoice(NamedTuple):
    """The way of a call, and why; `pending` if a later call like it, at the same scene, may march."""

    way: str
    why: str
    pending: bool = False


def chosen_ray_way(
    strategy: str, asked: bool, ray: RayWeapon, scene: Scene, stack: Stack, view: View | None, rays: int,
    prepared: bool = False,
) -> RayChoice:  # fmt: skip
    """Choose the way of so many rays of a weapon.

    Parameters
    ----------
    strategy : argument of `fire`; a way that cannot serve is passed over, and any other name counts as "auto"
    asked : whether the caller named a pre-filter or a broad phase, which only the walk uses
    view : what all rays accept; None if they accept different items, and so cannot march

    Raises
    ------
    InputError
        If the strategy is not known.
    """
    choice("strategy", strategy, STRATEGIES)
    name = RAYS_ASKED.get(strategy, strategy)
    forced = RAY_WAYS.get(name)
    passed_over = forced(ray, scene, view) if forced else ""
    if forced and not passed_over:
        return RayChoice(name, "asked for")
    why = f"{name} is passed over: {passed_over}; " if passed_over else ""
    if asked or not len(stack):
        return RayChoice("walk", f"{why}every ray walks")
    if refused := _not_cast(ray, scene):
        return RayChoice("walk", f"{why}{refused}")
    return _cast_or_march(ray, scene, view, rays, prepared, why)


def _cast_or_march(ray: RayWeapon, scene: Scene, view: View | None, rays: int, prepared: bool, why: str) -> RayChoice:
    """Of rays that can be cast, whether they march; `why` tells what was passed over."""
    now, stack = costs(), scene.items.stack()
    cast = _alone_ns(rays, stack) if prepared else _cast_ns(rays, stack)
    march = rays * now.prepared_march if prepared else now.march_call + rays * now.march_ray
    why += f"about {cast / 1e3:.0f} us cast at items"
    field = scene.derived.distance_field(view) if is_thin_first(ray) and view is not None else None
    if field is None:
        return RayChoice("cast", why)
    other = RayChoice("cast", f"{why}, {march / 1e3:.0f} us by march")
    return other if cast <= march else _rented_or_bought(other, field, scene, cast - march)


def are_faster_alone(rays: int, stack: Stack) -> bool:
    """Whether so many rays take less time cast one after another than together."""
    return _alone_ns(rays, stack) < _cast_ns(rays, stack)


def are_few(rays: int, stack: Stack, most: int | None) -> bool:
    """Whether the rays of a call, which hit up to `most` objects, are so few that numpy follows them one by one.

    They must take half of the time, as half of a call is the same for both; rays that go on take twice as long.
    """
    return 2 * _alone_ns(rays if most == 1 else 2 * rays, stack) < _cast_ns(rays, stack)


def _cast_ns(rays: int, stack: Stack) -> float:
    """Time to cast rays together, ns; large masks count as many, as rays pass more of their cells."""
    now = costs()
    return now.cast_call + rays * (now.cast_ray + tiles_in(stack) * now.cast_pair)


def _alone_ns(rays: int, stack: Stack) -> float:
    """Time to cast rays one after another, ns."""
    now = costs()
    return rays * (now.prepared_cast + tiles_in(stack) * now.prepared_cast_item)


def _rented_or_bought(other: RayChoice, field: DistanceField, scene: Scene, saved_ns: float) -> RayChoice:
    """March if the distance field is made, or if calls have lost as much time without it as it takes to make."""
    if field.is_made(scene.items):
        return other._replace(way="march")
    build = _drawing_ns(field.labels, scene, scene.items.stack()) + field.labels.size * costs().field_pixel
    pays = field.worth_building(saved_ns, build)
    why = f"{other.why}, which would take {build / 1e3:.0f} us to make: {field.regret / 1e3:.0f} us lost so far"
    return RayChoice("march" if pays else other.way, why, pending=not pays)


def chosen_candidates(prefilter: object, broadphase: object, scene: Scene, stack: Stack, asked: int) -> Candidates:
    """Pre-filter and broad phase of a call, and why: those asked for, or the cheaper ones by the cost model.

    Parameters
    ----------
    asked : placements whose near items will be looked up

    Raises
    ------
    InputError
        If a name is unknown, or a broad phase is asked for without a pre-filter.
    """
    wanted = BOX if prefilter == "auto" else prefilter_of(prefilter)
    structure = choice("broadphase", broadphase, BROADPHASES)
    if wanted.name == "none":
        if structure not in ("auto", "none"):
            raise InputError(f"broadphase: expected 'none' without a pre-filter, got {structure!r}")
        return Candidates(scene.items, stack, wanted, None, "none: every item", "no box is compared")
    text = "box" if wanted == BOX else f"box, then {wanted.name}"
    if structure == "none":
        return Candidates(scene.items, stack, wanted, None, text)
    if structure == "auto":
        if not asked or not _bvh_pays(scene, len(stack), asked):
            why = "few pairs: every box is compared" if asked else "boxes are compared as samples are counted"
            return Candidates(scene.items, stack, wanted, None, text, why)
        structure = "bvh"
    return Candidates(scene.items, stack, wanted, scene.derived.index(structure), f"{text}, by {structure}")


def _bvh_pays(scene: Scene, items: int, placements: int) -> bool:
    """Whether a BVH, with its update, is faster than comparing all boxes; a missing one is built by rent or buy."""
    now = costs()
    one_by_one = placements * items * now.box_pair
    answer = placements * now.bvh_placement + now.bvh_call
    if answer >= one_by_one:
        return False
    index = scene.derived.index("bvh")
    if index.boxes is not None:
        return one_by_one > answer + index.build_cost(scene.items) * now.bvh_moved
    return index.worth_building(one_by_one - answer, items * now.bvh_item)
