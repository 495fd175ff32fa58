"""Frames in which everything moves: what a frame costs, with all that moving costs; and one object redrawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, repeat
from typing import Any

import numpy as np
from speed_clock import Cell, DisagreementError, Side, race
from speed_engines import EASIER, Space
from speed_peers import Masks, first, pygame_mask, rendered
from speed_static import Settings, hit_rows, modes, touched
from speed_world import PATTERNS, WORLD, Volleys, items_of, pattern_mask, scene_of, volleys

from hitplanes import Disc, Scene, fire, prepare
from hitplanes.planes.bits.label_plane import LabelPlane
from hitplanes.planes.common.checks import Floats, Ints

__all__ = ["Own", "frames_of", "moving", "moving_rays", "redrawn"]

STEP = 3
"""Objects move so many px a frame at most, in x and in y."""

TURNING, DEGREES, FRAMES = 0.05, 5, 2
"""The part of the objects that turn, among pre-rendered steps of so many degrees, and change frame, each frame."""


@dataclass
class Frame:
    """What happens in a frame, as each side likes it; all of it is made before the clock starts.

    Parameters
    ----------
    xy : positions of all objects
    turned, angle, frame : who turns, how far, and the frame of each
    corners : the first corner of each mask, in the peers' order, with its size where some turn
    masks : the place and mask of each that turned, in the peers' order
    shots : small (r = 3) and large (r = 40) ones
    """

    xy: Floats
    turned: Ints
    angle: Floats
    frame: Ints
    corners: list[Any]
    masks: list[tuple[int, Any]]
    shots: tuple[Volleys, Volleys]


def frames_of(scene: Scene, count: int, shots: int, turning: float, seed: int) -> Iterator[list[Frame]]:
    """Rounds of frames, each going on where the last ended; the scene given is moved along to tell where masks lie."""
    rng = np.random.default_rng(seed)
    ids, made = scene.ids("hittable"), {}
    xy = np.floor(rng.uniform((0, 0), WORLD, (len(ids), 2)))
    number = 0
    while True:
        frames = []
        for _ in range(count):
            xy = np.clip(xy + rng.integers(-STEP, STEP + 1, xy.shape), 0, np.array(WORLD) - 1.0)
            some = np.sort(rng.permutation(ids)[: int(np.ceil(turning * len(ids)))])
            angle = rng.integers(0, 360 // DEGREES, len(some)) * float(DEGREES)
            frame = rng.integers(0, FRAMES if turning else 1, len(some))
            scene.move(ids, xy)
            if turning:
                scene.set(some, angle=angle, frame=frame)
            corners, masks = _as_peers_like(scene, some, made, bool(turning))
            small = (shots + number % 2) // 2
            volley = [Volleys(np.floor(rng.uniform((0, 0), WORLD, (n, 2)))) for n in (small, shots - small)]
            frames.append(Frame(xy, some, angle, frame, corners, masks, (volley[0], volley[1])))
            number += 1
        yield frames


def _as_peers_like(scene: Scene, some: Ints, made: dict[Any, Any], sized: bool) -> tuple[list[Any], Any]:
    """Rects of all objects, later ones first, and the masks of some."""
    ids = scene.ids("hittable")[::-1]
    boxes = scene.box(ids)
    sizes = boxes[:, 2:] - boxes[:, :2] + 1
    rects = np.concatenate([boxes[:, :2], sizes], axis=1) if sized else boxes[:, :2]
    masks = []
    for i in some.tolist():
        mask, _ = scene.mask(i)
        key = mask.tobytes(), mask.shape
        made[key] = made.get(key) or pygame_mask(mask)
        masks.append((len(ids) - 1 - i, made[key]))
    return list(map(tuple, rects.tolist())), masks


class Own:
    """Our side of the moving scene: the public calls, in one mode."""

    def __init__(self, scene: Scene, **options: Any) -> None:
        self.scene, self.options = scene, options
        self.ids = scene.ids("hittable")

    def answer(self, frames: Sequence[Frame], units: int) -> list[Any]:
        """Move, turn, and fire."""
        scene, found = self.scene, []
        for one in frames[:units]:
            scene.move(self.ids, one.xy)
            if len(one.turned):
                scene.set(one.turned, angle=one.angle, frame=one.frame)
            for weapon, shots in zip((SMALL, LARGE), one.shots, strict=True):
                if len(shots.at):
                    found.append(touched(fire(scene, weapon, shots.at, **self.options)))
                else:
                    found.append(None)
        return found


SMALL, LARGE = Disc(3), Disc(40)


def own_rows(found: list[Any]) -> Any:
    """Rows of all volleys: shots are numbered by volley."""
    parts = [np.zeros((0, 3), np.int64)]
    for number, hits in enumerate(found):
        if hits is not None:
            parts.append(hit_rows(hits) + np.array([number << 20, 0, 0]))
    return np.concatenate(parts)


def peer_rows(found: list[Any]) -> Any:
    """The same, of lists."""
    return [((number << 20) + shot, i, count) for number, rows in enumerate(found) for shot, i, count in rows]


def masks_side(scene: Scene) -> Side:
    """A: rects are moved in place, masks of those that turned are taken from what was rendered before."""
    masks = Masks(items_of(scene))
    placed = [rendered(pattern_mask(weapon)) for weapon in (SMALL, LARGE)]

    def answer(frames: Sequence[Frame], units: int) -> list[Any]:
        found, rects = [], masks.rects
        for one in frames[:units]:
            if len(one.turned):
                for rect, place in zip(rects, one.corners, strict=True):
                    rect.update(place)
                for k, mask in one.masks:
                    masks.masks[k] = mask
            else:
                for rect, place in zip(rects, one.corners, strict=True):
                    rect.topleft = place
            for pattern, shots in zip(placed, one.shots, strict=True):
                found.append(masks.areas(*first(shots, len(shots.at)), repeat(pattern)))
        return found

    return Side("A pygame", answer, peer_rows, whole=True)


def space_side(scene: Scene) -> Side:
    """pymunk: bodies are moved, and the index is built anew."""
    space = Space([item for item in items_of(scene) if not item.occluder], moving=True)

    def answer(frames: Sequence[Frame], units: int) -> int:
        found = 0
        for one in frames[:units]:
            space.move(one.corners)
            for radius, shots in zip((3, 40), one.shots, strict=True):
                found += space.discs(shots, len(shots.at), radius)
        return found

    return Side("pymunk", answer, easier=EASIER, whole=True)


def moving(settings: Settings) -> Iterator[Cell]:
    """All objects move; plain, and where some turn and change frame."""
    for objects in settings.moving:
        for turning in (0.0, TURNING):
            for shots in (1, 10, 100, 1000):
                frames = settings.frames if objects < 5000 else max(2, settings.frames // 4)
                own = []
                for mode, ready in modes(settings).items():
                    mine = Own(scene_of(objects, frames=FRAMES if turning else 1))
                    own.append(Side(mode, mine.answer, own_rows, ready=ready, whole=True))
                shadow = scene_of(objects, frames=FRAMES if turning else 1)
                sides = [*own, masks_side(shadow)]
                if not turning and objects <= 1000:
                    sides.append(space_side(shadow))
                what = f"{shots} shots" + (", 5 % turn" if turning else "")
                rounds = frames_of(shadow, frames, shots, turning, shots)
                works = ([next(rounds)] for _ in range(settings.rounds + 1))
                cell = Cell("moving", what, objects, unit="ns a frame")
                yield race(cell, sides, works, frames, settings.seconds)


def moving_rays(settings: Settings) -> Iterator[Cell]:
    """Rays of 1000 px at objects that all move: fired in one call a frame, and one a call by a prepared weapon."""
    for objects in settings.moving:
        for shots in (1, 10, 100):
            sides = []
            for mode, ready in modes(settings).items():
                for name, way in ((mode, _in_one_call), (f"{mode}, prepared", _one_a_call)):
                    sides.append(Side(name, way(scene_of(objects)), _ray_rows, ready=ready, whole=True))
            shadow = scene_of(objects)
            sides.append(_space_of_rays(shadow))
            frames = settings.frames if objects < 5000 else max(2, settings.frames // 4)
            rays = volleys("ray 1000", shots, shots)
            rounds = islice(frames_of(shadow, frames, 2, 0.0, shots), settings.rounds + 1)
            works = ([list(zip(one, islice(rays, frames), strict=True))] for one in rounds)
            cell = Cell("moving rays", f"{shots} rays", objects, unit="ns a frame")
            yield race(cell, sides, works, frames, settings.seconds)


Aimed = Sequence[tuple[Frame, Volleys]]
"""Frames, and the rays of each."""


def _in_one_call(scene: Scene) -> Callable[[Aimed, int], list[Any]]:
    ids = scene.ids("hittable")

    def answer(frames: Aimed, units: int) -> list[Any]:
        found = []
        for one, rays in frames[:units]:
            scene.move(ids, one.xy)
            found.append(list(fire(scene, RAY, rays.at, aim=rays.aim)))
        return found

    return answer


def _one_a_call(scene: Scene) -> Callable[[Aimed, int], list[Any]]:
    ids, ready = scene.ids("hittable"), prepare(scene, RAY)

    def answer(frames: Aimed, units: int) -> list[Any]:
        found = []
        for one, rays in frames[:units]:
            scene.move(ids, one.xy)
            shots = zip(rays.lists["places"], rays.lists["aim"], strict=True)
            found.append([row._replace(shot=k) for k, (at, aim) in enumerate(shots) for row in ready.fire(at, aim=aim)])
        return found

    return answer


def _ray_rows(found: list[Any]) -> Any:
    """Rows of all frames: shots are numbered by frame."""
    return [((number << 20) + row.shot, row.object, row.samples) for number, rows in enumerate(found) for row in rows]


def _space_of_rays(scene: Scene) -> Side:
    """pymunk: the first shape on each segment."""
    space = Space([item for item in items_of(scene) if not item.occluder], moving=True)

    def answer(frames: Aimed, units: int) -> int:
        found = 0
        for one, rays in frames[:units]:
            space.move(one.corners)
            found += space.rays(rays, len(rays.at))
        return found

    return Side("pymunk", answer, easier=EASIER, whole=True)


RAY = PATTERNS["ray 1000"]


def redrawn(settings: Settings) -> Iterator[Cell]:
    """Objects that take a short step, and the code plane read: with the move itself, and apart from it."""
    objects = settings.redrawn
    for moved in (1, 10, 100):
        if moved > objects:
            continue
        rng = np.random.default_rng(moved)
        sides = []
        for mode, ready in modes(settings).items():
            mine = scene_of(objects)
            sides.append(Side(mode, _redraw(mine), ready=ready, whole=True))
            sides.append(Side(f"{mode}, move alone", _move(scene_of(objects)), ready=ready, whole=True))
        steps = [[_steps(scene_of(objects), moved, settings.steps, rng)] for _ in range(settings.rounds + 1)]
        cell = Cell("redrawn", f"{moved} moved", objects, unit="ns a frame")
        race(cell, sides, steps, settings.steps, settings.seconds)
        for mode in modes(settings):
            cell.values[f"ns a moved object, {mode}"] = cell.sides[mode].least / moved
            check_drawn(next(side for side in sides if side.name == mode).answer([], 0))
            apart = cell.sides[mode].least - cell.sides[f"{mode}, move alone"].least
            cell.values[f"ns a moved object, {mode}, apart from the move"] = apart / moved
        yield cell


def _steps(scene: Scene, moved: int, count: int, rng: Any) -> list[tuple[Any, Floats]]:
    """Who moves where, frame by frame."""
    ids = scene.ids("hittable")
    xy = scene.position(ids)
    steps = []
    for _ in range(count):
        some = np.sort(rng.permutation(len(ids))[:moved])
        xy[some] += rng.integers(-STEP, STEP + 1, (moved, 2))
        xy = np.clip(xy, 0, np.array(WORLD) - 1)
        steps.append((ids[some] if moved > 1 else int(ids[some[0]]), xy[some] if moved > 1 else xy[some[0]]))
    return steps


def _redraw(scene: Scene) -> Callable[[Any, int], Scene]:
    plane = scene.derived.label_plane()
    assert plane is not None
    plane.read(scene.items)

    def answer(steps: Any, units: int) -> Scene:
        for some, xy in steps[:units]:
            scene.move(some, xy)
            plane.read(scene.items)
        return scene

    return answer


def check_drawn(scene: Scene) -> None:
    """Check that the plane that was drawn step by step is the one that is drawn at once."""
    plane = scene.derived.label_plane()
    assert plane is not None
    if not np.array_equal(plane.read(scene.items), LabelPlane(plane.box_xyxy).read(scene.items)):
        raise DisagreementError(
            f"redrawn, {len(scene)} objects: the plane drawn step by step differs from one drawn at once"
        )


def _move(scene: Scene) -> Callable[[Any, int], int]:
    def answer(steps: Any, units: int) -> int:
        for some, xy in steps[:units]:
            scene.move(some, xy)
        return units

    return answer
