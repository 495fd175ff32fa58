"""The items of a scene as columns, the stack of those that decide hits, front to back, and the journal of changes."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import late
from ..common.backend import kernels_of
from ..common.checks import Bools, Floats, InputError, Ints, boxes_in, choice
from ..common.limits import CATEGORY_BITS, HALF, ITEMS_MAX, JOURNAL_EACH, JOURNAL_FEW, JOURNAL_ROWS, SUB
from ..grid import fixed_point
from ..grid.fixed_point import boxes_at, pixel
from ..grid.spans import Box, sorted_once
from .derived import NEVER, ByMask
from .poses import Looks
from .sprite import Sprite
from .variants import MaskAtlas, Transform, Variant, surely_fits, variants_of

if TYPE_CHECKING:
    from ..bits.tiles import Tiles
    from ..volumes.fit import Kind
    from ..volumes.volumes import Volumes


STACK_ROW_BYTES = 65
"""Bytes of a row of a stack: eight numbers and whether it is an occluder."""


@dataclass(frozen=True, eq=False)
class Stack:
    """The items of one version of a scene that decide hits, front to back, as columns."""

    ids: Ints  # (M,)
    occluder: Bools  # (M,)
    categories: Ints  # (M,) bits; those of an occluder are CATEGORY_BITS higher, so that shots filter it apart
    owner: Ints  # (M,) ids
    box_xyxy: Ints  # (M, 4) inclusive, px
    offset: Ints  # (M,) start of the item's mask in `masks`, row by row
    masks: Bools  # flat booleans of all masks in use
    layered: bool  # whether the items lie on more than one layer
    forms: int  # number of the arrangement: stacks of the same number differ only in boxes
    count: int  # number of ids of the scene, including those that are not in the stack

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy is an arrangement of its own: numbers of another process mean nothing here."""
        vars(self).update(state, forms=next(ARRANGEMENTS))

    def placed(self, box_xyxy: Ints) -> Stack:
        """A stack of the same items in the same order at other places; both share the other columns."""
        return self._with(("sizes",), box_xyxy=box_xyxy)  # boxes keep their sizes, and pixels their numbers

    def reformed(self, forms: int, box_xyxy: Ints, offset: Ints, masks: Bools, categories: Ints, owner: Ints) -> Stack:
        """A stack of the same ids in the same order with other masks, categories or owners."""
        return self._with(
            ("sizes", "width", "numbers", "has_unmet"), forms=forms, box_xyxy=box_xyxy, offset=offset, masks=masks,
            categories=categories, owner=owner,
        )  # fmt: skip

    def _with(self, stale: tuple[str, ...], **columns: object) -> Stack:
        """A stack with some columns replaced; it shares the rest and all cached properties that are not stale."""
        stack = object.__new__(Stack)
        vars(stack).update(vars(self))
        for name in stale:
            vars(stack).pop(name, None)
        vars(stack).update(columns)
        return stack

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns, without the masks, which belong to the scene."""
        return STACK_ROW_BYTES * len(self.ids)

    @cached_property
    def rank_of(self) -> Ints:
        """Rank in the stack of each id of the scene (count,), 0 in front; -1 for ids that are not in it."""
        ranks = np.full(self.count, -1)
        ranks[self.ids] = np.arange(len(self.ids))
        ranks.flags.writeable = False
        return ranks

    @cached_property
    def rank_by_code(self) -> Ints:
        """Rank in the stack of each label, which is an id + 1; 0 for labels of no item."""
        ranks = np.zeros(int(self.ids.max(initial=-1)) + 2, np.int64)
        ranks[self.ids + 1] = np.arange(len(self.ids))
        ranks.flags.writeable = False
        return ranks

    @cached_property
    def is_object(self) -> Bools:
        """Whether each label (count + 1,), which is an id + 1, is of an item that can be hit; label 0 is of no item."""
        objects = np.zeros(self.count + 1, np.bool_)
        objects[self.ids[~self.occluder] + 1] = True
        objects.flags.writeable = False
        return objects

    @cached_property
    def has_occluders(self) -> bool:
        """Whether any item is an occluder."""
        return bool(self.occluder.any())

    @property
    def covers(self) -> Bools:
        """Items (M,) that hide others and are not hit: `occluder`; (0,) if there are none."""
        return self.occluder if self.has_occluders else np.zeros(0, np.bool_)

    @cached_property
    def has_unmet(self) -> bool:
        """Whether any item has no category; every shot refuses such an item."""
        return not self.categories.all()

    @cached_property
    def width(self) -> Ints:
        """Width of each mask, px."""
        return self.box_xyxy[:, 2] - self.box_xyxy[:, 0] + 1

    @cached_property
    def numbers(self) -> Ints:
        """Number (n + 1,) of the first pixel of each box, if those of all boxes are counted; the last is their sum."""
        height = self.box_xyxy[:, 3] - self.box_xyxy[:, 1] + 1
        return np.concatenate([[0], np.cumsum(self.width * height)])

    @cached_property
    def sizes(self) -> tuple[Floats, Floats]:
        """Mean width and height of the items, and width and height of the box around all of them, px."""
        x, y, x_max, y_max = np.ascontiguousarray(self.box_xyxy.T)
        mean = np.array([(x_max - x).mean(), (y_max - y).mean()]) + 1
        return mean, np.array([x_max.max() - x.min(), y_max.max() - y.min()], np.float64) + 1

    def mask(self, rank: int) -> Bools:
        """Mask (h, w) of the item at a rank, 0 in front."""
        x, y, x_max, y_max = self.box_xyxy[rank].tolist()
        size = (x_max - x + 1) * (y_max - y + 1)
        return self.masks[self.offset[rank] : self.offset[rank] + size].reshape(y_max - y + 1, x_max - x + 1)


def _is_there(boxes: Ints | Box) -> bool:
    """Whether any of some boxes (n, 4), or a single box, holds a pixel."""
    if isinstance(boxes, tuple):
        return boxes[0] <= boxes[2]
    if not len(boxes):
        return False
    return bool(boxes[0, 0] <= boxes[0, 2] or (boxes[:, 0] <= boxes[:, 2]).any())  # the first tells most often


class Role(Enum):
    """Role of an object; only HITTABLE and OCCLUDER decide hits, the others are only drawn."""

    BACKGROUND = "background"
    HITTABLE = "hittable"
    MOVER = "mover"
    OCCLUDER = "occluder"
    HUD = "hud"


ROLES = tuple(Role)
DECIDING = Role.HITTABLE, Role.OCCLUDER
HITTABLE, OCCLUDER = map(ROLES.index, DECIDING)
NOWHERE = (0, 0, -1, -1)
Change = tuple[int, Ints | int, Ints | Box, Ints | Box]
"""A version, the items that it changed, and their deciding boxes before and after; plain numbers for a single item."""

PLACE, BOX = Struct("=2q"), Struct("=4q")
"""Layouts of a row of positions and of a row of boxes, to read and write a single item without an array."""

NOTHING = Sprite(frames=())  # sprite of an id without an object: a removed one, or one that never was
NO_TRANSFORM = Transform()  # transform of an id without an object
NO_MASK = Variant(NO_TRANSFORM, np.zeros((0, 0), np.bool_), 0, 0, 0)  # mask of an id without an object

NO_EDGE = np.array([HALF, HALF, HALF - SUB, HALF - SUB])  # of an empty box
NO_IDS, NO_BOXES = np.zeros(0, np.int64), np.zeros((0, 4), np.int64)

ARRANGEMENTS = itertools.count(1)  # source of numbers of arrangements; each of items of any scene has its own


COLUMNS: dict[str, tuple[int, ...]] = {
    "alive": (), "role": (), "layer": (), "categories": (), "owner": (), "cost": (),
    "position_256": (2,), "velocity_256": (2,), "pivot_256": (2,), "size_wh": (2,), "offset": (), "mask": (),
}  # fmt: skip

UNARRANGED = frozenset(("position_256", "velocity_256", "cost"))  # columns whose change leaves the arrangement as it is
ORDERING = frozenset(("alive", "role", "layer"))  # columns whose change may reorder items, or which of them decide hits


class Items:
    """The items of a scene as columns by id; ids count up from 0 and are never used again."""

    alive: Ints
    role: Ints
    layer: Ints
    categories: Ints
    owner: Ints
    cost: Ints
    position_256: Ints
    velocity_256: Ints
    pivot_256: Ints
    size_wh: Ints
    offset: Ints
    mask: Ints

    def __init__(self) -> None:
        self.count = 0
        self.living = 0
        self.version = 0
        self.atlas = MaskAtlas()
        self.sprites: list[Sprite] = []
        self.forms: list[Transform] = []
        self.angles: list[float] = []
        self.variants: list[Variant] = []
        self.names: list[str] = []
        self.unmade: dict[int, None] = {}  # items that have masks of earlier looks or none, until `make_masks`
        self.arrangement = next(ARRANGEMENTS)
        self._journal: deque[Change] = deque()
        self._in_order = False  # whether the order of the last stack still holds
        self._journal_rows = 0
        self._forgotten = 0
        self._decided = NEVER, 0  # version that was looked at, and `decided`
        self._stack: tuple[int, Stack] | None = None
        self._present = NO_IDS, 0, 0  # `ids`, and the numbers of ids and of items that they are of
        self.by_mask = ByMask()
        self._imagery: tuple[int, list[Role]] | None = None
        self._lock = threading.Lock()
        self._allot()

    def _allot(self) -> None:
        for name, shape in COLUMNS.items():
            setattr(self, name, np.zeros((16, *shape), np.int64))
        self._box = np.tile(np.array(NOWHERE), (16, 1))
        self._edge = np.tile(NO_EDGE, (16, 1))  # from the position to the first and last pixel of the box, 1/256 px

    def add(self, sprite: Sprite, form: Transform, angle: float, name: str, values: dict[str, object]) -> int:
        """Append an item with its columns `values`, and return its id; its mask is made later."""
        item = self.count
        if item >= ITEMS_MAX:
            raise InputError(f"objects: expected at most {ITEMS_MAX} in the life of a scene, got one more")
        if not surely_fits(sprite, form):
            variants_of([sprite], [form])
        self.skip_to(item + 1)
        self.sprites[item], self.forms[item], self.angles[item], self.names[item] = sprite, form, angle, name
        for column, value in values.items():
            getattr(self, column)[item] = value
        self.alive[item] = 1
        self.living += 1
        self._make_later([item])
        return item

    def state(self) -> dict[str, Any]:
        """What a copy is made of: views of the columns, and lists of looks and names."""
        columns = {name: getattr(self, name) for name in COLUMNS}
        columns = {name: col if len(col) == self.count else col[: self.count] for name, col in columns.items()}
        return columns | {name: self._by_id(name) for name in (*Looks._fields, "names")}

    def _by_id(self, name: str) -> list[Any]:
        """A list of its own of looks or names, by id."""
        return list(getattr(self, name))

    @classmethod
    def restored(cls, state: dict[str, Any], atlas: MaskAtlas | None = None) -> Items:
        """Items with the same ids as those of a state; their masks are made anew, and entered into an atlas."""
        items = cls()
        items.atlas = atlas or items.atlas
        items.skip_to(len(state["names"]))
        for name in COLUMNS:
            getattr(items, name)[: items.count] = state[name]
        for name in (*Looks._fields, "names"):
            setattr(items, name, state[name])
        ids = items.ids
        items.living = len(ids)
        looks = items.looks(ids.tolist())
        items._enter(ids.tolist(), variants_of(looks.sprites, looks.forms))
        items.record(ids)
        return items

    @property
    def ids(self) -> Ints:
        """Rising ids of all items, of as many as there are and not of all that ever were."""
        ids, count, living = self._present
        if (count, living) != (self.count, self.living):
            ids = np.concatenate([ids, np.arange(count, self.count)])
            ids = ids[self.alive.take(ids) == 1]
            self._present = ids, self.count, self.living
        return ids

    def skip_to(self, item: int) -> None:
        """Skip the ids below `item` as if their objects had been removed; objects of a scene file keep their ids."""
        missing = item - self.count
        if missing <= 0:
            return
        self._reserve(item)
        self.sprites += [NOTHING] * missing
        self.forms += [NO_TRANSFORM] * missing
        self.angles += [0.0] * missing
        self.variants += [NO_MASK] * missing
        self.names += [""] * missing
        self.count = item
        self.arrangement = next(ARRANGEMENTS)
        self._in_order = False

    def remove(self, ids: Ints) -> None:
        """Remove items; their ids are not used again, and their columns and names stay."""
        self.alive[ids] = 0
        self.living -= len(ids)
        self._make_later(ids.tolist())
        for item in ids.tolist():
            if self.variants[item] is NO_MASK:  # it came and went unseen
                del self.unmade[item]
            self.atlas.drop(self.variants[item])
            self.sprites[item], self.angles[item] = NOTHING, 0.0
            self.forms[item], self.variants[item] = NO_TRANSFORM, NO_MASK
        self._stack = None  # it would hold the masks until the next shot
        if self.atlas.wasteful:
            self._compact()

    def looks(self, ids: Sequence[int]) -> Looks:
        """What the masks of items are made of."""
        sprites, angles, forms = self.sprites, self.angles, self.forms
        return Looks([sprites[item] for item in ids], [angles[item] for item in ids], [forms[item] for item in ids])

    def reform(self, ids: Sequence[int], looks: Looks) -> None:
        """Give items other looks; their masks are made later, but if any is too large, no item changes."""
        if not all(map(surely_fits, looks.sprites, looks.forms)):
            variants_of(looks.sprites, looks.forms)
        for item, sprite, angle, form in zip(ids, *looks, strict=True):
            self.sprites[item], self.angles[item], self.forms[item] = sprite, angle, form
        self._make_later(ids)

    def _make_later(self, ids: Sequence[int]) -> None:
        """Leave masks of items to `make_masks`; what reads the version sees at once that something changed."""
        self.version += 1
        self.unmade.update(dict.fromkeys(ids))

    def make_masks(self) -> None:
        """Make the masks of items that changed their looks, all together, and record these items and removed ones."""
        with self._lock:  # threads may read a scene at once
            if ids := [item for item in self.unmade if self.sprites[item] is not NOTHING]:
                looks = self.looks(ids)
                variants = variants_of(looks.sprites, looks.forms)
                for item in ids:
                    self.atlas.drop(self.variants[item])
                self._enter(ids, variants)
            if self.unmade:
                self._record(np.array(list(self.unmade)), ("mask",))
                self.unmade.clear()

    def record(self, ids: Ints, columns: Iterable[str] = COLUMNS) -> None:
        """Update the version, boxes, arrangement and journal after some columns of items changed."""
        self.version += 1
        self._record(ids, columns)

    def _record(self, ids: Ints, columns: Iterable[str]) -> None:
        """`record` of changes that the version counts already."""
        before, after = self._box[ids], self.deciding_boxes(ids)
        low = HALF - self.pivot_256[ids]
        self._edge[ids] = np.concatenate([low, low + SUB * (after[:, 2:] - after[:, :2])], axis=1)
        self._box[ids] = after
        if not UNARRANGED.issuperset(columns):
            self.arrangement = next(ARRANGEMENTS)
            same = (before[:, 0] <= before[:, 2]) == (after[:, 0] <= after[:, 2])
            self._in_order &= ORDERING.isdisjoint(columns) and bool(same.all())
        self._note(ids, before, after, len(ids))

    def move(self, ids: Ints, position_256: Ints) -> None:
        """Move distinct items (n,) to new positions (n, 2); masks and order stay."""
        before, after = self._box.take(ids, axis=0), boxes_at(position_256, self._edge.take(ids, axis=0))
        self.position_256[ids], self._box[ids] = position_256, after
        self.version += 1
        self._note(ids, before, after, len(ids))

    def move_risen(self, ids: Ints, xy: Floats) -> bool:
        """Move items of rising ids (n,) to positions (n, 2), px; if any is invalid do nothing and return False."""
        before, after = np.empty((2, len(ids), 4), np.int64)
        place = kernels_of(fixed_point).place
        if not place(ids, xy, self.count, self.alive, self._edge, self.position_256, self._box, before, after):
            return False
        self.version += 1
        self._note(ids.copy(), before, after, len(ids))
        return True

    def move_one(self, item: int, x_256: int, y_256: int) -> bool:
        """Move one item as `move` does; if it is not in the scene do nothing and return False."""
        if not (0 <= item < self.count and self.alive.item(item)):
            return False
        before = x, y, x_max, y_max = BOX.unpack_from(self._box, BOX.size * item)  # type: ignore[arg-type]
        variant = self.variants[item]
        left, top = (x_256 - variant.pivot_x + HALF) >> 8, (y_256 - variant.pivot_y + HALF) >> 8
        after = (left, top, left + x_max - x, top + y_max - y)
        PLACE.pack_into(self.position_256, PLACE.size * item, x_256, y_256)  # type: ignore[arg-type]
        BOX.pack_into(self._box, BOX.size * item, *after)  # type: ignore[arg-type]
        self.version += 1
        self._note(item, before, after, 1)
        return True

    def _note(self, ids: Ints | int, before: Ints | Box, after: Ints | Box, n: int) -> None:
        """Write n changes of the present version into the journal."""
        self._journal.append((self.version, ids, before, after))
        self._journal_rows += n
        most = min(JOURNAL_ROWS, JOURNAL_FEW + JOURNAL_EACH * self.living)
        while self._journal_rows > most:
            version, old, _, _ = self._journal.popleft()
            self._journal_rows -= np.size(old)
            self._forgotten = version

    @property
    def decided(self) -> int:
        """Version of the last change to an item that decides hits."""
        seen, decided = self._decided
        if seen != self.version:
            changes = self.changes(seen)
            last = self.version if changes is None else decided
            for version, _, before, after in changes or ():
                if _is_there(before) or _is_there(after):
                    last = version
                    break
            self._decided = self.version, last
        return self._decided[1]

    def changed_ids(self, version: int) -> Ints | None:
        """Sorted ids of the items that changed after a version; None if that is forgotten."""
        changes = self.changes(version)
        return None if changes is None else sorted_once(np.concatenate([NO_IDS, *(np.ravel(c[1]) for c in changes)]))

    def changes(self, version: int) -> list[Change] | None:
        """Changes after a version, the last first; None if that is forgotten."""
        if version < self._forgotten:
            return None
        found = []
        for change in reversed(self._journal):
            if change[0] <= version:
                break
            found.append(change)
        return found

    def boxes(self, ids: Ints) -> Ints:
        """Inclusive boxes (n, 4) of the masks of items; x_max < x_min for an empty mask."""
        corner = pixel(self.position_256.take(ids, axis=0) - self.pivot_256.take(ids, axis=0))
        size = self.size_wh.take(ids, axis=0)
        boxes = np.concatenate([corner, corner + size - 1], axis=1)
        boxes[(self.alive[ids] == 0) | (size[:, 0] == 0)] = NOWHERE
        return boxes

    def corner(self, item: int) -> tuple[int, int]:
        """Top left pixel (x, y) of an item's mask."""
        x, y = pixel(self.position_256[item] - self.pivot_256[item]).tolist()
        return x, y

    def deciding_boxes(self, ids: Ints) -> Ints:
        """`boxes`, but empty for items that decide no hit: planes need not follow their changes."""
        boxes = self.boxes(ids)
        role = self.role[ids]
        boxes[(role != HITTABLE) & (role != OCCLUDER)] = NOWHERE
        return boxes

    def settled(self) -> tuple[MaskAtlas, Stack | None]:
        """The atlas, rebuilt if too much of it is unused, and the last stack, whose order may be an earlier one."""
        with self._lock:  # a thread that reads the stack may rebuild the atlas
            if self.atlas.wasteful:
                self._compact()
            return self.atlas, None if self._stack is None else self._stack[1]

    @property
    def has_stack(self) -> bool:
        """Whether the stack of the present version is cached."""
        return self._stack is not None and self._stack[0] == self.version

    def stack(self) -> Stack:
        """Items that decide hits, front to back: by greater layer, then occluders before objects, then later added."""
        known = self._stack
        if known is not None and known[0] == self.version:
            return known[1]
        with self._lock:
            if self._stack is None or self._stack[0] != self.version:
                if self.atlas.wasteful:
                    self._compact()
                self._stack = (self.version, self._stack_after(None if self._stack is None else self._stack[1]))
                self._in_order = True
            return self._stack[1]

    def _stack_after(self, last: Stack | None) -> Stack:
        """The stack of the present version; it shares unchanged columns with the last one."""
        if last is not None and last.forms == self.arrangement:
            return last.placed(self._boxes_in_order(last.ids))
        if last is None or not self._in_order:
            return self.stack_of(*DECIDING)
        ids = last.ids
        columns = self._filtered_by(ids, last.occluder), self.owner.take(ids)
        return last.reformed(
            self.arrangement, self._boxes_in_order(ids), self.offset.take(ids), self.atlas.flat, *columns
        )

    def _filtered_by(self, ids: Ints, occluder: Bools) -> Ints:
        """Categories of a stack's items."""
        bits: Ints = self.categories.take(ids) << CATEGORY_BITS * occluder
        return bits

    def _boxes_in_order(self, ids: Ints) -> Ints:
        """Boxes of all items that decide hits."""
        return self._box.take(ids, axis=0)

    def stack_of(self, *roles: Role) -> Stack:
        """Items of some roles, front to back."""
        wanted = np.isin(self.role.take(self.ids), [ROLES.index(role) for role in roles])
        ids = self.ids[wanted & (self.size_wh[self.ids, 0] > 0)]
        occluder, layer = self.role[ids] == OCCLUDER, self.layer[ids]
        layered = bool((layer[1:] != layer[:-1]).any())
        keys = [-ids]
        if occluder.any():
            keys.append(~occluder)
        if layered:
            keys.append(-layer)
        order = np.lexsort(keys)
        ids, occluder = ids[order], occluder[order]
        return Stack(
            ids, occluder, self._filtered_by(ids, occluder), self.owner[ids], self.boxes(ids), self.offset[ids],
            self.atlas.flat, layered, self.arrangement if roles == DECIDING else next(ARRANGEMENTS), self.count,
        )  # fmt: skip

    def imagery(self) -> list[Role]:
        """Roles in use that decide no hit."""
        known = self._imagery
        if known is None or known[0] != self.arrangement:
            used = set(self.role.take(self.ids).tolist())
            drawn = [role for number, role in enumerate(ROLES) if number in used and role not in DECIDING]
            known = self._imagery = self.arrangement, drawn
        return known[1]

    def tiles(self) -> Tiles:
        """Bit rows of the masks of the stack."""
        stack = self.stack()
        atlas = self.by_mask.tiles = self.by_mask.tiles or late.tiles.TileAtlas()
        known = atlas.known(stack.forms)
        if known is not None:
            return known
        variants, ids = self.variants, stack.ids
        return atlas.tiles(lambda rank: variants[ids[rank]].mask, self.mask.take(ids), stack.forms)

    def covers(self, ids: Ints, boxes_xyxy: Ints, near_xyxy: Box | None) -> tuple[Ints, Ints]:
        """Rectangles that cover the masks of items (B,); see `bits.shadows.Covers.of`."""
        covers = self.by_mask.covers = self.by_mask.covers or late.shadows.Covers()
        return covers.of(self.mask.take(ids), lambda row: self.variants[ids[row]].mask, boxes_xyxy, near_xyxy)

    def bounding(self, kind: Kind, ids: Ints) -> tuple[Volumes, Ints]:
        """Volumes of masks, px from the mask's pixel [0, 0], and the row for each item; no mask may be empty."""
        bounds = self.by_mask.bounds.setdefault(kind, late.fit.Bounds(kind))
        return bounds.rows(self.mask[ids], self.sprites, self.variants, ids, len(self.stack()))

    def volumes(self, name: str, ids: Ints) -> Volumes:
        """Bounding volumes of items in the world, one row each; see `Scene.volumes`."""
        k = boxes_in("kind", name)
        choice("kind", name if k is None else "4 boxes", ("box", "circle", "oriented box", "4 boxes", "polygon"))
        for item in ids[self.size_wh[ids, 0] == 0].tolist():
            raise InputError(f"ids: expected objects with a pixel, got {item}, whose mask is empty")
        if name == "box":
            low, high = np.split(self.boxes(ids).astype(np.float64), 2, axis=1)
            return late.volumes.Aabbs(low - 0.5, high + 0.5)
        if not len(ids):
            return late.volumes.Circles(np.zeros((0, 2)), 0.0)
        volumes, row = self.bounding(late.fit.Kind(name) if k is None else late.fit.Kind(late.fit.KINDS[2], k), ids)
        return late.fit.shifted(volumes.take(row), pixel(self.position_256[ids] - self.pivot_256[ids]))

    def _enter(self, ids: Sequence[int], variants: Sequence[Variant]) -> None:
        """Enter the masks of items into the atlas and the columns."""
        for item, variant in zip(ids, variants, strict=True):
            self.variants[item] = variant
        self.offset[ids] = self.atlas.take(variants)
        rows = [(mask.uid, mask.pivot_x, mask.pivot_y, *mask.mask.shape[::-1]) for mask in variants]
        columns = np.array(rows, np.int64).reshape(-1, 5)
        self.mask[ids], self.pivot_256[ids], self.size_wh[ids] = columns[:, 0], columns[:, 1:3], columns[:, 3:]

    def _compact(self) -> None:
        """Rebuild the atlas with only the masks in use."""
        atlas, offset = MaskAtlas(), self.offset.copy()
        offset[self.ids] = atlas.take([self.variants[item] for item in self.ids.tolist()])
        self.atlas, self.offset = atlas, offset

    def _reserve(self, count: int) -> None:
        size = len(self.alive)
        if count <= size:
            return
        more = max(count - size, size // 4)
        self._box = np.concatenate([self._box, np.tile(np.array(NOWHERE), (more, 1))])
        self._edge = np.concatenate([self._edge, np.tile(NO_EDGE, (more, 1))])
        for name in COLUMNS:
            old: npt.NDArray[np.int64] = getattr(self, name)
            grown = np.zeros((size + more, *old.shape[1:]), np.int64)
            grown[:size] = old
            setattr(self, name, grown)
