"""Pictures of what differs between a golden and what was got: where, and closely around the first pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, Image
from planes.image import write_png
from planes.items import Role
from planes.labels import plane_objects
from planes.scene import Scene
from weapons.goldfile import SCENE_PLANES, Golden, Unlike, opaque, pixels_unlike
from weapons.versus import picture_of_difference
from weapons.world import enlarged

__all__ = ["draw_difference", "picture_of_pixels", "pictures_of", "scene_of"]

RED = (255, 40, 40)
"""What differs."""

GROUND, NOWHERE = (12, 13, 16), (60, 62, 68)
"""Where a plane has nothing, and where one of two pictures does not reach."""

DIM = 140
"""Light left of what does not differ, of 255."""

PICTURE_CLOSE, PLANE_CLOSE, CLOSE_SIDE = 80, 40, 320
"""Width of what a close view shows of a picture and of a plane, px, and about how wide it is drawn."""

GAP = 8
"""Between the views of a close picture, px."""

PLANE = "plane-{}-"
"""Before the files of a plane; its name may be none for a file."""

COMPARED = "hits.png"
"""Hits expected and got side by side, where they differ."""

HASH = np.array([73_856_093, 19_349_663, 83_492_791], np.uint64)
"""Teschner et al., "Optimized Spatial Hashing" (2003): primes that tell neighbouring labels apart by colour."""

Plane = npt.NDArray[Any]
Row = list[tuple[str, str]]
"""Pictures side by side: caption and file."""


def pictures_of(changed: Unlike) -> list[str]:
    """Files that `draw_difference` may write."""
    planes = [f"{PLANE.format(i)}{part}.png" for i in range(len(changed.planes)) for part in ("difference", "crop")]
    return [COMPARED, "expected.png", "got.png", "difference.png", "crop.png", *planes]


def draw_difference(folder: Path, expected: Golden | None, got: Golden, changed: Unlike) -> list[Row]:
    """Write what was expected, what was got and what differs into a folder.

    Returns
    -------
    rows of pictures, as a page shows them: caption and file of each
    """
    write_png(folder / "got.png", got.picture)
    if expected is None:
        return [[("got", "got.png")]]
    write_png(folder / "expected.png", expected.picture)
    rows: list[Row] = []
    if changed.hits:
        scenes = scene_of(expected), got.scene
        write_png(folder / COMPARED, picture_of_difference(expected.report, got.report, scenes))
        rows += [[("hits: expected, got, difference", COMPARED)]]
    rows += [[("expected", "expected.png"), ("got", "got.png")]]
    if changed.picture:
        was, now = opaque(expected.picture), opaque(got.picture)
        rows[-1] += [("difference", "difference.png")]
        rows += [_close(folder, "", was, now, _differ(was, now), PICTURE_CLOSE)]
    for number, name in enumerate(name for name in changed.planes if name in expected.planes and name in got.planes):
        was, now = expected.planes[name], got.planes[name]
        differ = _differ(was, now)
        rows += [
            _close(folder, PLANE.format(number), coloured(was), coloured(now), differ, PLANE_CLOSE, f"plane {name}: ")
        ]
    return rows


def scene_of(golden: Golden) -> Scene | None:
    """What is left of the scene of a golden: what was seen of the objects and occluders, under their ids."""
    if not set(SCENE_PLANES) <= golden.planes.keys():
        return None
    scene = Scene()
    fields = zip(SCENE_PLANES, (Role.HITTABLE, Role.OCCLUDER), strict=True)
    found = [(role, *one) for name, role in fields for one in plane_objects(name, role.value, golden.planes[name])]
    for role, label, sprite, left, top in sorted(found, key=lambda one: int(one[1])):
        scene.items.skip_to(int(label) - 1)
        scene.add(sprite, (left + golden.origin_xy[0], top + golden.origin_xy[1]), role=role)
    return scene


def picture_of_pixels(now: Image, differ: Bools) -> Image:
    """A picture dimmed, and red where it differs."""
    out = np.full((*differ.shape, 3), NOWHERE, np.uint8)
    grey = now[:, :, :3].astype(np.uint32).sum(axis=2, keepdims=True) // 3 * DIM // 255
    out[: now.shape[0], : now.shape[1]] = grey
    out[differ] = RED
    return out


def coloured(plane: Plane) -> Image:
    """A plane (h, w) or (h, w, channels) as colours: labels apart from each other, other numbers from dark to light."""
    if plane.dtype == np.uint8 and plane.ndim == 3 and plane.shape[2] in (3, 4):
        return plane[:, :, :3]
    flat = plane if plane.ndim == 2 else plane.max(axis=2, initial=0)
    out = np.full((*flat.shape, 3), GROUND, np.uint8)
    if flat.dtype.kind == "f":
        known = np.where(np.isfinite(flat), flat, 0).astype(np.float64)
        top = max(float(np.abs(known).max(initial=0)), np.finfo(np.float64).tiny)
        out[:] = (np.abs(known) / top * 255).astype(np.uint8)[:, :, None]
        return out
    some = flat != 0
    labels = flat[some].astype(np.int64).astype(np.uint64)
    out[some] = 80 + (labels[:, None] * HASH >> np.uint64(7)) % np.uint64(176)
    return out


def _differ(was: Plane, now: Plane) -> Bools:
    """Where (h, w) two planes differ, over the size of both; all of what only one of them has does."""
    height, width = (max(sides) for sides in zip(was.shape[:2], now.shape[:2], strict=True))
    out = np.ones((height, width), np.bool_)
    rows, columns = (min(sides) for sides in zip(was.shape[:2], now.shape[:2], strict=True))
    was, now = ((side if side.ndim == 3 else side[:, :, None])[:rows, :columns] for side in (was, now))
    channels = min(was.shape[2], now.shape[2])
    out[:rows, :columns] = pixels_unlike(was[:, :, :channels], now[:, :, :channels])
    return out


def _close(folder: Path, prefix: str, was: Image, now: Image, differ: Bools, side: int, caption: str = "") -> Row:
    """Write where two pictures differ, and three views around the first pixel that does, enlarged by a whole factor."""
    all_of_it = picture_of_pixels(now, differ)
    write_png(folder / f"{prefix}difference.png", all_of_it)
    y, x = (int(v[0]) for v in np.nonzero(differ)) if differ.any() else (0, 0)
    width, height = min(side, differ.shape[1]), min(side * 3 // 4, differ.shape[0])
    left = min(max(x - width // 2, 0), differ.shape[1] - width)
    top = min(max(y - height // 2, 0), differ.shape[0] - height)
    factor = max(CLOSE_SIDE // width, 1)
    views = []
    for picture in (was, now, all_of_it):
        view = np.full((height, width, 3), NOWHERE, np.uint8)
        part = picture[top : top + height, left : left + width, :3]
        view[: part.shape[0], : part.shape[1]] = part
        views.append(np.pad(enlarged(view, factor), ((0, 0), (0, GAP), (0, 0))))
    write_png(folder / f"{prefix}crop.png", np.concatenate(views, axis=1)[:, :-GAP])
    around = f"{caption}around ({x}, {y}), {factor} times: expected, got, difference"
    whole = [(f"{caption}difference", f"{prefix}difference.png")] if caption else []
    return [*whole, (around, f"{prefix}crop.png")]
