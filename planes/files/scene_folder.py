"""Scene folders (scene.json and its PNGs), read and written; and the checks of output folders."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from ..common.checks import Image, InputError, integer, path_of, shown, suggestion, within
from ..common.limits import (
    ALL,
    ALPHA_THRESHOLD,
    ANGLE_STEPS_MAX,
    COST_MAX,
    IDS_MAX,
    LAYER_MAX,
    MASK_AREA_MAX,
    MASK_SIDE_MAX,
    POSITION_MAX,
    REACH_MAX,
    SCALE_MAX,
    SCALE_MIN,
    SUB,
)
from ..common.tables import (
    TEXT_MAX,
    Const,
    Either,
    Keys,
    Mapped,
    Mask,
    Names,
    Number,
    Numbers,
    OneOrEach,
    Optional,
    Ref,
    Rows,
    Text,
    Value,
    Whole,
    Wholes,
    Within,
    Word,
    inside,
    json_of,
)
from ..scene.objects import OCCLUDER, PLANE_NAMES, ROLES
from ..scene.scene import Scene, default_bits
from ..scene.sprite import Carving, Sprite, frame_pivot, frozen, local_grid, rows_of
from ..scene.variants import FLIPS, ONE
from .png import possible, read_png, read_text, write_png, write_text

FORMAT = "hitplanes-scene/2"
ONE_FILTER = "hitplanes-scene/1"  # older format, in which `accept` of a shot is the filter of what blocks, too

FILE_NAME = "scene.json"
SECTIONS = dict(zip(PLANE_NAMES, ROLES, strict=True))
POINT = Numbers((2,), POSITION_MAX)
PIVOT = Numbers((2,), MASK_SIDE_MAX)
COLOR = Wholes((3,), 0, 255)
RING = Numbers((None, 2), MASK_SIDE_MAX, least=3)
ID = Whole(0, IDS_MAX - 1)
CELLS_MOST = 512  # most cells along a pixel of a carved sprite: what the largest scale needs, turned

CARVED = Keys({"image": Text(), "frame": Whole(0, 2**31 - 1), "cells_per_px": Whole(1, CELLS_MOST)}, ("image",))
FRAMES = Keys({"grid_wh": Wholes((2,), 1, MASK_SIDE_MAX), "rects_xywh": Wholes((None, 4), 0, MASK_SIDE_MAX)})
COMMON: dict[str, Value] = {"angle_step": Number(360 / ANGLE_STEPS_MAX, 360), "carved": Rows(Within(CARVED))}
OF_IMAGES: dict[str, Value] = {
    "alpha_threshold": Whole(0, 255), "color_key": COLOR,
    "pivot_xy": OneOrEach(PIVOT, Numbers((None, 2), MASK_SIDE_MAX)), "frame_names": Names(), **COMMON,
}  # fmt: skip
SOURCES: dict[str, dict[str, Value]] = {
    "image": {"image": Text(), "frames": Within(FRAMES), **OF_IMAGES},
    "images": {"images": Rows(Text()), **OF_IMAGES},
    "polygon": {"polygon": RING, "holes": Rows(RING), "color": COLOR, **COMMON},
    "circle": {"circle": Number(0, MASK_SIDE_MAX), "color": COLOR, **COMMON},
    "box_wh": {"box_wh": Numbers((2,), MASK_SIDE_MAX, low=0), "color": COLOR, **COMMON},
    "mask": {"mask": Either(str, Text(), Mask()), "pivot_xy": PIVOT, "color": COLOR, **COMMON},
}
POSE: dict[str, Value] = {
    "angle": Number(), "scale": Either(list, Numbers((2,), SCALE_MAX, low=SCALE_MIN), Number(SCALE_MIN, SCALE_MAX)),
    "flip": Word(FLIPS), "frame": Either(str, Text(), Whole(0, 2**31 - 1)), "layer": Whole(-LAYER_MAX, LAYER_MAX),
    "cost": Whole(0, COST_MAX), "velocity_xy": Numbers((2,), REACH_MAX),
}  # fmt: skip
PLACED: dict[str, Value] = {
    "id": ID, "name": Text(), "position_xy": POINT, **POSE, "categories": Names(), "owner": Either(str, Text(), ID),
}  # fmt: skip
OBJECT = {kind: Keys({**PLACED, **keys}, (kind, "position_xy")) for kind, keys in SOURCES.items()}
BOUNDS = Keys(
    {"origin_xy": Wholes((2,), -POSITION_MAX, POSITION_MAX), "size_wh": Wholes((2,), 1, POSITION_MAX)}, ("size_wh",)
)
SCENE = Keys({
    "$schema": Text(), "format": Const(FORMAT, (ONE_FILTER,)), "name": Text(), "bounds": Optional(Within(BOUNDS)),
    "categories": Names(), "next_id": Whole(0, IDS_MAX),
    "objects": Within(Keys({section: Rows(Ref("object")) for section in SECTIONS})),
    "weapons": Mapped(Ref("weapon")), "shots": Rows(Ref("shot")),
}, ("format",))  # fmt: skip
"""The form of a scene file. Objects, weapons and shots are checked separately when they are read."""

SHEET_WIDTH = 4096  # approximate width of the sheet on which the frames of a saved sprite are laid out in rows, px
MASK_ROWS_AREA = 4096  # largest mask that is saved as rows of text, px; a larger one is saved as a PNG


class Entry(NamedTuple):
    """An object of a scene file: its place there, its id and owner if they are given, and what `Scene.add` is given."""

    place: str
    id: int | None
    owner: str | int | None
    options: dict[str, Any]


def load_scene(folder: str | Path) -> Scene:
    """Read a scene folder, scene.json and the PNGs that it names, given its path or that of its scene.json.

    Weapons and shots of the file are kept as plain JSON in `scene.weapons` and `scene.shots`.

    Raises
    ------
    InputError
        With the names of the file, the section, the row and the field.
    """
    path = scene_folder(path_of("folder", folder))
    with within(str(path / FILE_NAME)):
        data = SCENE.check("scene", json_of(read_text(path / FILE_NAME)))
        name = data.get("name") or Text().check("name", path.resolve().name)
        entries = _entries(data.get("objects", {}), path)
        bounds = data.get("bounds") or {}
        scene = Scene(
            bounds.get("size_wh"), bounds.get("origin_xy", (0, 0)), categories=data.get("categories", ()), name=name
        )
        scene.weapons = data.get("weapons", {})
        scene.shots = [_shot_now(shot, data["format"]) for shot in data.get("shots", ())]
        _add_entries(scene, entries, data.get("next_id"))
        return scene


def write_scene(folder: Path, scene: Scene) -> None:
    """Write a scene folder, images first and scene.json last, so that an interrupt leaves the old scene intact."""
    items, rows = scene.items, scene.items.rows
    _check_json(scene)
    for row in rows.tolist():
        with within(f"object {items.id[row]}"):
            _image_name(items.sprites[row])
    with possible(f"folder: cannot make {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
    saved: dict[int, dict[str, Any]] = {}
    images: dict[str, str | None] = {}
    objects: dict[str, list[dict[str, Any]]] = {section: [] for section in SECTIONS}
    for row, role in zip(rows.tolist(), items.role[rows].tolist(), strict=True):
        sprite = items.sprites[row]
        if sprite.uid not in saved:
            saved[sprite.uid] = _saved_source(sprite, folder, images)
        objects[PLANE_NAMES[role]].append(_object_json(scene, row, saved[sprite.uid]))
    x, y, x_max, y_max = scene.bounds or (0, 0, 0, 0)
    data = {
        "format": FORMAT,
        "name": scene.name,
        "bounds": scene.bounds and {"origin_xy": [x, y], "size_wh": [x_max - x + 1, y_max - y + 1]},
        "categories": _saved_categories(scene),
        **({"next_id": items.count} if items.count > items.ids.max(initial=-1) + 1 else {}),
        "objects": objects,
        "weapons": scene.weapons,
        "shots": scene.shots,
    }
    write_text(folder / FILE_NAME, laid_out(data) + "\n")


def _check_json(scene: Scene) -> None:
    """Refuse weapons and shots that are not plain JSON, before anything is written."""
    SCENE.forms["weapons"].check("weapons", scene.weapons)
    places = {f"weapons.{name}": weapon for name, weapon in scene.weapons.items()}
    for place, value in {**places, **{f"shots[{i}]": shot for i, shot in enumerate(scene.shots)}}.items():
        try:
            laid_out([[value]])
        except (TypeError, ValueError, RecursionError) as error:
            makers = [name for name in ("to_json", "to_shot") if hasattr(value, name) and not isinstance(value, type)]
            why = f"give what its {makers[0]}() returns" if makers else str(error)
            raise InputError(f"{place}: expected plain JSON, got {shown(value)}: {why}") from error


def scene_folder(path: Path) -> Path:
    """Folder of a scene, given its path or that of its scene.json."""
    return path.parent if path.name == FILE_NAME else path


def laid_out(value: Any, depth: int = 0, *, whole: int | None = None) -> str:
    """Write JSON with line breaks that suit a text diff.

    Short values take one line, and so does everything from the depth `whole` on. By default this is every object from
    the third level on: one object of the scene, one weapon or one shot a line.
    """
    flat, pad, end = json.dumps(value, allow_nan=False), "\n" + "  " * (depth + 1), "\n" + "  " * depth
    entry = depth > 1 and isinstance(value, dict) if whole is None else depth >= whole
    if (depth > 0 and len(flat) <= 100) or entry or not isinstance(value, dict | list):
        return flat
    if isinstance(value, dict):
        rows = [f"{pad}{json.dumps(key)}: {laid_out(v, depth + 1, whole=whole)}" for key, v in value.items()]
        return "{" + ",".join(rows) + end + "}"
    return "[" + ",".join(pad + laid_out(v, depth + 1, whole=whole) for v in value) + end + "]"


def _shot_now(shot: Any, written: str) -> Any:
    """A shot in today's form. It is checked when it is read, together with the weapons."""
    if written == ONE_FILTER and isinstance(shot, dict) and "accept" in shot:
        return {"blocked_by": shot["accept"], **shot}
    return shot


