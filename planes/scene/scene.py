"""The scene: objects with roles and poses, and the methods that add, change, remove and read them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import late
from ..common.checks import (
    Bools,
    Floats,
    InputError,
    Ints,
    array_of,
    choice,
    each,
    integer,
    integers,
    listed,
    path_of,
    reals,
    rising,
    within,
)
from ..common.limits import ALL, CATEGORY_BITS, COST_MAX, LAYER_MAX, POSITION_MAX, REACH_MAX, SCALE_BITS, SUB
from ..common.tables import Text, typed
from ..grid.fixed_point import all_quarter_turns, snap
from ..grid.spans import Box
from .derived import Derived
from .items import ROLES, Items, Role
from .render import Planes, plane_objects, plane_size
from .sprite import as_sprite
from .variants import FLIPS, Transform, transform_of, whole_scale

if TYPE_CHECKING:
    from ..files.scene_folder import FileObject
    from ..volumes.volumes import Volumes


NUMBERS = frozenset((int, float, np.float64))
FLOAT64 = np.dtype(np.float64)


def points(field: str, values: object, n: int, limit: float = POSITION_MAX) -> Floats:
    """Positions or velocities (n, 2), or one (2,) for all, px."""
    if array_of(field, values).shape == (2,):
        return np.broadcast_to(reals(field, values, (2,), limit), (n, 2))
    return reals(field, values, (n, 2), limit)


def are_rows(ids: object, xy: object) -> bool:
    """Whether these are contiguous arrays of ids (n,) and of positions (n, 2)."""
    if type(ids) is not np.ndarray or type(xy) is not np.ndarray or ids.dtype != np.int64 or xy.dtype != np.float64:
        return False
    return ids.ndim == 1 and xy.shape == (len(ids), 2) and ids.flags.c_contiguous and xy.flags.c_contiguous


def one_place(xy: object) -> tuple[int, int] | None:
    """Round one position in range as `snap` does; None for any other value, valid or not."""
    if type(xy) is np.ndarray:
        if xy.dtype != FLOAT64 or xy.shape != (2,):
            return None
        x, y = xy.tolist()
    elif isinstance(xy, tuple | list) and len(xy) == 2 and type(xy[0]) in NUMBERS and type(xy[1]) in NUMBERS:
        x, y = xy
    else:
        return None
    if not (-POSITION_MAX <= x <= POSITION_MAX and -POSITION_MAX <= y <= POSITION_MAX):
        return None
    return round(x * SUB), round(y * SUB)


def scale_pair(scale: object) -> tuple[float, float]:
    """Check a scale, one number or (sx, sy), and return the pair."""
    values = array_of("scale", scale)
    sx, sy = reals("scale", values if values.ndim else np.stack([values, values]), (2,)).tolist()
    return sx, sy


def changed_transforms(
    items: Items, rows: Ints, angle: object, scale: object, flip: object, frame: object
) -> tuple[list[float], list[Transform] | None]:
    """Angles and transforms of objects after a change; None for the transforms if none changes."""
    n, ids = len(rows), rows.tolist()
    angles = [items.angles[item] for item in ids]
    if angle is None and scale is None and flip is None and frame is None:
        return angles, None
    columns: Iterable[Any] = zip(*(items.forms[item] for item in ids), strict=True) if n else ((),) * len(Transform())
    frames, flips, x, y, *turns = columns
    if angle is not None:
        angles = reals("angle", each("angle", angle, n), (n,)).tolist()
        turns = all_quarter_turns([items.sprites[item].stepped(angle) for item, angle in zip(ids, angles, strict=True)])
    if scale is not None:
        x, y = _scale_rows(scale, n)
    if frame is not None:
        frames = _frame_rows(frame, [items.sprites[item].frame_count for item in ids])
    if flip is not None:
        flips = _flip_rows(flip, n)
    return angles, list(map(Transform, frames, flips, x, y, *turns))


def _frame_rows(frame: object, counts: list[int]) -> list[int]:
    """Check frame numbers of objects, one for all or (n,); `counts` are the frames of their sprites."""
    n = len(counts)
    numbers: list[int] = integers("frame", each("frame", frame, n), (n,), 0, 2**31).tolist()
    for row, (number, count) in enumerate(zip(numbers, counts, strict=True)):
        if number >= count:
            with within(f"row {row}"):
                integer("frame", number, 0, count - 1)
    return numbers


def _flip_rows(flip: object, n: int) -> list[str]:
    """Check flips, one word for all or (n,)."""
    words: list[str] = each("flip", flip, n).tolist()
    if len(words) != n:
        raise InputError(f"flip: expected one for all or {n}, got {len(words)}")
    for row, word in enumerate(words):
        with within(f"row {row}"):
            choice("flip", word, FLIPS)
    return words


def _scale_rows(scale: object, n: int) -> tuple[list[int], list[int]]:
    """Scales in x and y, in 1/65536; given are one number for all, (n,), or pairs (n, 2) or (1, 2)."""
    values = array_of("scale", scale)
    if values.ndim < 2:
        values = each("scale", values, n)[:, None]
    fits = values.ndim == 2 and values.shape[0] in (1, n) and values.shape[1] in (1, 2)
    pairs = reals("scale", np.broadcast_to(values, (n, 2)) if fits else values, (n, 2))
    whole = []
    for row, (x, y) in enumerate(pairs.tolist()):
        with within(f"row {row}"):
            whole.append(whole_scale(x, y))
    return [x for x, _ in whole], [y for _, y in whole]


ROLE_NAMES = tuple(role.value for role in ROLES)
FIELDS = ("background", "hittable", "movers", "occluders", "hud")
"""Names of the planes of each role, in the order of ROLES."""

DEFAULT_CATEGORY = "default"
"""Name of the first category bit, which objects have by default."""


class Scene:
    """A 2-D scene: objects front to back, some of which can be hit and some of which block shots.

    Parameters
    ----------
    size_wh : width and height of the bounds, px; None for a world without bounds, where nothing is outside
    origin_xy : top left pixel of the bounds
    categories : names of the category bits from 1 on; bit 0 is "default"
    name : used in reports
    """

    def __init__(
        self,
        size_wh: Sequence[int] | None = None,
        origin_xy: Sequence[int] = (0, 0),
        *,
        categories: Iterable[str] = (),
        name: str = "scene",
    ) -> None:
        self.name = Text().check("name", name)
        names = listed("categories", categories, "a list of names")
        self.categories = (
            DEFAULT_CATEGORY,
            *(Text().check(f"categories[{i}]", other) for i, other in enumerate(names)),
        )
        if len(self.categories) > CATEGORY_BITS:
            raise InputError(f"categories: expected at most {CATEGORY_BITS - 1} names, got {len(self.categories) - 1}")
        if len(set(self.categories)) < len(self.categories):
            raise InputError(f"categories: expected distinct names, got {list(self.categories)}")
        self._bounds: Box | None = None
        if size_wh is not None:
            x, y = integers("origin_xy", origin_xy, (2,), -POSITION_MAX, POSITION_MAX).tolist()
            w, h = integers("size_wh", size_wh, (2,), 1, POSITION_MAX).tolist()
            self._bounds = (x, y, x + w - 1, y + h - 1)
        self.items = Items()
        self.weapons: dict[str, Any] = {}
        self.shots: list[Any] = []
        self.derived = Derived(self._bounds)

    @classmethod
    def from_planes(
        cls,
        *,
        background: object = None,
        hittable: object = None,
        movers: object = None,
        occluders: object = None,
        hud: object = None,
        origin_xy: Sequence[int] = (0, 0),
    ) -> Scene:
        """Make a scene of whole planes of one size.

        Parameters
        ----------
        background, hittable, movers, occluders, hud : array, one of
            (h, w) booleans, one object
            (h, w) whole numbers, an object for each label but 0, in rising order, named by its label
            (n, h, w) booleans, n objects
            (h, w, 3 or 4) bytes, an image
        origin_xy : pixel of the world at [0, 0]
        """
        given = dict(zip(FIELDS, (background, hittable, movers, occluders, hud), strict=True))
        arrays = {field: array_of(field, plane) for field, plane in given.items() if plane is not None}
        sizes = {plane_size(field, array) for field, array in arrays.items()}
        if len(sizes) != 1:
            raise InputError(f"planes: expected one or more, all of one size, got {sorted(sizes)}")
        scene = cls(next(iter(sizes)), origin_xy)
        x, y = integers("origin_xy", origin_xy, (2,), -POSITION_MAX, POSITION_MAX).tolist()
        for field, array in arrays.items():
            role = ROLES[FIELDS.index(field)]
            in_picture = role is Role.HUD
            for name, sprite, left, top in plane_objects(field, role.value, array):
                scene.add(sprite, (left, top) if in_picture else (x + left, y + top), role=role, name=name)
        return scene

    @property
    def bounds(self) -> Box | None:
        """Inclusive box (x_min, y_min, x_max, y_max) of the world, px; None if it has no bounds."""
        return self._bounds

    @property
    def version(self) -> int:
        """Number of the last change; an answer from another version is stale."""
        return self.items.version

    def __len__(self) -> int:
        return int(self.items.alive[: self.items.count].sum())

    def add(
        self,
        sprite: object,
        position_xy: Sequence[float] = (0.0, 0.0),
        *,
        role: Role | str = Role.HITTABLE,
        angle: float = 0.0,
        scale: float | Sequence[float] = 1.0,
        flip: str = "none",
        frame: int = 0,
        layer: int = 0,
        categories: int | Sequence[str] | None = None,
        owner: int | None = None,
        cost: int = 1,
        velocity_xy: Sequence[float] = (0.0, 0.0),
        name: str | None = None,
    ) -> int:
        """Place an object and return its id.

        Parameters
        ----------
        sprite : Sprite, or a mask (h, w) of booleans, or an image (h, w, 3 or 4) of bytes
        position_xy : where the sprite's pivot goes, px (HUD: in picture coordinates)
        role : "background", "hittable", "mover", "occluder" or "hud"
        angle : degrees, clockwise on the screen
        scale : one number, or (sx, sy)
        flip : "none", "x" (left to right), "y" or "xy"
        frame : number of the sprite's frame
        layer : greater is nearer the viewer
        categories : names, or bits; by default bit 0 for objects, all bits for occluders
        owner : id of the object that this one is a part of; by default itself
        cost : what each px of it takes from the budget of a bullet that goes through it, 0 to 255
        velocity_xy : where it moves while a projectile flies, px a frame
        name : by default "role id"

        Raises
        ------
        InputError
            Naming the field.
        """
        made = as_sprite(sprite)
        kind = _role(role)
        number = self.items.count
        turn = float(reals("angle", angle, ()))
        form = transform_of(made, frame, flip, scale_pair(scale), turn)
        values: dict[str, object] = {
            "role": ROLES.index(kind),
            "layer": integer("layer", layer, -LAYER_MAX, LAYER_MAX),
            "categories": self._bits(categories, _default_bits(kind)),
            "owner": number if owner is None else integer("owner", owner, 0, number),
            "cost": integer("cost", cost, 0, COST_MAX),
            "position_256": snap(reals("position_xy", position_xy, (2,), POSITION_MAX)),
            "velocity_256": snap(reals("velocity_xy", velocity_xy, (2,), REACH_MAX)),
        }
        unnamed = name is None or (isinstance(name, str) and not name)
        called = f"{kind.value} {number}" if unnamed else Text().check("name", name)
        return self.items.add(made, form, turn, called, values)

    def remove(self, ids: int | Sequence[int] | Ints) -> None:
        """Take objects out of the scene; their ids are not used again."""
        self.items.remove(self._existing(ids))

    def move(self, ids: int | Sequence[int] | Ints, xy: object) -> None:
        """Place objects at new positions: ids (n,) and xy (n, 2), or one position for all of them, px."""
        if type(ids) is int or isinstance(ids, np.integer):
            position = one_place(xy)
            if position is not None and self.items.move_one(int(ids), *position):
                return
        elif are_rows(ids, xy) and self.items.move_risen(ids, xy):  # type: ignore[arg-type]
            return
        rows = self._existing(ids)
        self.items.move(rows, snap(points("xy", xy, len(rows))))

    def set(
        self,
        ids: int | Sequence[int] | Ints,
        *,
        position_xy: object = None,
        angle: object = None,
        scale: object = None,
        flip: str | Sequence[str] | None = None,
        frame: object = None,
        layer: object = None,
        categories: object = None,
        owner: object = None,
        cost: object = None,
        velocity_xy: object = None,
        role: Role | str | None = None,
    ) -> None:
        """Change objects, all or none; each value is one for all objects, or one per object.

        `ids` is one id or several (n,). `scale` is a number, one per object (n,), or pairs (n, 2) or (1, 2). The other
        parameters are those of `add`.
        """
        rows = self._existing(ids)
        n = len(rows)
        columns: dict[str, Any] = {}
        if position_xy is not None:
            columns["position_256"] = snap(points("position_xy", position_xy, n))
        if velocity_xy is not None:
            columns["velocity_256"] = snap(points("velocity_xy", velocity_xy, n, REACH_MAX))
        if cost is not None:
            columns["cost"] = integers("cost", each("cost", cost, n), (n,), 0, COST_MAX)
        if layer is not None:
            columns["layer"] = integers("layer", each("layer", layer, n), (n,), -LAYER_MAX, LAYER_MAX)
        if categories is not None:
            columns["categories"] = self._bits_per_row(categories, n)
        if owner is not None:
            columns["owner"] = integers("owner", each("owner", owner, n), (n,), 0, self.items.count - 1)
        if role is not None:
            columns = self._of_role(rows, _role(role)) | columns
        angles, forms = changed_transforms(self.items, rows, angle, scale, flip, frame)
        if forms is not None:
            self.items.reform(rows.tolist(), forms)
            for item, value in zip(rows.tolist(), angles, strict=True):
                self.items.angles[item] = value
        for name, values in columns.items():
            getattr(self.items, name)[rows] = values
        self.items.record(rows, columns if forms is None else {*columns, "mask"})

    def _of_role(self, rows: Ints, role: Role) -> dict[str, Any]:
        """Columns of a new role; objects that have the default categories of the old role get those of the new one."""
        old = np.where(self.items.role[rows] == ROLES.index(Role.OCCLUDER), ALL, 1)
        now = self.items.categories[rows]
        return {"role": ROLES.index(role), "categories": np.where(now == old, _default_bits(role), now)}

    def ids(self, role: Role | str | None = None) -> Ints:
        """Ids of the objects in the scene, rising, of one role or of all."""
        n = self.items.count
        alive = self.items.alive[:n] == 1
        return np.flatnonzero(alive if role is None else alive & (self.items.role[:n] == ROLES.index(_role(role))))

    def name_of(self, item: int) -> str:
        """Name of an object, even if it was removed."""
        return self.items.names[integer("item", item, 0, self.items.count - 1)]

    def find(self, name: str) -> int:
        """Id of the object of a name; it must be the only one."""
        names = {i: self.items.names[i] for i in self.ids().tolist()}
        choice("name", name, names.values())
        named = [i for i, other in names.items() if other == name]
        if len(named) > 1:
            raise InputError(f"name: expected one object named {name!r}, got {len(named)}")
        return int(named[0])

    def category_bits(self, *names: str, field: str = "category") -> int:
        """Bits of named categories, for `accept` and `blocked_by`; an error says `field`."""
        bits = 0
        for name in names:
            bits |= 1 << self.categories.index(choice(field, name, self.categories))
        return bits

    def category_names(self, bits: int) -> list[str]:
        """Names of category bits; a bit without a name is called by its number."""
        bits = integer("bits", bits, 0, ALL)
        return [name for bit, name in enumerate(self._bit_names()) if bits >> bit & 1]

    def mask(self, item: int) -> tuple[Bools, tuple[int, int]]:
        """Mask (h, w) of an object as it is tested, read-only, and the pixel (x, y) of the world at [0, 0]."""
        row = int(self._existing(integer("item", item, 0, self.items.count - 1))[0])
        return self.items.variants[row].mask, self.items.corner(row)

    def volumes(self, ids: object, kind: str) -> Volumes:
        """Volumes of objects, one row each, px.

        Parameters
        ----------
        ids : of the objects (n,), or of one
        kind : "box", "circle", "oriented box", "4 boxes" (or another number up to 64), "polygon"
        """
        return self.items.volumes(kind, self._existing(ids))

    def extent(self) -> Box:
        """Inclusive box (x_min, y_min, x_max, y_max) of the bounds, or of all objects if there are no bounds."""
        if self.bounds is not None:
            return self.bounds
        boxes = self.items.boxes(np.setdiff1d(self.ids(), self.ids(Role.HUD)))
        boxes = boxes[boxes[:, 0] <= boxes[:, 2]]
        if not len(boxes):
            return (0, 0, 0, 0)
        x, y = boxes[:, :2].min(axis=0).tolist()
        x_max, y_max = boxes[:, 2:].max(axis=0).tolist()
        return (x, y, x_max, y_max)

    def planes(self) -> Planes:
        """Read-only planes of the scene by role; HUD objects are placed relative to the corner of the picture."""
        box = self.extent()
        x, y, x_max, y_max = box
        out: dict[str, npt.NDArray[np.int32]] = {}
        for field, role in zip(FIELDS, ROLES, strict=True):
            at = (0, 0, x_max - x, y_max - y) if role is Role.HUD else box
            out[field] = late.label_plane.label_plane(self.items.stack_of(role), at)
            out[field].flags.writeable = False
        return Planes((x, y), **out)

    def content_hash(self) -> str:
        """Hash of everything that decides hits; scenes of equal hash answer every shot alike."""
        import hashlib  # few calls need it, and it is slow to load

        stack = self.items.stack()
        digest = hashlib.sha256(repr(self.bounds).encode())
        for column in (stack.ids, stack.occluder, self.items.categories[stack.ids], stack.owner, stack.box_xyxy):
            digest.update(np.ascontiguousarray(column).tobytes())
        for rank in range(len(stack)):
            digest.update(np.packbits(stack.mask(rank)).tobytes())
        cost, velocity = self.items.cost[stack.ids], self.items.velocity_256[stack.ids]
        if (cost != 1).any() or velocity.any():
            digest.update(np.concatenate([cost[:, None], velocity], axis=1).tobytes())
        return digest.hexdigest()[:16]

    def save(self, folder: str | Path) -> None:
        """Write the scene as a folder of scene.json and PNGs; `load_scene` gives the same verdicts."""
        Text().check("name", self.name)
        typed("weapons", self.weapons, dict)
        typed("shots", self.shots, list)
        objects = [self._file_object(item) for item in self.ids().tolist()]
        x, y, x_max, y_max = self.bounds or (0, 0, 0, 0)
        size = None if self.bounds is None else (x_max - x + 1, y_max - y + 1)
        names = self._bit_names()
        used = [names.index(name) + 1 for entry in objects for name in entry.categories or ()]
        names = names[1 : max([len(self.categories), *used])]
        late.scene_folder.write_scene(
            path_of("folder", folder),
            late.scene_folder.SceneFile(self.name, (x, y), size, names, objects, self.weapons, self.shots),
        )

    def _bit_names(self) -> list[str]:
        """A distinct name for every category bit."""
        names = list(self.categories)
        for bit in range(len(names), CATEGORY_BITS):
            name = f"bit {bit}"
            while name in self.categories:
                name += "'"
            names.append(name)
        return names

    def _file_object(self, item: int) -> FileObject:
        items, form = self.items, self.items.forms[item]
        one = 1 << SCALE_BITS
        pose: dict[str, Any] = {}
        if items.angles[item]:
            pose["angle"] = items.angles[item]
        if (form.scale_x, form.scale_y) != (one, one):
            pose["scale"] = [form.scale_x / one, form.scale_y / one]
        if form.flip != "none":
            pose["flip"] = form.flip
        if form.frame:
            pose["frame"] = form.frame
        if items.layer[item]:
            pose["layer"] = int(items.layer[item])
        if items.cost[item] != 1:
            pose["cost"] = int(items.cost[item])
        if items.velocity_256[item].any():
            pose["velocity_xy"] = (items.velocity_256[item] / SUB).tolist()
        role = ROLES[int(items.role[item])]
        bits, owner = int(items.categories[item]), int(items.owner[item])
        x, y = (items.position_256[item] / SUB).tolist()
        categories = None
        if bits != _default_bits(role):
            categories = self.category_names(bits)
        part_of = None if owner == item else owner
        return late.scene_folder.FileObject(
            role, items.sprites[item], (x, y), pose, items.names[item], categories, part_of, item
        )

    def _risen(self, ids: object) -> Ints | None:
        """A copy of an array of rising ids (n,) that are all in the scene; None for any other value."""
        if type(ids) is not np.ndarray or ids.ndim != 1 or ids.dtype != np.int64 or not rising(ids, self.items.count):
            return None
        rows = ids.copy()
        return rows if self.items.alive.take(rows).all() else None

    def _existing(self, ids: object) -> Ints:
        """Check that ids are in the scene, each once."""
        risen = self._risen(ids)
        if risen is not None:
            return risen
        given = np.atleast_1d(array_of("ids", ids))
        rows = integers("ids", given, (None,), 0, self.items.count - 1)
        gone = rows[self.items.alive[rows] == 0]
        if len(gone):
            row = int(np.flatnonzero(rows == gone[0])[0])
            raise InputError(f"ids[{row}]: expected an object in the scene, got {gone[0]}, which was removed")
        if len(rows) > 1:
            again = np.setdiff1d(np.arange(len(rows)), np.unique(rows, return_index=True)[1])
            if len(again):
                raise InputError(f"ids[{again[0]}]: expected each object once, got {rows[again[0]]} again")
        return rows

    def _bits(self, categories: object, default: int) -> int:
        if categories is None:
            return default
        if isinstance(categories, int | np.integer):
            return integer("categories", categories, 0, ALL)
        return self.category_bits(*listed("categories", categories, "bits or a list of names"))

    def _bits_per_row(self, categories: object, n: int) -> Ints:
        values = array_of("categories", categories)
        if values.dtype.kind in "iu" and values.ndim:
            return integers("categories", values, (n,), 0, ALL)
        return np.full(n, self._bits(categories, 0))


def _role(role: object) -> Role:
    if isinstance(role, Role):
        return role
    return Role(choice("role", role, ROLE_NAMES))


def _default_bits(role: Role) -> int:
    return ALL if role is Role.OCCLUDER else 1
