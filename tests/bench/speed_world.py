"""What is fired at, and what is fired: the same for us and for the peers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import InitVar, dataclass, field
from functools import cache
from typing import Any

import numpy as np

from hitplanes import Beam, Disc, Pistol, Point, Scene, Spread, Sprite, Stencil, Weapon
from hitplanes.planes.common.checks import Bools, Floats, Ints
from hitplanes.planes.grid.fixed_point import pixel, snap, unit
from hitplanes.weapons.kinds.areas import AreaWeapon, pattern_of
from hitplanes.weapons.kinds.draws import disc_offsets

__all__ = [
    "MARGIN", "PATTERNS", "SEED", "WORLD", "Aimed", "Item", "Volleys", "items_of", "pattern_mask", "scene_of",
    "runs", "shotgun", "sprite_masks", "volleys",
]  # fmt: skip

WORLD = (1920, 1080)
MARGIN = 512
"""How far off the bounds shots and objects may be: peers keep a border so wide."""

OCCLUDERS = 60
SEED = 3
"""Of the pellets."""


def sprite_masks(side: int = 48, count: int = 36, seed: int = 1) -> list[Bools]:
    """Irregular blobs."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    angle, far = np.arctan2(y, x), np.hypot(x, y) * 48 / side
    waves = [rng.uniform(2, 5, 2) for _ in range(count)]
    lobes = [rng.integers(2, 8, 2) for _ in range(count)]
    turns = [rng.uniform(0, 6, 2) for _ in range(count)]
    return [
        far < 17 + w[0] * np.sin(n[0] * angle + t[0]) + w[1] * np.sin(n[1] * angle + t[1])
        for w, n, t in zip(waves, lobes, turns, strict=True)
    ]


def scene_of(
    objects: int,
    size_wh: tuple[int, int] | None = WORLD,
    *,
    side: int = 48,
    occluders: int = OCCLUDERS,
    beyond: int = 0,
    over_wh: tuple[int, int] = WORLD,
    frames: int = 1,
) -> Scene:
    """Objects of some side, px, and occluders before them.

    Parameters
    ----------
    beyond : objects are placed up to so many px off the area, too
    over_wh : the area that they are placed over
    frames : how many each sprite has
    """
    rng = np.random.default_rng(objects)
    scene = Scene(size_wh)
    sprites = _sprites(side, frames)
    where = rng.uniform(-np.array(beyond), np.array(over_wh) + beyond, (objects + occluders, 2))
    for i, xy in enumerate(where):
        role = "hittable" if i < objects else "occluder"
        scene.add(sprites[rng.integers(len(sprites))], xy, role=role, layer=int(i >= objects), categories=1 << i % 3)
    scene.set(scene.ids("occluder"), categories=7)
    return scene


@cache
def _sprites(side: int, frames: int) -> list[Sprite]:
    """The sprites of all scenes, so that a turn that one has rendered is there for the others."""
    masks = sprite_masks(side)
    return [_sprite(masks[k:] + masks[:k], frames) for k in range(len(masks))]


def _sprite(masks: Sequence[Bools], frames: int) -> Sprite:
    if frames == 1:
        return Sprite.from_mask(masks[0])
    image = np.zeros((masks[0].shape[0], masks[0].shape[1] * frames, 4), np.uint8)
    image[:, :, 3] = 255 * np.concatenate(masks[:frames], axis=1)
    return Sprite.from_image(image, grid_wh=masks[0].shape[::-1])


@dataclass
class Item:
    """An object or occluder as the peers get it: its mask, and the pixel of its first corner."""

    id: int
    mask: Bools
    left: int
    top: int
    occluder: bool
    categories: int


def items_of(scene: Scene) -> list[Item]:
    """All that decides, front to back."""
    occluders = set(scene.ids("occluder").tolist())
    ids = [*scene.ids("hittable").tolist(), *occluders]
    ids.sort(key=lambda i: (-int(scene.layer(i)), i not in occluders, -i))
    found = []
    for i in ids:
        mask, (left, top) = scene.mask(i)
        found.append(Item(i, mask, left, top, i in occluders, int(scene.categories_of(i))))
    return found