def _entries(objects: dict[str, Sequence[object]], folder: Path) -> list[Entry]:
    """Check the objects of a file, and put them in the order in which a scene gets them."""
    entries, sprites = [], dict[str, Sprite]()
    for section, role in SECTIONS.items():
        for row, given in enumerate(objects.get(section, ())):
            place = f"objects.{section}[{row}]"
            with within(place):
                data = _object(given, folder, sprites)
                entries.append(Entry(place, data.pop("id", None), data.pop("owner", None), {**data, "role": role}))
    return entries


def _object(entry: object, folder: Path, sprites: dict[str, Sprite]) -> dict[str, Any]:
    """Check an object, and replace what makes its sprite by that; `sprites` has those of earlier objects."""
    if not isinstance(entry, dict):
        raise InputError(f"expected an object, got {shown(entry)}")
    kinds = [key for key in SOURCES if key in entry]
    if len(kinds) != 1:
        unknown = [key for key in entry if not kinds and not any(key in keys.forms for keys in OBJECT.values())]
        hint = next(filter(None, (suggestion(key, SOURCES) for key in unknown)), "")
        got = " and ".join(kinds or unknown) or "none"
        raise InputError(f"source: expected one of {', '.join(SOURCES)}, got {got}{hint}")
    kind = kinds[0]
    data = OBJECT[kind].check("object", entry)
    made_of = {key: data.pop(key) for key in SOURCES[kind] if key in data}
    source = {key: entry[key] for key in made_of}
    shared = json.dumps(source, sort_keys=True)
    if shared not in sprites:
        carvings = made_of.pop("carved", ())
        sprites[shared] = _carved_sprite(READERS[kind](made_of, folder, source), carvings, folder)
    return {**data, "sprite": sprites[shared]}


