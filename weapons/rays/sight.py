"""Lines of sight and scans: which eyes see which targets, and how far beams go, without rows, passes and stops.

places and filters -> shots of one ray each, in chunks -> `ray_call.end_times` -> a table (N, M)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from hitplanes.planes.common.checks import Bools, Floats, InputError, Ints, array_of, real, reals, shown
from hitplanes.planes.common.limits import ALL, REACH_MAX, SUB
from hitplanes.planes.grid.fixed_point import unit
from hitplanes.planes.scene.scene import Scene

from ..fire.call import Filtering, category_bits, check_owners, is_one, moments_of, present_of, ready_for
from ..fire.prefilter import view_of
from ..kinds.placements import Shots, places_256, unaimed_shots
from ..kinds.rays import Pistol
from .contacts import NEVER, Rays
from .ray_call import RAYS_AT_ONCE, end_times
from .ray_walk import lines_of

if TYPE_CHECKING:
    from hitplanes.planes.scene.history import History

    from ..fire.call import Angles, Categories, Owners, Places

GAZE = Pistol(None)

Aimed = Callable[[Ints], tuple[Ints, Shots]]
"""Function that aims the shots of cells (n,) of a table; it returns the cells that have a shot, and the shots."""


def sees(
    scene: Scene | History, eyes: Places, targets: Places, *, accept: Categories = (), blocked_by: Categories = ALL,
    exclude: Owners | None = None, tick: Angles | None = None,
) -> Bools:  # fmt: skip
    """Decide which eyes see which targets.

    An eye sees a target if no occluder touches the straight line between them, ends included. So who sees is seen, and
    a point in an occluder, or on its border, neither sees nor is seen. A pair on one spot always sees each other.

    Parameters
    ----------
    scene : a Scene, or a History, seen at the given ticks
    eyes : (N, 2) or (2,) points, px
    targets : (M, 2) or (2,) points, px, at most 2**20 px from each eye in x and in y
    accept : category names or bits of the objects that block, too, also those in which an end lies; none by default
    blocked_by : category names or bits of the occluders that block; all by default
    exclude : owners whose items do not block: a number, or for one eye a list (K,); for several (N,), (N, K), or (1, K)
    tick : time of each eye, if `scene` is a History

    Each of accept, blocked_by, exclude and tick is one value for all eyes, or one for each.

    Returns
    -------
    (N, M) bool

    Raises
    ------
    InputError
        If an argument is invalid; the text names the argument and the row.
    """
    clear = None if tick is not None else _is_clear(scene, eyes, targets, (accept, blocked_by, exclude, 0))
    if clear is not None:
        return np.array([[clear]])
    shots = _shots("eyes", eyes, scene, accept, blocked_by, exclude)
    targets_256, _ = places_256("targets", targets)
    seen = np.ones((len(shots), len(targets_256)), np.bool_)
    for pair, _, time in _ends(scene, tick, GAZE, shots, seen.shape[1], _gazes(shots, targets_256)):
        seen.reshape(-1)[pair] = time == NEVER
    return seen


def _is_clear(scene: Scene | History, eye: object, target: object, filters: Filtering) -> bool | None:
    """Whether one eye sees one target, if a ray is ready for the scene; None if there is more to check."""
    if not (is_one(eye) and is_one(target)):
        return None
    ready: Any = ready_for(scene, GAZE, filters)
    clear: bool | None = ready and ready.reaches(eye, target)
    return clear


def _gazes(shots: Shots, targets_256: Ints) -> Aimed:
    """Aim eyes, which are shots, at targets; a pair on one spot has no shot."""

    def aimed(pair: Ints) -> tuple[Ints, Shots]:
        eye, target = np.divmod(pair, len(targets_256))
        offset = targets_256[target] - shots.at_256[eye]
        _check_reach(offset, eye, target)
        apart = np.flatnonzero(offset.any(axis=1))
        return pair[apart], shots.pick(eye[apart]).aimed_at(offset[apart])

    return aimed


def scan(
    scene: Scene | History, at: Places, angles: Angles, range: float, *,  # noqa: A002
    accept: Categories = ALL, blocked_by: Categories = ALL, exclude: Owners | None = None, tick: Angles | None = None,
) -> Floats:  # fmt: skip
    """Measure how far beams go to the first thing that they meet, as a lidar does.

    A beam meets objects and occluders as the ray of a `Pistol` does: its distance is that of `hits.stop`, and 0 if it
    starts in one of them.

    Parameters
    ----------
    scene : a Scene, or a History, scanned at the given ticks
    at : (N, 2) or (2,) places, px
    angles : (B,) degrees of the beams of every place, 0 along +x, clockwise on the screen; or (N, B), those of each
    range : length of the beams, px
    accept : category names or bits of the objects that beams meet; all by default
    blocked_by : category names or bits of the occluders that beams meet; all by default
    exclude : owners whose items are passed through, such as who carries the lidar: a number, or for one place a list
        (K,); for several (N,), (N, K), or (1, K)
    tick : time of each scan, if `scene` is a History

    Each of accept, blocked_by, exclude and tick is one value for all places, or one for each.

    Returns
    -------
    (N, B) float, px; infinite where a beam meets nothing within its range

    Raises
    ------
    InputError
        If an argument is invalid; the text names the argument and the row.
    """
    shots, ray = _shots("at", at, scene, accept, blocked_by, exclude), Pistol(real("range", range, 0, REACH_MAX))
    shape, aimed = _beams(shots, angles)
    distance = np.full(shape, np.inf)
    for beam, rays, time in _ends(scene, tick, ray, shots, shape[1], aimed):
        met = np.flatnonzero(time != NEVER)
        lines = lines_of(rays, ray).take(met)
        distance.reshape(-1)[beam[met]] = time[met] / lines.scale * lines.length
    return distance


def _beams(shots: Shots, angles: object) -> tuple[tuple[int, int], Aimed]:
    """Shape (N, B) of a table of beams, and the function that aims them."""
    given = array_of("angles", angles)
    if not given.ndim:
        raise InputError(f"angles: expected a list of them, one for each beam, got {shown(angles)}")
    shared = given.ndim == 1
    direction = np.stack(unit(reals("angles", angles, (None,) if shared else (len(shots), None))), axis=-1)
    beams = direction.shape[-2]

    def aimed(beam: Ints) -> tuple[Ints, Shots]:
        place, angle = np.divmod(beam, beams)
        return beam, shots.pick(place).aimed(direction.reshape(-1, 2)[angle if shared else beam])

    return (len(shots), beams), aimed


def _shots(field: str, at: object, scene: object, accept: object, blocked_by: object, exclude: object) -> Shots:
    """Shots from places, which are the value of a field, with their filters."""
    present = present_of(scene)
    bits = category_bits(present, "accept", accept), category_bits(present, "blocked_by", blocked_by)
    shots = unaimed_shots(field, at, *bits, exclude)
    if exclude is not None:
        check_owners(present, shots.owners, exclude)
    return shots


def _check_reach(offset: Ints, eye: Ints, target: Ints) -> None:
    far = np.flatnonzero((np.abs(offset) > SUB * REACH_MAX).any(axis=1))
    if len(far):
        got = (offset[far[0]] / SUB).tolist()
        where = f"targets[{target[far[0]]}]: expected a point within {REACH_MAX} px of eyes[{eye[far[0]]}]"
        raise InputError(f"{where}, got one at {got} of it")


def _ends(
    scene: Scene | History, tick: object, ray: Pistol, shots: Shots, each: int, aimed: Aimed
) -> Iterator[tuple[Ints, Rays, Ints]]:
    """Follow so many rays of each shot, a row of a table: cells (n,) of the table, their rays, and when these end."""
    view = view_of(False, shots)
    for moment, rows in moments_of(scene, tick, len(shots)):
        cells = (rows[:, None] * each + np.arange(each)).reshape(-1)
        times_of = end_times(moment, ray, view, len(cells))
        for begin in range(0, len(cells), RAYS_AT_ONCE):
            cell, aimed_shots = aimed(cells[begin : begin + RAYS_AT_ONCE])
            if len(cell):
                yield cell, *times_of(aimed_shots)