def shotgun(seed: int = 8) -> Stencil:
    """Eight discs r = 2 at fixed places within 24 px."""
    rng = np.random.default_rng(seed)
    mask = np.zeros((53, 53), np.bool_)
    y, x = np.mgrid[:53, :53] - 26
    placed = 0
    while placed < 8:
        dx, dy = rng.integers(-24, 25, 2)
        if dx * dx + dy * dy <= 24 * 24:
            mask |= (x - dx) ** 2 + (y - dy) ** 2 <= 4
            placed += 1
    return Stencil(mask, (26, 26))


PATTERNS: dict[str, Weapon] = {
    "point": Point(),
    "shotgun 8 x r=2": shotgun(),
    "spread 8 x r=2": Spread(Disc(2), count=8, radius=24),
    "disc r=40": Disc(40),
    "beam 300x6": Beam(300, 6),
    "ray 1000": Pistol(1000),
}


def pattern_mask(weapon: AreaWeapon, degrees: float = 0.0) -> tuple[Bools, int, int]:
    """Pixels of a pattern, and where its first corner is, from the shot's pixel: peers get it rendered."""
    c, s = (int(v[0]) for v in unit(np.array([degrees])))
    spans = pattern_of(weapon, c, s).spans
    left, top = int(spans.x_first.min()), int(spans.y.min())
    mask = np.zeros((int(spans.y.max()) - top + 1, int(spans.x_last.max()) - left + 1), np.bool_)
    for y, first, last in zip(spans.y.tolist(), spans.x_first.tolist(), spans.x_last.tolist(), strict=True):
        mask[y - top, first - left : last - left + 1] = True
    return mask, left, top


@dataclass
class Volleys:
    """A batch of shots, as each side likes them; all of it is made before the clock starts.

    Parameters
    ----------
    peers : make the lists of the peers, too
    """

    at: Floats
    aim: Floats | None = None
    toward: Floats | None = None
    exclude: Ints | None = None
    pellets: Ints | None = None
    lists: dict[str, Any] = field(default_factory=dict)
    peers: InitVar[bool] = True

    def __post_init__(self, peers: bool) -> None:
        """Make the lists of the peers."""
        if not peers:
            return
        xy = pixel(snap(self.at))
        self.lists["x"], self.lists["y"] = xy[:, 0].tolist(), xy[:, 1].tolist()
        self.lists["xy"] = xy
        if self.aim is not None:
            self.lists["aim"] = self.aim.astype(int).tolist()
            far = self.at + 1000 * np.stack([np.cos(np.radians(self.aim)), np.sin(np.radians(self.aim))], axis=1)
            self.lists["ray ends"] = list(map(tuple, far.tolist()))
            self.lists["ends"] = far
        self.lists["places"] = list(map(tuple, self.at.tolist()))
        if self.pellets is not None:
            self.lists["pellets"] = [list(map(tuple, some)) for some in self.pellets.tolist()]


Aimed = ("beam 300x6", "ray 1000")


def volleys(
    name: str, count: int, seed: int, *, area: tuple[float, float, float, float] = (0, 0, *WORLD)
) -> Iterator[Volleys]:
    """Fresh shots for each round, uniform over an area (x_min, y_min, x_max, y_max)."""
    return (run[0] for run in runs(name, count, seed, 1, area=area))


def runs(
    name: str, count: int, seed: int, row: int, *, area: tuple[float, float, float, float] = (0, 0, *WORLD)
) -> Iterator[list[Volleys]]:
    """Runs of so many batches for each round; peers, who answer a part of a batch, have their lists of the first."""
    rng = np.random.default_rng(seed)
    while True:
        run = []
        for number in range(row):
            at = np.floor(rng.uniform(area[:2], area[2:], (count, 2)))
            aim = rng.integers(0, 360, count).astype(float) if name in Aimed else None
            pellets = None if number else placed_pellets(PATTERNS[name], at)
            run.append(Volleys(at, aim, pellets=pellets, peers=not number))
        yield run


def placed_pellets(weapon: Weapon, at: Floats) -> Ints | None:
    """Whole pixels (N, pellets, 2) of the pellets of a spread."""
    if not isinstance(weapon, Spread):
        return None
    shot = np.arange(len(at))
    seed = np.full(len(at), SEED, np.uint64)
    return pixel(snap(at))[:, None] + disc_offsets(int(snap(weapon.radius)), seed, shot, 0 * shot, weapon.count)