def _image_sprite(data: dict[str, Any], folder: Path, source: dict[str, Any]) -> Sprite:
    image, frames = read_png(_inside(folder, data.pop("image"))), data.pop("frames", {})
    if "frames" in source and not frames:
        raise InputError("frames: expected grid_wh or rects_xywh, got neither")
    return Sprite.from_image(image, **data, **frames, source=source)


def _images_sprite(data: dict[str, Any], folder: Path, source: dict[str, Any]) -> Sprite:
    images = [read_png(_inside(folder, name)) for name in data.pop("images")]
    return Sprite.from_images(images, **data, source=source)


def _mask_sprite(data: dict[str, Any], folder: Path, source: dict[str, Any]) -> Sprite:
    mask = data.pop("mask")
    if isinstance(mask, str):
        mask = read_png(_inside(folder, mask, "mask"), "mask")[:, :, 3] > ALPHA_THRESHOLD
    return Sprite.from_mask(mask, **data, source=source)


def _carved_sprite(sprite: Sprite, entries: Sequence[dict[str, Any]], folder: Path) -> Sprite:
    """A sprite with what is carved out of its frames: the set pixels of images of cells."""
    carvings: dict[int, Carving] = {}
    for row, entry in enumerate(entries):
        with within(f"carved[{row}]"):
            frame = integer("frame", entry.get("frame", 0), 0, sprite.frame_count - 1)
            per_px = entry.get("cells_per_px", 1)
            if frame in carvings:
                raise InputError(f"frame: expected each once, got {frame} again")
            if per_px & (per_px - 1):
                raise InputError(f"cells_per_px: expected a power of two, got {per_px}")
            gone = read_png(_inside(folder, entry["image"]))[:, :, 3] > ALPHA_THRESHOLD
            (w, h), got = local_grid(sprite, frame)[0], gone.shape[::-1]
            if got != (w * per_px, h * per_px):
                raise InputError(f"image: expected {w * per_px} x {h * per_px} cells, got {got[0]} x {got[1]}")
            carvings[frame] = Carving(frozen(gone), per_px)
    if not carvings:
        return sprite
    return replace(sprite, carvings=carvings, source={**(sprite.source or {}), "carved": list(entries)})


