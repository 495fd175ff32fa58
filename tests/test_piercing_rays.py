"""Rays that go on and are cast, in numpy and compiled: the rows, passes and stops of the walk, which oracles judge."""

from __future__ import annotations

import importlib
import math
import random
from typing import Any

import numpy as np
import pytest
from some_of import some_of

from hitplanes import ALL, Hits, Laser, Pistol, Projectile, Rifle, Scene, Spread, Sweep, Weapon, fire
from hitplanes.planes.common.backend import kernels_of
from hitplanes.planes.grid.rasterize import DIAGONAL, FAR, Lines
from hitplanes.weapons.rays import raycast

Pixel = tuple[int, int]

WIDTHS = (0, 0.25, 1, 182 * 2 / 256, 1.5, 3, 9, 30)
"""On both sides of the width from which on a ray covers all cells that its axis touches, and on it."""

WEAPONS: tuple[Any, ...] = (
    lambda reach, width: Laser(reach, width=width),
    lambda reach, width: Laser(reach, width=width, falloff="linear"),
    lambda reach, width: Rifle(reach, width=width, max_hits=1),
    lambda reach, width: Rifle(reach, width=width, max_hits=2),
    lambda reach, width: Rifle(reach, width=width, max_hits=7),
    lambda reach, width: Rifle(reach, width=width, budget=3.25),
    lambda reach, width: Rifle(reach, width=width, budget=9),
    lambda reach, width: Rifle(reach, width=width, budget=70),
    lambda reach, width: Rifle(reach, width=width, budget=20, max_hits=5),
    lambda reach, width: Rifle(reach, width=width, budget=0),
    lambda reach, width: Projectile(reach, width / 2),
    lambda reach, width: Pistol(reach, width=width),
    lambda reach, width: Sweep(Laser(reach, width=width), 40, 5),
    lambda reach, width: Spread(Rifle(reach, width=width, max_hits=3), 4, 9),
)


def crowd(
    rng: np.random.Generator, items: int, side: int, at: tuple[int, int] = (0, 0), bounded: bool = False
) -> Scene:
    """Items of up to 9 px with holes, many on the same cells, some of them occluders; a px costs from 0 to 3."""
    scene = Scene((side, side), at) if bounded else Scene()
    for number in range(items):
        mask = rng.random(rng.integers(1, 10, 2)) < 0.7
        scene.add(
            mask, rng.integers(-3, side + 3, 2) + at, role="occluder" if rng.random() < 0.15 else "hittable",
            layer=int(rng.integers(3)), owner=number // 3, categories=int(rng.integers(1, 4)),
            cost=int(rng.integers(4)),
        )  # fmt: skip
    return scene


def shots(rng: np.random.Generator, count: int, side: int) -> dict[str, Any]:
    """Starts on halves of pixels and elsewhere, and points aimed at, so that many cells are entered at once."""
    fine = np.where(rng.random((count, 1)) < 0.7, 2, 256)
    at, toward = (np.floor(rng.uniform(-5, side + 5, (count, 2)) * fine) / fine for _ in range(2))
    return {"at": at, "toward": toward + (at == toward).all(axis=1, keepdims=True)}


def as_walked(scene: Scene, weapon: Weapon, **how: Any) -> Hits:
    """The answer, which is that of the walk."""
    hits = fire(scene, weapon, **how)
    assert hits == fire(scene, weapon, strategy="walk", **how)
    return hits


@pytest.mark.parametrize("seed", some_of(range(12)))
def test_rays_that_are_cast_are_those_that_walk(jit: bool, seed: int) -> None:
    """In crowds, where a ray looks at its items in several rounds; filtered, with owners left out, and in bounds."""
    rng = np.random.default_rng(seed)
    side, found = int(rng.integers(12, 60)), 0
    scene = crowd(rng, int(rng.integers(5, 90)), side, bounded=bool(seed % 3))
    for make in WEAPONS:
        weapon, how = make(int(rng.integers(1, 2 * side)), float(rng.choice(WIDTHS))), shots(rng, 25, side)
        if seed % 2:
            how |= {"accept": rng.integers(0, 4, 25), "blocked_by": rng.choice([0, 1, 2, ALL], 25)}
            how["exclude"] = rng.integers(0, 3, (25, 2))
        found += len(as_walked(scene, weapon, **how))
    assert found > 50


