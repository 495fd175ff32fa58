"""The scene: objects with roles and poses, and the methods that add, change, remove and read them."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from .. import late
from ..common.checks import (
    FLOAT_MAX,
    Bools,
    Floats,
    InputError,
    Ints,
    array_of,
    choice,
    each,
    ids_of,
    integer,
    integers,
    listed,
    path_of,
    real,
    rising,
)
from ..common.limits import ALL, CATEGORY_BITS, COST_MAX, LAYER_MAX, POSITION_MAX, REACH_MAX, SCALE_BITS, SUB
from ..common.tables import Text, typed
from ..grid.fixed_point import snap
from ..grid.spans import Box
from .derived import Derived
from .items import Items
from .objects import PLANE_NAMES, ROLE_NAMES, ROLES, Role
from .poses import are_rows, one_place, place_256, points, scale_pair
from .sprite import Sprite, as_sprite
from .variants import transform_of

if TYPE_CHECKING:
    from ..volumes.volumes import Volumes
    from .carving import HitPixels
    from .render import Planes


Read = TypeVar("Read", bound=np.generic)

DEFAULT_CATEGORY = "default"  # name of the first category bit, which objects have by default


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
        self, size_wh: Sequence[int] | None = None, origin_xy: Sequence[int] = (0, 0), *,
        categories: Iterable[str] = (), name: str = "scene",
    ) -> None:  # fmt: skip
        self.name = Text().check("name", name)
        names = listed("categories", categories, "a list of names")
        others = (Text().check(f"categories[{i}]", other) for i, other in enumerate(names))
        self.categories = (DEFAULT_CATEGORY, *others)
        if len(self.categories) > CATEGORY_BITS:
            raise InputError(f"categories: expected at most {CATEGORY_BITS - 1} names, got {len(self.categories) - 1}")
        if len(set(self.categories)) < len(self.categories):
            raise InputError(f"categories: expected distinct names, got {list(self.categories)}")
        self._bounds: Box | None = None
        if size_wh is not None:
            w, h = integers("size_wh", size_wh, (2,), 1, POSITION_MAX).tolist()
            x, y = integers("origin_xy", origin_xy, (2,), -POSITION_MAX, POSITION_MAX).tolist()
            self._bounds = (x, y, x + w - 1, y + h - 1)
        self._items = Items()
        self.weapons: dict[str, Any] = {}
        self.shots: list[Any] = []
        self.derived = Derived(self._bounds)

    @classmethod
    def from_planes(
        cls, *, background: object = None, hittable: object = None, movers: object = None, occluders: object = None,
        hud: object = None, origin_xy: Sequence[int] = (0, 0),
    ) -> Scene:  # fmt: skip
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
        given = dict(zip(PLANE_NAMES, (background, hittable, movers, occluders, hud), strict=True))
        arrays = {field: array_of(field, plane) for field, plane in given.items() if plane is not None}
        sizes = {field: late.render.plane_size(field, array) for field, array in arrays.items()}
        if len(set(sizes.values())) != 1:
            got = ", ".join(f"{field} of {w} x {h} px" for field, (w, h) in sizes.items()) or "none"
            raise InputError(f"planes: expected one or more, all of one size, got {got}")
        scene = cls(next(iter(sizes.values())), origin_xy)
        x, y = integers("origin_xy", origin_xy, (2,), -POSITION_MAX, POSITION_MAX).tolist()
        for field, array in arrays.items():
            role = ROLES[PLANE_NAMES.index(field)]
            in_picture = role is Role.HUD
            for name, sprite, left, top in late.render.plane_objects(field, role.value, array):
                scene.add(sprite, (left, top) if in_picture else (x + left, y + top), role=role, name=name)
        return scene

    @property
    def items(self) -> Items:
        """The items as columns; masks that changed since they were last read are made first."""
        if self._items.unmade:
            self._items.make_masks()
        return self._items

    @property
    def bounds(self) -> Box | None:
        """Inclusive box (x_min, y_min, x_max, y_max) of the world, px; None if it has no bounds."""
        return self._bounds

    @property
    def version(self) -> int:
        """Number of the last change; an answer from another version is stale."""
        return self.items.version

    @property
    def latest(self) -> Scene:
        """The scene that may still change: itself, or for a scene of the past the one that was recorded."""
        return self

    def __len__(self) -> int:
        return len(self._items.ids)

    def add(
        self, sprite: object, position_xy: Sequence[float] = (0.0, 0.0), *, role: Role | str = Role.HITTABLE,
        angle: float = 0.0, scale: float | Sequence[float] = 1.0, flip: str = "none", frame: int | str = 0,
        layer: int = 0, categories: int | Sequence[str] | None = None, owner: int | None = None, cost: int = 1,
        velocity_xy: Sequence[float] = (0.0, 0.0), name: str | None = None,
    ) -> int:  # fmt: skip
        """Place an object and return its id.

        Parameters
        ----------
        sprite : Sprite, or a mask (h, w) of booleans, or an image (h, w, 3 or 4) of bytes
        position_xy : where the sprite's pivot goes, px (HUD: in picture coordinates)
        role : "background", "hittable", "mover", "occluder" or "hud"
        angle : degrees, clockwise on the screen
        scale : one number, or (sx, sy)
        flip : "none", "x" (left to right), "y" or "xy"
        frame : number or name of the sprite's frame
        layer : greater is nearer the viewer
        categories : a name, several, or bits; by default bit 0 for objects, all bits for occluders
        owner : id of the object that this one is a part of; by default itself
        cost : what each px of it takes from the budget of a bullet that goes through it, 0 to 255
        velocity_xy : where it moves while a projectile flies, px a frame
        name : by default "role id"

        Raises
        ------
        InputError
            Naming the field.
        """
        made, kind, turn = as_sprite(sprite), _role(role), real("angle", angle, -FLOAT_MAX, FLOAT_MAX)
        transform = transform_of(made, frame, flip, scale_pair(scale), turn)
        values = self._new_columns(kind, layer, categories, owner, cost, position_xy, velocity_xy)
        unnamed = name is None or (isinstance(name, str) and not name)
        called = f"{kind.value} {self._items.count}" if unnamed else Text().check("name", name)
        return self._items.add(made, transform, turn, called, values)

    def _new_columns(
        self, role: Role, layer: object, categories: object, owner: object, cost: object, position_xy: object,
        velocity_xy: object,
    ) -> dict[str, object]:  # fmt: skip
        """Check what a new object has in each column."""
        own = self._items.count  # the id that it gets
        is_own = owner is None or (isinstance(owner, int | np.integer) and type(owner) is not bool and owner == own)
        return {
            "role": ROLES.index(role),
            "layer": integer("layer", layer, -LAYER_MAX, LAYER_MAX),
            "categories": self._bits(categories, default_bits(role)),
            "owner": own if is_own else integer("owner", owner, 0, max(own - 1, 0)),
            "cost": integer("cost", cost, 0, COST_MAX),
            "position_256": place_256("position_xy", position_xy, POSITION_MAX),
            "velocity_256": place_256("velocity_xy", velocity_xy, REACH_MAX),
        }

    def remove(self, ids: int | Sequence[int] | Ints) -> None:
        """Take objects out of the scene; their ids are not used again, as hits and histories name objects by them.

        What is left of a removed object is four bytes for its id, and its name if it was given one.
        """
        self._items.remove(self._existing(ids))

    def move(self, ids: int | Sequence[int] | Ints, xy: object) -> None:
        """Place objects at new positions: ids (n,) and xy (n, 2), or one position for all of them, px."""
        if type(ids) is int or isinstance(ids, np.integer):
            position = one_place(xy)
            if position is not None and self._items.move_one(int(ids), *position):
                return
        elif are_rows(ids, xy) and self._items.move_risen(ids, xy):  # type: ignore[arg-type]
            return
        rows = self._existing(ids)
        if len(at := points("xy", xy, len(rows))):
            self._items.move(rows, snap(at))

    def set(
        self, ids: int | Sequence[int] | Ints, *, sprite: object = None, position_xy: object = None,
        angle: object = None, scale: object = None, flip: str | Sequence[str] | None = None, frame: object = None,
        layer: object = None, categories: object = None, owner: object = None, cost: object = None,
        velocity_xy: object = None, role: Role | str | None = None,
    ) -> None:  # fmt: skip
        """Change objects, all or none; each value is one for all objects, or one per object. `role` is one for all.

        `ids` is one id or several (n,). `scale` is a number, one per object (n,), pairs (n, 2) or (1, 2), or (sx, sy)
        of one object; `sprite` is one for all, or a list (n,). `categories` of each object are an array of bits (n,),
        or a list of n lists of names. The other parameters are those of `add`.
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
            columns["owner"] = integers("owner", each("owner", owner, n), (n,), 0, self._items.count - 1)
        if role is not None:
            columns = self._of_role(rows, _role(role)) | columns
        look = sprite, angle, scale, flip, frame
        if any(part is not None for part in look):
            self._items.reform(rows.tolist(), self._items.looks(rows.tolist()).changed(*look))
        if (position_256 := columns.pop("position_256", None)) is not None:
            self._items.move(rows, position_256)
        for name, values in columns.items():
            getattr(self._items, name)[rows] = values
        if columns:
            self._items.record(rows, columns)

    def carve(self, pixels: HitPixels | Mapping[int, object]) -> dict[int, int]:
        """Take pixels out of objects, as terrain that is shot away, and return how many each of them lost, or 0.

        An object loses exactly these pixels of its mask as it stands, and keeps its id, name and pose. The hole turns,
        flips and grows with it; other frames stay whole. One of which nothing is left stays, with an empty mask.

        Parameters
        ----------
        pixels : hits of `fire` at this scene as it is now; or pixels for each id, as Spans or whole numbers (n, 2)

        Raises
        ------
        InputError
            If the scene has changed since the shot, or is another one; or naming the id.
        """
        wanted = late.carving.pixels_to_carve(self, pixels)
        given = {
            int(self._existing(integer("id of pixels", i, 0, self.items.count - 1))[0]): xy for i, xy in wanted.items()
        }
        sprites, lost = late.carving.carved_sprites(self.items, given)
        if rows := list(lost):
            self.items.reform(rows, self.items.looks(rows)._replace(sprites=sprites))
        return {int(self._items.id[row]): lost.get(row, 0) for row in given}

    def _of_role(self, rows: Ints, role: Role) -> dict[str, Any]:
        """Columns of a new role; objects that have the default categories of the old role get those of the new one."""
        old = np.where(self._items.role[rows] == ROLES.index(Role.OCCLUDER), ALL, 1)
        now = self._items.categories[rows]
        return {"role": ROLES.index(role), "categories": np.where(now == old, default_bits(role), now)}

    def ids(self, role: Role | str | None = None) -> Ints:
        """Ids of the objects in the scene, rising, of one role or of all."""
        ids, rows = self._items.ids, self._items.rows
        return ids.copy() if role is None else ids[self._items.role.take(rows) == ROLES.index(_role(role))]

    def __iter__(self) -> Iterator[int]:
        """Ids of the objects in the scene, rising."""
        return iter(self.ids().tolist())

    def __contains__(self, item: object) -> bool:
        """Whether an id is of an object in the scene, and not of a removed one."""
        if not isinstance(item, int | np.integer):
            return False
        return 0 <= int(item) < self._items.count and self._items.table.row(int(item)) >= 0

    def __repr__(self) -> str:
        counts = [f"{len(ids)} {role.value}" for role in ROLES if len(ids := self.ids(role))]
        return f"<Scene {self.name!r}, bounds {self.bounds}: {', '.join(counts) or 'empty'}>"

    def copy(self) -> Scene:
        """Return a scene of its own with the same objects and ids; a copy of the past can be changed, too."""
        weapons, shots = copy.deepcopy((self.weapons, self.shots))
        return _restored(self.name, self.categories, self.bounds, weapons, shots, self.items.state())

    def __copy__(self) -> Scene:
        return self.copy()

    def __deepcopy__(self, _: dict[int, Any]) -> Scene:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.name, self.categories, self.bounds, self.weapons, self.shots, self.items.state())

    def position(self, ids: int | Sequence[int] | Ints) -> Floats:
        """Positions (n, 2) of ids, or (2,) of one, px; kept in 1/256 px."""
        return self._read(ids, lambda rows: self._items.position_256[rows] / SUB)

    def angle(self, ids: int | Sequence[int] | Ints) -> Floats:
        """Angles (n,) of ids, or the angle of one, degrees, as they were given."""
        return self._read(ids, lambda rows: np.array(self._items.looks(rows.tolist()).angles, np.float64))

    def scale(self, ids: int | Sequence[int] | Ints) -> Floats:
        """Scales (n, 2) of ids in x and y, or (2,) of one; they are kept in 1/65536."""
        return self._read(ids, lambda rows: self._transforms(rows, "scale_x", "scale_y") / (1 << SCALE_BITS))

    def flip(self, ids: int | Sequence[int] | Ints) -> npt.NDArray[np.str_]:
        """Flips (n,) of ids, or that of one: "none", "x", "y" or "xy"."""
        return self._read(ids, lambda rows: self._transforms(rows, "flip")[:, 0])

    def frame(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Numbers (n,) of the frames of ids, or that of one."""
        return self._read(ids, lambda rows: self._transforms(rows, "frame")[:, 0])

    def layer(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Layers (n,) of ids, or that of one; greater is nearer the viewer."""
        return self._read(ids, lambda rows: self._items.layer[rows])

    def role(self, ids: int | Sequence[int] | Ints) -> npt.NDArray[np.str_]:
        """Roles (n,) of ids, or that of one: "background", "hittable", "mover", "occluder" or "hud"."""
        return self._read(ids, lambda rows: np.array(ROLE_NAMES)[self._items.role[rows]])

    def categories_of(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Category bits (n,) of ids, or those of one; `category_names` tells their names."""
        return self._read(ids, lambda rows: self._items.categories[rows])

    def owner(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Owners (n,) of ids, or that of one: the object that it is a part of, or itself."""
        return self._read(ids, lambda rows: self._items.owner[rows])

    def cost(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Costs (n,) of a px of ids, or that of one."""
        return self._read(ids, lambda rows: self._items.cost[rows])

    def velocity(self, ids: int | Sequence[int] | Ints) -> Floats:
        """Velocities (n, 2) of ids, or (2,) of one, px a frame; they are kept in 1/256 px."""
        return self._read(ids, lambda rows: self._items.velocity_256[rows] / SUB)

    def box(self, ids: int | Sequence[int] | Ints) -> Ints:
        """Inclusive boxes (n, 4) of the masks of ids as x_min, y_min, x_max, y_max, or (4,) of one, px.

        That of an empty mask is (0, 0, -1, -1).
        """
        return self._read(ids, self.items.boxes)

    def sprite(self, item: int) -> Sprite:
        """Sprite of an object."""
        return self._items.sprites[int(self._existing(integer("item", item, 0, self._items.count - 1))[0])]

    def rename(self, item: int, name: str) -> None:
        """Give an object another name."""
        rows = self._existing(integer("item", item, 0, self._items.count - 1))
        self._items.names[int(rows[0])] = Text().check("name", name)
        self._items.record(rows, ("name",))

    def name_of(self, item: int) -> str:
        """Name of an object, even if it was removed."""
        return self._items.name_of(integer("item", item, 0, self._items.count - 1))

    def find(self, name: str) -> int:
        """Id of the object of a name; it must be the only one."""
        names = self._items.names
        count = names.count(name) if isinstance(name, str) and name else 0
        if not count:
            choice("name", name, [names[row] for row in self._items.rows.tolist()])
        if count > 1:
            raise InputError(f"name: expected one object named {name!r}, got {count}")
        return int(self._items.id[names.index(name)])

    def category_bits(self, *names: str, field: str = "category") -> int:
        """Bits of categories by the names that `category_names` tells; an error says `field`."""
        known, bits = self.categories, 0
        if not all(isinstance(name, str) and name in known for name in names):
            known = tuple(self._bit_names())
        for name in names:
            if not isinstance(name, str) or name not in known:
                choice(field, name, self.categories)
            bits |= 1 << known.index(name)
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
        return late.fit.volumes_of(self.items, kind, self._existing(ids))

    def extent(self) -> Box:
        """Inclusive box (x_min, y_min, x_max, y_max) of the bounds, or of all objects if there are no bounds."""
        if self.bounds is not None:
            return self.bounds
        rows = self.items.rows
        boxes = self.items.boxes(rows[self.items.role[rows] != ROLES.index(Role.HUD)])
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
        for field, role in zip(PLANE_NAMES, ROLES, strict=True):
            at = (0, 0, x_max - x, y_max - y) if role is Role.HUD else box
            out[field] = late.label_plane.id_plane(self.items.stack_of(role), at)
            out[field].flags.writeable = False
        return late.render.Planes((x, y), **out)

    def content_hash(self) -> str:
        """Hash of everything that decides hits; scenes of equal hash answer every shot alike."""
        import hashlib  # few calls need it, and it is slow to load

        stack = self.items.stack()
        digest = hashlib.sha256(repr(self.bounds).encode())
        for column in (stack.ids, stack.occluder, self.items.categories[stack.rows], stack.owner, stack.box_xyxy):
            digest.update(np.ascontiguousarray(column).tobytes())
        for rank in range(len(stack)):
            digest.update(np.packbits(stack.mask(rank)).tobytes())
        cost, velocity = self.items.cost[stack.rows], self.items.velocity_256[stack.rows]
        if (cost != 1).any() or velocity.any():
            digest.update(np.concatenate([cost[:, None], velocity], axis=1).tobytes())
        return digest.hexdigest()[:16]

    def save(self, folder: str | Path) -> None:
        """Write the scene as a folder of scene.json and PNGs; `load_scene` gives the same verdicts."""
        Text().check("name", self.name)
        typed("weapons", self.weapons, dict)
        typed("shots", self.shots, list)
        late.scene_folder.write_scene(path_of("folder", folder), self)

    def _bit_names(self) -> list[str]:
        """A distinct name for every category bit."""
        names = list(self.categories)
        for bit in range(len(names), CATEGORY_BITS):
            name = f"bit {bit}"
            while name in self.categories:
                name += "'"
            names.append(name)
        return names

    def _risen(self, ids: object) -> Ints | None:
        """Rows of an array of rising ids (n,) that are all in the scene; None for any other value."""
        if type(ids) is not np.ndarray or ids.ndim != 1 or ids.dtype != np.int64 or not rising(ids, self._items.count):
            return None
        rows = self._items.table.rows(ids)
        return rows if not len(rows) or rows.min() >= 0 else None

    def _read(self, ids: object, values: Callable[[Ints], npt.NDArray[Read]]) -> npt.NDArray[Read]:
        """Values of objects by their rows, one each; for one id without an axis. An id may be there several times."""
        read = values(self._living(ids))
        return read if np.ndim(ids) else read[0]  # type: ignore[arg-type]

    def _transforms(self, rows: Ints, *names: str) -> npt.NDArray[Any]:
        """Columns of the transforms of objects."""
        transforms = self._items.looks(rows.tolist()).transforms
        values = np.array([[getattr(transform, name) for name in names] for transform in transforms])
        return values.reshape(-1, len(names))

    def _living(self, ids: object) -> Ints:
        """Rows of ids, which are checked to be in the scene."""
        table = self._items.table
        if isinstance(ids, int | np.integer) and type(ids) is not bool and ids in self:
            return np.array([table.row(int(ids))])
        values = ids_of("ids", ids)
        given = np.atleast_1d(integers("ids", values, (None,) if values.ndim else (), 0, table.count - 1))
        rows = table.rows(given)
        gone = np.flatnonzero(rows < 0)
        if len(gone):
            item, there = int(given[gone[0]]), self.ids()
            near = there[max(there.searchsorted(item) - 1, 0) :][:2].tolist()
            said = f"ids[{gone[0]}]: expected an object in the scene, got {item}, which was removed"
            raise InputError(said + f"; the nearest are {near}")
        return rows

    def _existing(self, ids: object) -> Ints:
        """Rows of ids, which are checked to be in the scene, each once."""
        risen = self._risen(ids)
        if risen is not None:
            return risen
        rows = self._living(ids)
        if len(rows) < 2:
            return rows
        ordered = np.sort(rows)
        if (ordered[1:] == ordered[:-1]).any():
            again = np.setdiff1d(np.arange(len(rows)), np.unique(rows, return_index=True)[1])
            item = self._items.id[rows[again[0]]]
            raise InputError(f"ids[{again[0]}]: expected each object once, got {item} again")
        return rows

    def _bits(self, categories: object, default: int) -> int:
        if categories is None:
            return default
        if isinstance(categories, int | np.integer):
            return integer("categories", categories, 0, ALL)
        if isinstance(categories, str):
            return self.category_bits(categories, field="categories")
        return self.category_bits(*listed("categories", categories, "bits or a list of names"), field="categories")

    def _bits_per_row(self, categories: object, n: int) -> Ints:
        if isinstance(categories, list | tuple) and any(isinstance(names, list | tuple) for names in categories):
            if len(categories) != n:
                raise InputError(f"categories: expected {n} lists of names, one for each object, got {len(categories)}")
            own = [listed(f"categories[{i}]", names, "a list of names") for i, names in enumerate(categories)]
            return np.array([self.category_bits(*names, field=f"categories[{i}]") for i, names in enumerate(own)])
        values = array_of("categories", categories)
        if values.dtype.kind in "iu" and values.ndim:
            return integers("categories", values, (n,), 0, ALL)
        return np.full(n, self._bits(categories, 0))


def _role(role: object) -> Role:
    if isinstance(role, Role):
        return role
    return Role(choice("role", role, ROLE_NAMES))


def default_bits(role: Role) -> int:
    """Category bits of an object that is given none."""
    return ALL if role is Role.OCCLUDER else 1


def _restored(
    name: str, categories: tuple[str, ...], bounds: Box | None, weapons: dict[str, Any], shots: list[Any],
    state: dict[str, Any],
) -> Scene:  # fmt: skip
    """A scene of the parts that `Scene.copy` and pickle take."""
    scene = Scene(categories=categories[1:], name=name)
    scene._bounds, scene.derived = bounds, Derived(bounds)
    scene.weapons, scene.shots, scene._items = weapons, shots, Items.restored(state)
    return scene