READERS: dict[str, Callable[[dict[str, Any], Path, dict[str, Any]], Sprite]] = {
    "image": _image_sprite,
    "images": _images_sprite,
    "polygon": lambda data, *_: Sprite.polygon(data.pop("polygon"), data.pop("holes", ()), **data),
    "circle": lambda data, *_: Sprite.circle(data.pop("circle"), **data),
    "box_wh": lambda data, *_: Sprite.box(*data.pop("box_wh"), **data),
    "mask": _mask_sprite,
}
"""How the sprite of each kind is made of its checked fields, which are used up."""


def _inside(folder: Path, text: str, field: str = "image") -> Path:
    """Path of a file in the scene's folder; a path that leads out of the folder is refused."""
    path = folder.joinpath(*PurePosixPath(inside(field, text)).parts)
    try:
        within_it = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a link to itself, a name that is too long
        within_it = False
    if not within_it:
        raise InputError(f"{field}: expected a path inside the scene's folder, got {text!r}, which leads out of it")
    return path


def _object_json(scene: Scene, row: int, source: dict[str, Any]) -> dict[str, Any]:
    """An object with its source as JSON; what it has by default is left out."""
    items, transform = scene.items, scene.items.transforms[row]
    item, bits = int(items.id[row]), int(items.categories[row])
    pose = {
        "angle": (items.angles[row], 0),
        "scale": ([transform.scale_x / ONE, transform.scale_y / ONE], [1, 1]),
        "flip": (transform.flip, "none"),
        "frame": (transform.frame, 0),
        "layer": (int(items.layer[row]), 0),
        "cost": (int(items.cost[row]), 1),
        "velocity_xy": ((items.velocity_256[row] / SUB).tolist(), [0, 0]),
        "categories": (bits, default_bits(ROLES[items.role[row]])),
        "owner": (int(items.owner[row]), item),
    }
    told: dict[str, Any] = {key: value for key, (value, usual) in pose.items() if value != usual}
    if "categories" in told:
        told["categories"] = scene.category_names(bits)
    xy = (items.position_256[row] / SUB).tolist()
    return {"id": item, "name": items.names[row], **source, "position_xy": xy, **told}


def _saved_categories(scene: Scene) -> list[str]:
    """Names of the categories from bit 1 on, up to the last that the scene names or an object is saved with."""
    items, rows = scene.items, scene.items.rows
    default = np.where(items.role[rows] == OCCLUDER, ALL, 1)
    used = items.categories[rows][items.categories[rows] != default]
    count = max(len(scene.categories), int(used.max(initial=0)).bit_length())
    return scene.category_names((1 << count) - 1)[1:]