@pytest.mark.parametrize("width", some_of(WIDTHS, 2))
def test_a_ray_of_no_length_or_toward_its_own_start(jit: bool, width: float) -> None:
    scene = crowd(np.random.default_rng(3), 60, 12)
    at = np.stack(np.meshgrid(np.arange(24) / 2, np.arange(24) / 2), axis=-1).reshape(-1, 2)
    for weapon in (Laser(0, width=width), Rifle(0, width=width, max_hits=2), Projectile(0, width / 2)):
        assert len(as_walked(scene, weapon, at=at, aim=0))


@pytest.mark.parametrize("width", [0, 1, 5])
@pytest.mark.parametrize("at", [(2**40 - 200, -(2**40) + 9), (-(10**9), 10**9)])
def test_far_from_the_origin(jit: bool, width: float, at: Pixel) -> None:
    rng = np.random.default_rng(5)
    how = {name: where + at for name, where in shots(rng, 40, 40).items()}
    scene = crowd(rng, 60, 40, at)
    for make in WEAPONS[:5]:
        assert len(as_walked(scene, make(60, width), **how))


@pytest.mark.parametrize("width", [0, 0.5, 1.4, 1.5, 7, 200, 4000])
@pytest.mark.parametrize("reach", [3000, 2**17 - 1, 2**17, 2**20])
def test_long_rays(jit: bool, width: float, reach: int) -> None:
    """On both sides of the lengths up to which the kernel serves."""
    rng = np.random.default_rng(reach)
    scene, degrees = Scene(), rng.uniform(0, 360, 6)
    along = np.stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))], axis=1)
    for part in (0, 0.01, 0.3, 0.7, 1):
        for way in along:
            where = part * reach * way + rng.uniform(-3, 3, 2) * max(width, 1) / 6
            scene.add(rng.random((7, 7)) < 0.6, where, role="occluder" if part == 0.7 else "hittable")
    for weapon in (Laser(reach, width=width), Rifle(reach, width=width, max_hits=2)):
        assert len(as_walked(scene, weapon, at=np.zeros((6, 2)), aim=degrees)) > 5 or width > reach


