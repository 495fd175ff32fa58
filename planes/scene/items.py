"""The items of a scene as columns, the stack of those that decide hits, front to back, and the journal of changes."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import late
from ..common.backend import cached_attribute, kernels_of
from ..common.checks import Bools, Floats, Ints
from ..common.limits import CATEGORY_BITS, HALF, JOURNAL_EACH, JOURNAL_FEW, JOURNAL_ROWS, SUB
from ..grid import fixed_point
from ..grid.fixed_point import boxes_at, pixel
from ..grid.spans import Box, sorted_once
from .derived import NEVER, ByMask
from .objects import DECIDING, HITTABLE, OCCLUDER, ROLES, Role, RowTable, looked_up
from .poses import Looks
from .sprite import Sprite
from .variants import MaskAtlas, Transform, Variant, surely_fits, variants_of

if TYPE_CHECKING:
    from ..bits.blockers import Cover
    from ..bits.tiles import Tiles
    from ..volumes.volumes import Volumes


STACK_ROW_BYTES = 73  # of a row of a stack: nine numbers, and whether it is an occluder


@dataclass(frozen=True, eq=False)
class Stack:
    """The items of one version of a scene that decide hits, front to back, as columns."""

    ids: Ints  # (M,)
    rows: Ints  # (M,) rows of the items in the columns of `Items`
    occluder: Bools  # (M,)
    categories: Ints  # (M,) bits; those of an occluder are CATEGORY_BITS higher, so that shots filter it apart
    owner: Ints  # (M,) ids
    box_xyxy: Ints  # (M, 4) inclusive, px
    offset: Ints  # (M,) start of the item's mask in `masks`, row by row
    atlas: MaskAtlas
    layered: bool  # whether the items lie on more than one layer
    arrangement: int  # number of the arrangement: stacks of the same number differ only in boxes

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy is an arrangement of its own: numbers of another process mean nothing here."""
        vars(self).update(state, arrangement=next(ARRANGEMENTS))

    def placed(self, box_xyxy: Ints) -> Stack:
        """A stack of the same items in the same order at other places; they share the rest, but for cached `sizes`."""
        stack = object.__new__(Stack)
        vars(stack).update(vars(self), box_xyxy=box_xyxy)
        vars(stack).pop("sizes", None)
        return stack

    def reformed(self, **columns: Any) -> Stack:
        """A stack of the same items in the same order with other looks; what follows from the order is shared."""
        stack = self.placed(columns["box_xyxy"])
        for name in ("has_unmet", "width", "area", "numbers", "mean_wh"):
            vars(stack).pop(name, None)
        vars(stack).update(columns)
        return stack

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def nbytes(self) -> int:
        """Bytes of the columns, without the masks, which belong to the scene."""
        return STACK_ROW_BYTES * len(self.ids)

    @property
    def masks(self) -> Bools:
        """Flat booleans of all masks in use."""
        return self.atlas.flat

    @cached_attribute
    def _by_id(self) -> tuple[Ints, Ints]:
        """Rising ids, and the rank of each."""
        order = np.argsort(self.ids)
        return self.ids[order], order

    def ranks(self, ids: Ints) -> Ints:
        """Ranks (n,) of items in the stack by their ids, 0 in front; -1 for ids that are not in it."""
        return looked_up(ids, *self._by_id)

    @cached_attribute
    def rank_by_label(self) -> Ints:
        """Rank in the stack of each label, which is a row of `Items` + 1; 0 for labels of no item."""
        ranks = np.zeros(int(self.rows.max(initial=-1)) + 2, np.int64)
        ranks[self.rows + 1] = np.arange(len(self.rows))
        ranks.flags.writeable = False
        return ranks

    @cached_attribute
    def is_object(self) -> Bools:
        """Whether each label, which is a row of `Items` + 1, is of an item that can be hit; label 0 is of no item."""
        objects = np.zeros(len(self.rank_by_label), np.bool_)
        objects[self.rows[~self.occluder] + 1] = True
        objects.flags.writeable = False
        return objects

    @cached_attribute
    def has_occluders(self) -> bool:
        """Whether any item is an occluder."""
        return bool(self.occluder.any())

    @property
    def covers(self) -> Bools:
        """Items (M,) that hide others and are not hit: `occluder`; (0,) if there are none."""
        return self.occluder if self.has_occluders else np.zeros(0, np.bool_)

    @cached_attribute
    def has_unmet(self) -> bool:
        """Whether any item has no category; every shot refuses such an item."""
        return not self.categories.all()

    @cached_attribute
    def width(self) -> Ints:
        """Width of each mask, px."""
        return self.box_xyxy[:, 2] - self.box_xyxy[:, 0] + 1

    @cached_attribute
    def area(self) -> int:
        """Pixels of all boxes."""
        return int((self.width * (self.box_xyxy[:, 3] - self.box_xyxy[:, 1] + 1)).sum())

    @cached_attribute
    def numbers(self) -> Ints:
        """Number (n + 1,) of the first pixel of each box, if those of all boxes are counted; the last is their sum."""
        height = self.box_xyxy[:, 3] - self.box_xyxy[:, 1] + 1
        return np.concatenate([[0], np.cumsum(self.width * height)])

    @cached_attribute
    def mean_wh(self) -> tuple[float, float]:
        """Mean width and height of the items, px."""
        wide, high = ((self.box_xyxy[:, 2:] - self.box_xyxy[:, :2]).mean(axis=0) + 1).tolist()
        return wide, high

    @cached_attribute
    def sizes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Mean width and height of the items, and of the box around them all, px: of many, around SPREAD of them."""
        boxes = self.box_xyxy[:: (len(self) - 1) // SPREAD + 1].tolist()
        x, y, x_max, y_max = zip(*boxes, strict=True)
        return self.mean_wh, (max(x_max) - min(x) + 1.0, max(y_max) - min(y) + 1.0)

    def mask(self, rank: int) -> Bools:
        """Mask (h, w) of the item at a rank, 0 in front."""
        x, y, x_max, y_max = self.box_xyxy[rank].tolist()
        size = (x_max - x + 1) * (y_max - y + 1)
        return self.masks[self.offset[rank] : self.offset[rank] + size].reshape(y_max - y + 1, x_max - x + 1)


def _is_there(boxes: Ints | Box) -> bool:
    """Whether any of some boxes (n, 4), or a single box, holds a pixel."""
    if isinstance(boxes, tuple):
        return boxes[0] <= boxes[2]
    return bool(len(boxes)) and (boxes.item(0, 0) <= boxes.item(0, 2) or bool((boxes[:, 0] <= boxes[:, 2]).any()))


SPREAD = 16  # most items whose places tell how far a stack is spread: an estimate for costs, anew in each frame

NOWHERE = (0, 0, -1, -1)
Change = tuple[int, Ints | int, Ints | Box, Ints | Box]
"""A version, the rows that it changed, and their deciding boxes before and after; plain numbers for a single item."""

PLACE, BOX = Struct("=2q"), Struct("=4q")
"""Layouts of a row of positions and of a row of boxes, to read and write a single item without an array."""

NOTHING = Sprite(frames=())  # sprite of a row without an object
NO_TRANSFORM = Transform()  # transform of a row without an object
NO_MASK = Variant(NO_TRANSFORM, np.zeros((0, 0), np.bool_), 0, 0, 0)  # mask of a row without an object

EMPTY = {"sprites": NOTHING, "angles": 0.0, "transforms": NO_TRANSFORM, "variants": NO_MASK, "names": ""}
"""The lists of items, and what they have in a row without an object."""

NO_EDGE = np.array([HALF, HALF, HALF - SUB, HALF - SUB])  # of an empty box
NO_ROWS, NO_BOXES = np.zeros(0, np.int64), np.zeros((0, 4), np.int64)

ROWS_SLACK = 1024  # rows without an item that are kept, beside as many as there are items
ARRANGEMENTS = itertools.count(1)  # source of numbers of arrangements; each of items of any scene has its own

COLUMNS: dict[str, tuple[int, ...]] = {
    "id": (), "role": (), "layer": (), "categories": (), "owner": (), "cost": (),
    "position_256": (2,), "velocity_256": (2,), "pivot_256": (2,), "size_wh": (2,), "offset": (), "mask": (),
}  # fmt: skip

UNARRANGED = frozenset(("position_256", "velocity_256", "cost"))  # columns whose change leaves the arrangement as it is
ORDERING = frozenset(("role", "layer"))  # columns whose change may reorder items, or which of them decide hits


def _rows_without_items(count: int) -> dict[str, Ints]:
    """So many rows of all columns."""
    rows = {name: np.zeros((count, *shape), np.int64) for name, shape in COLUMNS.items()}
    return rows | {"_box": np.full((count, 4), NOWHERE), "_edge": np.full((count, 4), NO_EDGE)}


class Items:
    """The items of a scene as columns and lists, which have a row for each item; `table` has the row of each id."""

    _box: Ints  # (n, 4) `deciding_boxes`
    _edge: Ints  # (n, 4) from the position to the first and last pixel of the box, 1/256 px
    id: Ints
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
        self.table = RowTable()
        self.version = 0
        self.atlas = MaskAtlas()
        self.sprites: list[Sprite] = []
        self.transforms: list[Transform] = []
        self.angles: list[float] = []
        self.variants: list[Variant] = []
        self.names: list[str] = []
        self.unmade: dict[int, None] = {}  # rows that have masks of earlier looks or none, until `make_masks`
        self.arrangement = next(ARRANGEMENTS)
        self._journal: deque[Change] = deque()
        self._in_order = False  # whether the order of the last stack still holds
        self._journal_rows = 0
        self._forgotten = 0
        self._decided = NEVER, 0  # version that was looked at, and `decided`
        self._stack: tuple[int, Stack] | None = None
        self._present = NO_ROWS, NO_ROWS, 0, 0  # ids and rows of items, and the numbers of ids and of items they are of
        self.by_mask = ByMask()
        self._imagery: tuple[int, list[Role]] | None = None
        self._lock = threading.Lock()
        self._allot()

    def _allot(self) -> None:
        vars(self).update(_rows_without_items(16))

    def add(self, sprite: Sprite, transform: Transform, angle: float, name: str, values: dict[str, object]) -> int:
        """Add an item with its columns `values`, and return its id; its mask is made later."""
        if not surely_fits(sprite, transform):
            variants_of([sprite], [transform])
        item, row = self.table.add()
        self._reserve(self.table.height)
        self.sprites[row], self.transforms[row], self.angles[row], self.names[row] = sprite, transform, angle, name
        for column, value in values.items():
            getattr(self, column)[row] = value
        self.id[row] = item
        self.arrangement, self._in_order = next(ARRANGEMENTS), False  # the row may be one of an item of the last stack
        self._make_later([row])
        return item

    def state(self) -> dict[str, Any]:
        """What a copy is made of: columns and lists with a row for each item by rising id, and the table of them."""
        ids, rows = self._known()
        columns: dict[str, Any] = {name: getattr(self, name) for name in COLUMNS}
        if len(self.id) > len(rows) or (rows != np.arange(len(rows))).any():  # pickles store equal objects once
            columns = {name: column.take(rows, axis=0) for name, column in columns.items()}
        lists = {name: [getattr(self, name)[row] for row in rows.tolist()] for name in (*Looks._fields, "names")}
        return columns | lists | {"table": self.table.copied(ids, self.count)}

    @classmethod
    def restored(cls, state: dict[str, Any], atlas: MaskAtlas | None = None) -> Items:
        """Items with the same ids as those of a state; their masks are made anew, and entered into an atlas."""
        items = cls()
        items.atlas, items.table = atlas or items.atlas, state["table"]
        count = items.table.height
        items._reserve(count)
        for name in COLUMNS:
            getattr(items, name)[:count] = state[name]
        vars(items).update({name: state[name] for name in (*Looks._fields, "names")})
        looks = items.looks(range(count))
        items._enter(range(count), variants_of(looks.sprites, looks.transforms))
        items.record(np.arange(count))
        return items

    @property
    def count(self) -> int:
        """Number of ids that the scene gave out."""
        return self.table.count

    @property
    def ids(self) -> Ints:
        """Rising ids of all items."""
        return self._known()[0]

    @property
    def rows(self) -> Ints:
        """Rows of all items, by rising id."""
        return self._known()[1]

    def _known(self) -> tuple[Ints, Ints]:
        """`ids` and `rows`, of as many as there are and not of all that ever were."""
        table, (ids, rows, count, living) = self.table, self._present
        if (count, living) != (table.count, table.living):
            ids = np.concatenate([ids, count + np.flatnonzero(table.row_of[count : table.count] >= 0)])
            rows = table.rows(ids)
            ids, rows = ids[rows >= 0], rows[rows >= 0]
            self._present = ids, rows, table.count, table.living
        return ids, rows

    def name_of(self, item: int) -> str:
        """Name of the item of an id, even if it was removed."""
        row = self.table.row(item)
        return self.names[row] if row >= 0 else self.table.name_of_gone(item)

    def remove(self, rows: Ints) -> None:
        """Remove items; their ids are not used again, but their rows are."""
        self.size_wh[rows] = 0
        self._make_later(rows.tolist())
        for row, item in zip(rows.tolist(), self.id[rows].tolist(), strict=True):
            if self.variants[row] is NO_MASK and not _is_there(tuple(self._box[row].tolist())):  # it was never seen
                del self.unmade[row]
            self.atlas.drop(self.variants[row])
            self.table.drop(item, self.names[row])
            for name, empty in EMPTY.items():
                getattr(self, name)[row] = empty
        self._stack = None  # it would hold the masks until the next shot
        if self.table.height > 2 * self.table.living + ROWS_SLACK:
            self._compact_rows()
        if self.atlas.wasteful:
            self._compact()

    def _compact_rows(self) -> None:
        """Move the items to the first rows; what follows the journal begins anew."""
        ids, rows = self._known()
        unmade = [number for number, row in enumerate(rows.tolist()) if row in self.unmade]
        lists = {name: [getattr(self, name)[row] for row in rows.tolist()] for name in EMPTY}
        for name in (*COLUMNS, "_box", "_edge"):
            setattr(self, name, getattr(self, name).take(rows, axis=0))
        vars(self).update(lists, unmade=dict.fromkeys(unmade))
        self.table.compact(ids)
        self._present = ids, np.arange(len(ids)), self.count, len(ids)
        self.arrangement, self._in_order = next(ARRANGEMENTS), False
        self._journal.clear()
        self._journal_rows, self._forgotten = 0, self.version

    def looks(self, rows: Sequence[int]) -> Looks:
        """What the masks of items are made of."""
        sprites, angles, transforms = self.sprites, self.angles, self.transforms
        return Looks([sprites[row] for row in rows], [angles[row] for row in rows], [transforms[row] for row in rows])

    def reform(self, rows: Sequence[int], looks: Looks) -> None:
        """Give items other looks; their masks are made later, but if any is too large, no item changes."""
        if not all(map(surely_fits, looks.sprites, looks.transforms)):
            variants_of(looks.sprites, looks.transforms)
        for row, sprite, angle, transform in zip(rows, *looks, strict=True):
            self.sprites[row], self.angles[row], self.transforms[row] = sprite, angle, transform
        self._make_later(rows)

    def _make_later(self, rows: Sequence[int]) -> None:
        """Leave masks of items to `make_masks`; what reads the version sees at once that something changed."""
        self.version += 1
        self.unmade.update(dict.fromkeys(rows))

    def make_masks(self) -> None:
        """Make the masks of items that changed their looks, all together, and record these items and removed ones."""
        with self._lock:  # threads may read a scene at once
            if rows := [row for row in self.unmade if self.sprites[row] is not NOTHING]:
                looks = self.looks(rows)
                variants = variants_of(looks.sprites, looks.transforms)
                for row in rows:
                    self.atlas.drop(self.variants[row])
                self._enter(rows, variants)
            if self.unmade:
                self._record(np.array(list(self.unmade)), ("mask",))
                self.unmade.clear()

    def record(self, rows: Ints, columns: Iterable[str] = COLUMNS) -> None:
        """Update the version, boxes, arrangement and journal after some columns of items changed."""
        self.version += 1
        self._record(rows, columns)

    def _record(self, rows: Ints, columns: Iterable[str]) -> None:
        """`record` of changes that the version counts already."""
        before, edge = self._box.take(rows, axis=0), self._edges(rows)
        after = boxes_at(self.position_256.take(rows, axis=0), edge)
        self._edge[rows], self._box[rows] = edge, after
        if not UNARRANGED.issuperset(columns):
            self.arrangement = next(ARRANGEMENTS)
            same = (before[:, 0] <= before[:, 2]) == (after[:, 0] <= after[:, 2])
            self._in_order &= ORDERING.isdisjoint(columns) and bool(same.all())
        self._note(rows, before, after, len(rows))

    def _edges(self, rows: Ints) -> Ints:
        """The columns of `_edge` of items; the boxes of those that decide no hit are empty."""
        size, role = self.size_wh.take(rows, axis=0), self.role.take(rows)
        size[(role != HITTABLE) & (role != OCCLUDER)] = 0
        low = HALF - self.pivot_256.take(rows, axis=0)
        return np.concatenate([low, low + SUB * (size - 1)], axis=1)

    def move(self, rows: Ints, position_256: Ints) -> None:
        """Move distinct items (n,) to new positions (n, 2); masks and order stay."""
        before, after = self._box.take(rows, axis=0), boxes_at(position_256, self._edge.take(rows, axis=0))
        self.position_256[rows], self._box[rows] = position_256, after
        self.version += 1
        self._note(rows, before, after, len(rows))

    def move_risen(self, ids: Ints, xy: Floats) -> bool:
        """Move items of rising ids (n,) to positions (n, 2), px; if any is invalid do nothing and return False."""
        rows, (before, after) = np.empty(len(ids), np.int64), np.empty((2, len(ids), 4), np.int64)
        place, table = kernels_of(fixed_point).place, self.table
        if not place(ids, xy, table.count, table.row_of, self._edge, self.position_256, self._box, rows, before, after):
            return False
        self.version += 1
        self._note(rows, before, after, len(rows))
        return True

    def move_one(self, item: int, x_256: int, y_256: int) -> bool:
        """Move the item of an id as `move` does; if it is not in the scene do nothing and return False."""
        row = self.table.row(item) if 0 <= item < self.table.count else -1
        if row < 0:
            return False
        before = x, y, x_max, y_max = BOX.unpack_from(self._box, BOX.size * row)  # type: ignore[arg-type]
        variant = self.variants[row]
        left, top = (x_256 - variant.pivot_x + HALF) >> 8, (y_256 - variant.pivot_y + HALF) >> 8
        after = (left, top, left + x_max - x, top + y_max - y)
        PLACE.pack_into(self.position_256, PLACE.size * row, x_256, y_256)  # type: ignore[arg-type]
        BOX.pack_into(self._box, BOX.size * row, *after)  # type: ignore[arg-type]
        self.version += 1
        self._note(row, before, after, 1)
        return True

    def _note(self, rows: Ints | int, before: Ints | Box, after: Ints | Box, n: int) -> None:
        """Write n changes of the present version into the journal."""
        self._journal.append((self.version, rows, before, after))
        self._journal_rows += n
        most = min(JOURNAL_ROWS, JOURNAL_FEW + JOURNAL_EACH * self.table.living)
        while self._journal_rows > most:
            version, old, _, _ = self._journal.popleft()
            self._journal_rows -= 1 if isinstance(old, int) else len(old)
            self._forgotten = version

    @property
    def decided(self) -> int:
        """Version of the last change to an item that decides hits."""
        seen, decided = self._decided
        if seen != self.version:
            changes = self.changes(seen)
            seen_in = (version for version, _, *boxes in changes or () if any(map(_is_there, boxes)))
            last = self.version if changes is None else next(seen_in, decided)
            self._decided = self.version, last
        return self._decided[1]

    def changed_rows(self, version: int) -> Ints | None:
        """Sorted rows of the items that changed after a version; None if that is forgotten."""
        changes = self.changes(version)
        return None if changes is None else sorted_once(np.concatenate([NO_ROWS, *(np.ravel(c[1]) for c in changes)]))

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

    def boxes(self, rows: Ints) -> Ints:
        """Inclusive boxes (n, 4) of the masks of items; x_max < x_min for an empty mask."""
        corner = pixel(self.position_256.take(rows, axis=0) - self.pivot_256.take(rows, axis=0))
        size = self.size_wh.take(rows, axis=0)
        boxes = np.concatenate([corner, corner + size - 1], axis=1)
        boxes[size[:, 0] == 0] = NOWHERE
        return boxes

    def corner(self, row: int) -> tuple[int, int]:
        """Top left pixel (x, y) of an item's mask."""
        x, y = pixel(self.position_256[row] - self.pivot_256[row]).tolist()
        return x, y

    def deciding_boxes(self, rows: Ints) -> Ints:
        """`boxes`, but empty for items that decide no hit: planes need not follow their changes."""
        return self._box.take(rows, axis=0)

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
        if last is not None and last.arrangement == self.arrangement:
            return last.placed(self.deciding_boxes(last.rows))
        if last is None or not self._in_order:
            return self.stack_of(*DECIDING)
        rows = last.rows
        return last.reformed(
            arrangement=self.arrangement, box_xyxy=self.deciding_boxes(rows), offset=self.offset.take(rows),
            atlas=self.atlas, categories=self._filtered_by(rows, last.occluder), owner=self.owner.take(rows),
        )  # fmt: skip

    def _filtered_by(self, rows: Ints, occluder: Bools) -> Ints:
        """Categories of a stack's items."""
        bits: Ints = self.categories.take(rows) << CATEGORY_BITS * occluder
        return bits

    def stack_of(self, *roles: Role) -> Stack:
        """Items of some roles, front to back."""
        wanted = np.isin(self.role.take(self.rows), [ROLES.index(role) for role in roles])
        rows = self.rows[wanted & (self.size_wh[self.rows, 0] > 0)]
        ids, occluder, layer = self.id[rows], self.role[rows] == OCCLUDER, self.layer[rows]
        layered = bool((layer[1:] != layer[:-1]).any())
        keys = [-ids]
        if occluder.any():
            keys.append(~occluder)
        if layered:
            keys.append(-layer)
        order = np.lexsort(keys)
        ids, rows, occluder = ids[order], rows[order], occluder[order]
        return Stack(
            ids, rows, occluder, self._filtered_by(rows, occluder), self.owner[rows], self.boxes(rows),
            self.offset[rows], self.atlas, layered, self.arrangement if roles == DECIDING else next(ARRANGEMENTS),
        )  # fmt: skip

    def imagery(self) -> list[Role]:
        """Roles in use that decide no hit."""
        known = self._imagery
        if known is None or known[0] != self.arrangement:
            used = set(self.role.take(self.rows).tolist())
            drawn = [role for number, role in enumerate(ROLES) if number in used and role not in DECIDING]
            known = self._imagery = self.arrangement, drawn
        return known[1]

    def tiles(self) -> Tiles:
        """Bit rows of the masks of the stack."""
        stack = self.stack()
        atlas = self.by_mask.tiles = self.by_mask.tiles or late.tiles.TileAtlas()
        known = atlas.known(stack.arrangement)
        if known is not None:
            return known
        variants, rows = self.variants, stack.rows
        number, carved_of = self.mask.take(rows), lambda rank: variants[rows[rank]].carved
        return atlas.tiles(lambda rank: variants[rows[rank]].mask, number, stack.arrangement, carved_of)

    def covers(self, rows: Ints, boxes_xyxy: Ints, near_xyxy: Box | None) -> tuple[Ints, Cover]:
        """Rectangles that cover the masks of items (B,); see `bits.blockers.Covers.of`."""
        covers = self.by_mask.covers = self.by_mask.covers or late.blockers.Covers()
        return covers.of(self.mask.take(rows), lambda k: self.variants[rows[k]].mask, boxes_xyxy, near_xyxy)

    def bounding(self, kind: str, rows: Ints) -> tuple[Volumes, Ints]:
        """Volumes of masks, px from the mask's pixel [0, 0], and which of them each item has; no mask may be empty."""
        bounds = self.by_mask.bounds.setdefault(kind, late.fit.Bounds(kind))
        return bounds.rows(self.mask[rows], self.sprites, self.variants, rows, len(self.stack()))

    def _enter(self, rows: Sequence[int], variants: Sequence[Variant]) -> None:
        """Enter the masks of items into the atlas and the columns."""
        for row, variant in zip(rows, variants, strict=True):
            self.variants[row] = variant
        self.offset[rows] = self.atlas.take(variants)
        found = [(mask.uid, mask.pivot_x, mask.pivot_y, *mask.mask.shape[::-1]) for mask in variants]
        columns = np.array(found, np.int64).reshape(-1, 5)
        self.mask[rows], self.pivot_256[rows], self.size_wh[rows] = columns[:, 0], columns[:, 1:3], columns[:, 3:]

    def _compact(self) -> None:
        """Rebuild the atlas with only the masks in use."""
        atlas, offset = MaskAtlas(), self.offset.copy()
        offset[self.rows] = atlas.take([self.variants[row] for row in self.rows.tolist()])
        self.atlas, self.offset = atlas, offset

    def _reserve(self, count: int) -> None:
        """Make room for `count` rows."""
        for name, empty in EMPTY.items():
            getattr(self, name).extend([empty] * (count - len(getattr(self, name))))
        size = len(self.id)
        if count > size:
            for name, spare in _rows_without_items(max(count - size, size // 4)).items():
                setattr(self, name, np.concatenate([getattr(self, name), spare]))