def _saved_source(sprite: Sprite, folder: Path, images: dict[str, str | None]) -> dict[str, Any]:
    """Source of a sprite as JSON; its images are written to the folder without overwriting another file."""
    color = {} if sprite.color is None else {"color": list(sprite.color)}
    options: dict[str, Any] = {} if sprite.angle_step is None else {"angle_step": sprite.angle_step}
    if sprite.carvings:
        carved = f"{PurePosixPath(_image_name(sprite)).stem[: TEXT_MAX - 20]}-carved.png"
        options["carved"] = [
            {"image": _write_apart(folder, carved, _cells(carving), images), "frame": frame,
             "cells_per_px": carving.per_px}
            for frame, carving in sorted(sprite.carvings.items())
        ]  # fmt: skip
    if sprite.outline is not None:
        return {**(sprite.source or {}), **color, **options}
    masks = [frame.mask for frame in sprite.frames]
    if sprite.pivot_256 is not None:
        options["pivot_xy"] = [v / SUB for v in sprite.pivot_256]
    elif sprite.frames[0].pivot_256 is not None:
        options["pivot_xy"] = [[v / SUB for v in frame_pivot(sprite, frame)] for frame in sprite.frames]
    if len(masks) == 1 and sprite.frames[0].image is None:
        large = masks[0].size > MASK_ROWS_AREA
        mask = _write_apart(folder, _image_name(sprite), _sheet(sprite)[0], images) if large else rows_of(masks[0])
        return {"mask": mask, **options, **color}
    known = sprite.source or {}
    if sprite.frames[0].image is not None and "alpha_threshold" in known:
        options["alpha_threshold"] = known["alpha_threshold"]
    sheet, rects = _sheet(sprite)
    if len(rects) > 1:
        options["frames"] = {"rects_xywh": rects}
    if sprite.frame_names:
        options["frame_names"] = list(sprite.frame_names)
    return {"image": _write_apart(folder, _image_name(sprite), sheet, images), **options}


def _cells(carving: Carving) -> Image:
    """Cells that are gone as an image: black and opaque, on nothing."""
    cells = np.zeros((*carving.gone.shape, 4), np.uint8)
    cells[:, :, 3] = np.where(carving.gone, 255, 0)
    return cells


def _image_name(sprite: Sprite) -> str:
    """Path from which the image of a sprite was read, or a new name for it."""
    source = sprite.source or {}
    named = [source["mask"]] if isinstance(source.get("mask"), str) else source.get("images", ())
    return inside("source.image", source.get("image", (*named, "sprite.png")[0]))


def images_of(sprite: Sprite) -> set[str]:
    """Paths of the images in a scene's folder from which a sprite was read."""
    source = sprite.source or {}
    single = {source[key] for key in ("image", "mask") if isinstance(source.get(key), str)}
    return single | {*source.get("images", ())} | {entry["image"] for entry in source.get("carved", ())}


def _sheet(sprite: Sprite) -> tuple[Image, list[list[int]]]:
    """Lay out all frames in rows on one sheet; return it and the rectangles."""
    widest = max(SHEET_WIDTH, *(frame.mask.shape[1] for frame in sprite.frames), 0)
    rects, x, y, tall = [], 0, 0, 0
    for frame in sprite.frames:
        h, w = frame.mask.shape
        if x + w > widest:
            x, y, tall = 0, y + tall, 0
        rects.append([x, y, w, h])
        x, tall = x + w, max(tall, h)
    width, height = max(r[0] + r[2] for r in rects), y + tall
    if height > MASK_SIDE_MAX or width * height > MASK_AREA_MAX:
        raise InputError(f"frames: expected frames that fit one sheet of {MASK_AREA_MAX} px, got {width} x {height}")
    sheet = np.zeros((height, width, 4), np.uint8)
    for frame, (left, top, w, h) in zip(sprite.frames, rects, strict=True):
        part = sheet[top : top + h, left : left + w]
        if frame.image is not None:
            part[:] = frame.image
        else:
            part[frame.mask] = (*(sprite.color or (255, 255, 255)), 255)
    return sheet, rects