def test_many_rays_in_a_wide_world(jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Items are looked up in cells of the world, also by rays that begin outside of all cells."""
    rng, scene = np.random.default_rng(6), Scene()
    for where in rng.integers(0, 2000, (400, 2)).tolist():
        scene.add(rng.random((12, 12)) < 0.7, where, role="occluder" if rng.random() < 0.1 else "hittable")
    at, aim = rng.uniform(-300, 2300, (300, 2)), rng.uniform(0, 360, 300)
    for weapon in (Laser(90), Laser(90, width=7), Rifle(120, max_hits=2), Projectile(100, 3)):
        for pairs in (1, 2**30):
            for module in ("planes.bits.cells", "weapons.rays.raycast", *(["planes.jit.raycast"] if jit else [])):
                monkeypatch.setattr(f"hitplanes.{module}.BRUTE_PAIRS", pairs)
            assert len(as_walked(scene, weapon, at=at, aim=aim)) > 20


def test_the_limits_of_the_kernel() -> None:
    """It serves rays up to them, and no others."""
    jit, stack = pytest.importorskip("hitplanes.planes.jit.raycast"), Scene().items.stack()

    def serves(length: int, radius: int) -> bool:
        lines = Lines(np.zeros((1, 2), np.int64), np.array([[length, 0]]), radius)
        return jit.hits_and_ends(stack, None, lines, None) is not None

    assert serves(jit.FARTHEST, 0) and not serves(jit.FARTHEST + 1, 0)
    assert serves(2**24, DIAGONAL - 1) and not serves(2**25, DIAGONAL - 1) and serves(2**25, DIAGONAL)
    radius = 2**20
    longest = int((FAR / 2) ** 0.5) // radius
    assert serves(longest - 1, radius) and not serves(longest + 1, radius)


def test_no_rays_and_no_items(jit: bool) -> None:
    kernels, none = kernels_of(raycast), np.zeros((0, 2), np.int64)
    for stack in (Scene().items.stack(), crowd(np.random.default_rng(1), 9, 9).items.stack()):
        for radius in (0, 300):
            hit, ends = kernels.hits_and_ends(stack, None, Lines(none, none, radius), None)
            assert hit.shape == (6, 0) and ends.shape == (6, 0)
    hit, ends = kernels.hits_and_ends(Scene().items.stack(), None, Lines(none[:0].repeat(1, 0), none, 0), 3)
    assert hit.shape == (6, 0)


def test_many_rays_need_little_memory_and_few_passes_at_a_time(jit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Passes of a batch in parts of few cells are those of the batch."""
    rng = np.random.default_rng(8)
    scene, how = crowd(rng, 50, 40), shots(rng, 200, 40)
    for weapon in (Laser(50), Laser(50, width=3), Sweep(Rifle(50, max_hits=3), 90, 4)):
        whole = fire(scene, weapon, **how)
        with monkeypatch.context() as patch:
            patch.setattr("hitplanes.weapons.rays.ray_hits.CHUNK_CELLS", 20)
            cut = fire(scene, weapon, **how)
        assert cut == whole and len(cut.passes) > 100  # type: ignore[attr-defined]


def test_passes_are_read_after_items_have_moved_and_gained_speed(jit: bool) -> None:
    rng = np.random.default_rng(9)
    for weapon in (Laser(50, width=3), Projectile(50, 2)):
        scene, how = crowd(rng, 50, 40), shots(rng, 50, 40)
        before, hits = fire(scene, weapon, **how), fire(scene, weapon, **how)
        assert len(before.passes)  # type: ignore[attr-defined] # made now
        scene.set(scene.ids(), velocity_xy=(3, -2))
        scene.move(scene.ids(), np.zeros((len(scene.ids()), 2)))
        assert hits == before


def test_roots_and_shares_of_the_kernel_are_exact() -> None:
    """Also where products of 64 bits wrap around."""
    jit, rng = pytest.importorskip("hitplanes.planes.jit.planes"), random.Random(4)
    njit = importlib.import_module("numba").njit  # with an entry for Python
    half_chord, share = (njit(helper.py_func) for helper in (jit.half_chord, jit.share))
    for bits in (3, 20, 30, 40, 56):
        for _ in range(300):
            length2, radius = rng.randint(1, 2**bits), rng.randint(1, 2 ** min(17, (89 - bits) // 2 + 1))
            v = rng.choice([0, 1, rng.randint(0, math.isqrt(radius**2 * length2)), math.isqrt(radius**2 * length2)])
            assert half_chord(radius, v, length2) == math.isqrt(radius**2 * length2 - v * v)
    for _ in range(1000):
        length2 = rng.randint(1, 2 ** rng.randint(1, 50))
        scale = rng.randint(1, max(length2 // 2, 1))
        time = rng.choice([0, scale, rng.randint(0, scale), scale // 2])
        parts, part = rng.randint(3, 99), rng.randint(1, 2**40)
        whole = rng.randint(0, parts), parts * part, parts * rng.randint(part, 2**43)  # quotients are whole numbers
        for time_, scale_, length2_ in ((time, scale, length2), (whole[0] * part, whole[1], whole[2])):
            for sign in (1, -1):
                assert share(sign * time_, length2_, scale_) == sign * time_ * length2_ // scale_
