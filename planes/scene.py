"""The scene: objects by role, their poses, and every change of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from planes.arrays import Bools, InputError, Ints, array_of, choice, each, integer, integers, listed, reals, rising
from planes.compose import CodePlane, label_plane, plane_fits
from planes.constants import ALL, CATEGORY_BITS, COST_MAX, LAYER_MAX, POSITION_MAX, REACH_MAX, SCALE_BITS, SUB
from planes.grid256 import snap
from planes.index import Index
from planes.items import ROLES, Items, Role
from planes.labels import Planes, plane_objects, plane_size
from planes.poses import are_rows, changed_forms, one_place, points, scale_pair
from planes.scenefile import FileObject, SceneFile, folder_of, write_scene
from planes.schema import Text, typed
from planes.spans import Box
from planes.sprite import as_sprite, form_of

if TYPE_CHECKING:
    from planes.clearance import ClearancePlane
    from planes.visible import Compositions
    from planes.volumes import Volumes

__all__ = ["Scene"]

ROLE_NAMES = tuple(role.value for role in ROLES)
FIELDS = ("background", "hittable", "movers", "occluders", "hud")
"""What the planes of each role are called, in the order of ROLES."""

DEFAULT_CATEGORY = "default"
"""Name of the first category bit: the one that objects have unless told otherwise."""


class Scene:
    """A stack of objects, some of which can be hit and some of which block.

    Parameters
    ----------
    size_wh : width and height of the bounds, px; None for a world without bounds, where nothing is outside
    origin_xy : first pixel of the bounds
    categories : names of the category bits from 1 on; bit 0 is "default"
    name : for reports
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
        self._code_plane: CodePlane | None = None
        self._clearance: ClearancePlane | None = None
        self._indexes: dict[str, Index] = {}
        self._compositions: Compositions | None = None

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
        background, hittable, movers, occluders, hud : array
            (h, w) booleans: one object; (h, w) whole numbers: labels, one object for each but 0, in rising order,
            named by its label; (n, h, w) booleans: one object each; (h, w, 3 or 4) bytes: an image.
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
        """First and last pixel of the world (x_min, y_min, x_max, y_max); None if it has no end."""
        return self._bounds

    @property
    def version(self) -> int:
        """Counts the changes: an answer from another version is stale."""
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
        cost : what a px of it takes from the budget of a bullet that goes through it, 0 to 255
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
        form = form_of(made, frame, flip, scale_pair(scale), turn)
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
            one = one_place(xy)
            if one is not None and self.items.move_one(int(ids), *one):
                return
        elif are_rows(ids, xy) and self.items.move_risen(ids, xy):  # type: ignore[arg-type]
            return
        rows = self._existing(ids)
        self.items.move(rows, snap(points("position_xy", xy, len(rows))))

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
        """Change objects, all at once or not at all; each value is one for all, or one per object.

        `scale` is a number, one per object (n,), or pairs (n, 2) or (1, 2). The other parameters are those of `add`.
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
        angles, forms = changed_forms(self.items, rows, angle, scale, flip, frame)
        if forms is not None:
            self.items.reform(rows.tolist(), forms)
            for item, value in zip(rows.tolist(), angles, strict=True):
                self.items.angles[item] = value
        for name, values in columns.items():
            getattr(self.items, name)[rows] = values
        self.items.record(rows, columns if forms is None else {*columns, "mask"})

    def _of_role(self, rows: Ints, role: Role) -> dict[str, Any]:
        """Columns of a new role: what has the categories that its old role gave it gets those of the new one."""
        old = np.where(self.items.role[rows] == ROLES.index(Role.OCCLUDER), ALL, 1)
        now = self.items.categories[rows]
        return {"role": ROLES.index(role), "categories": np.where(now == old, _default_bits(role), now)}

    def ids(self, role: Role | str | None = None) -> Ints:
        """Ids of the objects in the scene, of one role or of all, rising."""
        n = self.items.count
        alive = self.items.alive[:n] == 1
        return np.flatnonzero(alive if role is None else alive & (self.items.role[:n] == ROLES.index(_role(role))))

    def name_of(self, item: int) -> str:
        """Name of an object, also of one that was removed."""
        return self.items.names[integer("id", item, 0, self.items.count - 1)]

    def find(self, name: str) -> int:
        """Id of the only object of a name."""
        names = {i: self.items.names[i] for i in self.ids().tolist()}
        choice("name", name, names.values())
        named = [i for i, other in names.items() if other == name]
        if len(named) > 1:
            raise InputError(f"name: expected one object named {name!r}, got {len(named)}")
        return int(named[0])

    def category_bits(self, *names: str) -> int:
        """Bits of named categories, for `accept`."""
        bits = 0
        for name in names:
            bits |= 1 << self.categories.index(choice("category", name, self.categories))
        return bits

    def category_names(self, bits: int) -> list[str]:
        """Names of bits; one that has none is called by its number."""
        bits = integer("bits", bits, 0, ALL)
        return [name for bit, name in enumerate(self._bit_names()) if bits >> bit & 1]

    def mask(self, item: int) -> tuple[Bools, tuple[int, int]]:
        """Mask (h, w) of an object as it is tested, read-only, and the pixel (x, y) of the world at [0, 0]."""
        row = int(self._existing(integer("id", item, 0, self.items.count - 1))[0])
        return self.items.variants[row].mask, self.items.corner(row)

    def volumes(self, ids: object, kind: str) -> Volumes:
        """Volumes of objects, one row each, px: "box", "circle", "oriented box", "4 boxes" (or others), "polygon"."""
        return self.items.volumes(kind, self._existing(ids))

    def extent(self) -> Box:
        """Box (x_min, y_min, x_max, y_max) of the bounds, or of all that is placed where there are none."""
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
        """Whole planes of the scene by role, read-only; HUD objects are placed from the corner of the picture."""
        box = self.extent()
        x, y, x_max, y_max = box
        out: dict[str, npt.NDArray[np.int32]] = {}
        for field, role in zip(FIELDS, ROLES, strict=True):
            at = (0, 0, x_max - x, y_max - y) if role is Role.HUD else box
            out[field] = label_plane(self.items.stack_of(role), at)
            out[field].flags.writeable = False
        return Planes((x, y), **out)

    def code_plane(self) -> CodePlane | None:
        """The plane that the composed strategy reads; None where there are no bounds or they are too large."""
        if self._code_plane is None and self.bounds is not None and plane_fits(self.bounds):
            self._code_plane = CodePlane(self.bounds)
        return self._code_plane

    def compositions(self) -> Compositions:
        """What can be seen of the objects, for those who fire at many of them."""
        if self._compositions is None:
            from planes.visible import Compositions  # what nothing is fired at needs none

            self._compositions = Compositions()
        return self._compositions

    def clearance(self) -> ClearancePlane | None:
        """The plane by which rays jump; None where there is no code plane."""
        codes = self.code_plane()
        if self._clearance is None and codes is not None:
            from planes.clearance import ClearancePlane  # few calls need it

            self._clearance = ClearancePlane(codes)
        return self._clearance

    def index(self, structure: str) -> Index:
        """The broad phase of the items that decide, "none", "grid", "quadtree" or "bvh"; it follows the scene."""
        if structure not in self._indexes:
            self._indexes[structure] = Index(structure)
        return self._indexes[structure]

    def content_hash(self) -> str:
        """Hash of all that decides hits: equal scenes answer every shot alike."""
        import hashlib  # few calls need it, and it is dear to load

        stack = self.items.stack()
        digest = hashlib.sha256(repr(self.bounds).encode())
        for column in (stack.ids, stack.occluder, stack.categories, stack.owner, stack.box_xyxy):
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
        write_scene(folder_of(folder), SceneFile(self.name, (x, y), size, names, objects, self.weapons, self.shots))

    def _bit_names(self) -> list[str]:
        """A name for every bit, each its own."""
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
        return FileObject(role, items.sprites[item], (x, y), pose, items.names[item], categories, part_of, item)

    def _risen(self, ids: object) -> Ints | None:
        """A copy of an array of rising ids (n,) that are all in the scene; None of any other."""
        if type(ids) is not np.ndarray or ids.ndim != 1 or ids.dtype != np.int64 or not rising(ids, self.items.count):
            return None
        rows = ids.copy()
        return rows if self.items.alive.take(rows).all() else None

    def _existing(self, ids: object) -> Ints:
        """Ids that are in the scene, each once."""
        risen = self._risen(ids)
        if risen is not None:
            return risen
        given = np.atleast_1d(array_of("ids", ids))
        rows = integers("ids", given, (None,), 0, self.items.count - 1)
        gone = rows[self.items.alive[rows] == 0]
        if len(gone):
            row = int(np.flatnonzero(rows == gone[0])[0])
            raise InputError(f"ids[{row}]: expected an object in the scene, got {gone[0]}, which was removed")
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