def _write_apart(folder: Path, name: str, sheet: Image, images: dict[str, str | None]) -> str:
    """Write an image under its own name, or under a numbered one if another image has that name.

    `images` holds the digests of the files that were read; None stands for no file.
    """
    stem, own = PurePosixPath(name).stem, _digest(sheet)
    for number in range(1, 10**6):
        ending = ".png" if number == 1 else f"-{number}.png"
        path = folder / (stem[: TEXT_MAX - len(ending)] + ending)
        if path.name not in images:
            images[path.name] = _digest_of(path)
        if images[path.name] is None:
            write_png(path, sheet)
            images[path.name] = own
        if images[path.name] == own:
            return path.name
    raise InputError(f"image: expected a free name like {name!r} in {folder}")


def _digest_of(path: Path) -> str | None:
    """Digest of an image file; for another file one that no image has."""
    if not path.exists() and not path.is_symlink():
        return None
    try:
        return _digest(read_png(path))
    except InputError:
        return ""


def _digest(image: Image) -> str:
    import hashlib  # few calls need it, and it is slow to load

    return hashlib.sha256(repr(image.shape).encode() + image.tobytes()).hexdigest()


def _add_entries(scene: Scene, entries: Sequence[Entry], next_id: int | None) -> None:
    """Add the objects of a file in the order of their ids, then set their owners, which may be later or removed."""
    numbered = [entry.id is not None for entry in entries]
    if any(numbered) and not all(numbered):
        raise InputError("objects: expected an id for each object or for none, got some")
    entries, items = sorted(entries, key=lambda entry: entry.id or 0), scene.items
    for entry in entries:
        with within(entry.place):
            if entry.id is not None:
                if entry.id < items.count:
                    raise InputError(f"id: expected each id once, got {entry.id} again")
                items.table.skip_to(entry.id)
            scene.add(**entry.options)  # masks are made all together, when the scene is first read
    if next_id is not None:
        items.table.skip_to(integer("next_id", next_id, items.count, IDS_MAX))
    for item, entry in zip(scene.ids().tolist(), entries, strict=True):
        if entry.owner is not None:
            with within(entry.place):
                scene.set(item, owner=_owner_id(scene, entry))


def _owner_id(scene: Scene, entry: Entry) -> int:
    """Id of an owner, given by its name or the id of an object that the scene has or had."""
    owner, last = entry.owner, scene.items.count - 1
    if isinstance(owner, str):
        with within("owner"):
            return scene.find(owner)
    if entry.id is not None and owner is not None and owner > last:
        how = f"if that object was removed, the scene needs a next_id of {owner + 1}"
        raise InputError(f"owner: expected a whole number from 0 to {last}, got {owner}: {how}")
    return integer("owner", owner, 0, last)


@contextmanager
def new_folder(folder: Path) -> Iterator[list[Path]]:
    """Make a folder unless it exists and is empty; after an error, remove it and the files that are listed."""
    made, files = False, list[Path]()
    with possible(f"folder: cannot make {folder}"), suppress(FileExistsError):
        folder.mkdir()
        made = True
    if not folder.is_dir():
        raise InputError(f"folder: expected a new folder, got the file {folder}")
    with possible(f"folder: cannot read {folder}"):
        held = sorted(path.name for path in folder.iterdir())
    if held:
        raise InputError(f"folder: expected a new or empty folder, got {folder} with {held[0]!r} in it")
    try:
        yield files
    except BaseException:
        with suppress(OSError):
            for path in files:
                path.unlink(missing_ok=True)
            if made:
                folder.rmdir()
        raise


def own_folder(folder: Path, names: Sequence[str]) -> bool:
    """Make a folder, or accept one that holds only files of these names, and return whether it is new."""
    with possible(f"--output: cannot make {folder}"):
        if folder.exists() and not folder.is_dir():
            raise InputError(f"--output: expected a folder, got the file {folder}")
        new = not folder.exists()
        folder.mkdir(exist_ok=True)
        held = sorted(path.name for path in folder.iterdir() if path.name not in names)
    if held:
        got = f"got {folder} with {held[0]!r} in it"
        raise InputError(f"--output: expected a new folder, or that of an earlier run, {got}")
    return new


def cleared(folder: Path, names: Sequence[str]) -> None:
    """Remove the files of these names that exist; an InputError names one that cannot be removed."""
    for name in names:
        with possible(f"--output: cannot remove {folder / name}"):
            (folder / name).unlink(missing_ok=True)
