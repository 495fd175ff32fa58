"""Everything that is placed in a scene, as columns; what decides hits, front to back; and what changed since when."""

from __future__ import annotations

import itertools
import re
import threading
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from struct import Struct
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from planes import placing
from planes.arrays import Bools, Floats, InputError, Ints, choice
from planes.constants import ATLAS_SLACK_BYTES, BOXES_MAX, HALF, ITEMS_MAX, JOURNAL_ROWS, SUB
from planes.forms import Form
from planes.grid256 import pixel
from planes.placing import boxes_at
from planes.spans import Box
from planes.sprite import Sprite, Variant, variant_of
from planes.stack import Stack, clipped
from planes.twins import kernels_of

if TYPE_CHECKING:
    from planes.bounding import Bounds, Kind
    from planes.tiles import TileAtlas, Tiles
    from planes.volumes import Volumes

__all__ = ["Items", "MaskAtlas", "Role", "Stack", "boxes_in", "clipped"]


class Role(Enum):
    """What an object is for; only HITTABLE and OCCLUDER decide hits, the rest is for the picture."""

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
"""A version, the items that changed then, and their deciding boxes before and after it: of one item, plain numbers."""

PLACED_NS = 30
"""What it takes in numpy to place an item, of many."""

NEVER = -1
"""A version before all others."""

PLACE, BOX = Struct("=2q"), Struct("=4q")
"""A row of positions and one of boxes, as one item is read and written without an array."""

NO_IDS, NO_BOXES = np.zeros(0, np.int64), np.zeros((0, 4), np.int64)

ARRANGEMENTS = itertools.count(1)
"""Every arrangement of the items of any scene has its own number."""


def boxes_in(field: str, name: object) -> int | None:
    """How many boxes a name like "4 boxes" says; None for any other name."""
    counted = re.fullmatch(r"([0-9]{1,4}) box(?:es)?", name) if isinstance(name, str) else None
    if counted is None:
        return None
    k = int(counted[1])
    if not 1 <= k <= BOXES_MAX:
        raise InputError(f"{field}: expected 1 to {BOXES_MAX} boxes, got {k}")
    return k


@dataclass
class MaskAtlas:
    """All masks in use in one flat array; one that several items use is stored once."""

    flat: Bools = field(default_factory=lambda: np.zeros(1 << 12, np.bool_))
    used: int = 0
    live: int = 0
    offsets: dict[int, int] = field(default_factory=dict)
    users: dict[int, int] = field(default_factory=dict)

    def take(self, variant: Variant) -> int:
        """Offset of a mask that an item begins to use."""
        users = self.users[variant.uid] = self.users.get(variant.uid, 0) + 1
        if users == 1:
            self.live += variant.mask.size
        offset = self.offsets.get(variant.uid)
        return self._append(variant) if offset is None else offset

    def drop(self, variant: Variant) -> None:
        """Tell that an item no longer uses a mask."""
        users = self.users[variant.uid] = self.users[variant.uid] - 1
        if not users:
            del self.users[variant.uid]
            self.live -= variant.mask.size

    @property
    def wasteful(self) -> bool:
        """More than half of it, beyond some slack, is no longer in use."""
        return self.used > 2 * self.live + ATLAS_SLACK_BYTES

    def _append(self, variant: Variant) -> int:
        begin, end = self.used, self.used + variant.mask.size
        if end > len(self.flat):
            grown = np.zeros(max(end, 2 * len(self.flat)), np.bool_)
            grown[:begin] = self.flat[:begin]
            self.flat = grown  # a stack that was handed out keeps the old array
        self.flat[begin:end] = variant.mask.reshape(-1)
        self.offsets[variant.uid], self.used = begin, end
        return begin


COLUMNS: dict[str, tuple[int, ...]] = {
    "alive": (), "role": (), "layer": (), "categories": (), "owner": (), "cost": (),
    "position_256": (2,), "velocity_256": (2,), "pivot_256": (2,), "size_wh": (2,), "offset": (), "mask": (),
}  # fmt: skip

UNARRANGED = frozenset(("position_256", "velocity_256", "cost"))
"""Columns that change neither the order of the items nor what they are."""

ORDERING = frozenset(("alive", "role", "layer"))
"""Columns that change the order of the items, or which of them decide."""


class Items:
    """Columns by id; ids count up from 0 and are never used again."""

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
        self.version = 0
        self.atlas = MaskAtlas()
        self.sprites: list[Sprite] = []
        self.forms: list[Form] = []
        self.angles: list[float] = []
        self.variants: list[Variant] = []
        self.names: list[str] = []
        self.arrangement = next(ARRANGEMENTS)
        self._journal: deque[Change] = deque()
        self._in_order = False  # whether the order of the last stack still holds
        self._journal_rows = 0
        self._forgotten = 0
        self._stack: tuple[int, Stack] | None = None
        self._bounds: dict[Kind, Bounds] = {}
        self._tiles: list[TileAtlas] = []
        self._imagery: tuple[int, list[Role]] | None = None
        self._lock = threading.Lock()
        self._allot()

    def _allot(self) -> None:
        for name, shape in COLUMNS.items():
            setattr(self, name, np.zeros((16, *shape), np.int64))
        self._box = np.tile(np.array(NOWHERE), (16, 1))
        self._edge = np.zeros(
            (16, 4), np.int64
        )  # what a position lacks of the first and last pixel of the box, 1/256 px

    def add(self, sprite: Sprite, form: Form, angle: float, name: str, values: dict[str, object]) -> int:
        """Append an item; `values` are its columns."""
        item = self.count
        if item >= ITEMS_MAX:
            raise InputError(f"objects: expected at most {ITEMS_MAX} in the life of a scene, got one more")
        variant = variant_of(sprite, form)
        self._reserve(item + 1)
        self.count += 1
        self.sprites.append(sprite)
        self.forms.append(form)
        self.angles.append(angle)
        self.variants.append(variant)
        self.names.append(name)
        for column, value in values.items():
            getattr(self, column)[item] = value
        self.alive[item] = 1
        self._use([item], [variant])
        self.record(np.array([item]))
        return item

    def skip_to(self, item: int) -> None:
        """Leave ids unused, as if their items had been removed; a scene file keeps the ids of what it saved."""
        missing = item - self.count
        if missing <= 0:
            return
        self._reserve(item)
        empty = Sprite(frames=())
        blank = Variant((empty.uid, Form()), np.zeros((0, 0), np.bool_), 0, 0, 0)
        self.sprites += [empty] * missing
        self.forms += [Form()] * missing
        self.angles += [0.0] * missing
        self.variants += [blank] * missing
        self.names += [""] * missing
        self.count = item
        self.arrangement = next(ARRANGEMENTS)
        self._in_order = False

    def remove(self, ids: Ints) -> None:
        """Take items away; their ids stay unused."""
        self.alive[ids] = 0
        for item in ids.tolist():
            self.atlas.drop(self.variants[item])
        self.record(ids)

    def reform(self, ids: Sequence[int], forms: Sequence[Form]) -> None:
        """Give items another form; all masks are made, or found, before any item changes."""
        variants = [variant_of(self.sprites[item], form) for item, form in zip(ids, forms, strict=True)]
        for item, form, variant in zip(ids, forms, variants, strict=True):
            self.atlas.drop(self.variants[item])
            self.forms[item], self.variants[item] = form, variant
        self._use(ids, variants)

    def record(self, ids: Ints, columns: Iterable[str] = COLUMNS) -> None:
        """Note that items changed in some columns."""
        before, after = self._box[ids], self.deciding_boxes(ids)
        low = HALF - self.pivot_256[ids]
        self._edge[ids] = np.concatenate([low, low + SUB * (after[:, 2:] - after[:, :2])], axis=1)
        self._box[ids] = after
        if not UNARRANGED.issuperset(columns):
            self.arrangement = next(ARRANGEMENTS)
            there = (before[:, 0] <= before[:, 2]) == (after[:, 0] <= after[:, 2])
            self._in_order &= ORDERING.isdisjoint(columns) and bool(there.all())
        self._note(ids, before, after, len(ids))

    def move(self, ids: Ints, position_256: Ints) -> None:
        """Place items, each once (n,), at new positions (n, 2): their masks and their order stay."""
        before, after = self._box.take(ids, axis=0), boxes_at(position_256, self._edge.take(ids, axis=0))
        self.position_256[ids], self._box[ids] = position_256, after
        self._note(ids, before, after, len(ids))

    def move_risen(self, ids: Ints, xy: Floats) -> bool:
        """Place items of rising ids (n,) at new positions (n, 2), px, and tell whether all is well; else do nothing."""
        before, after = np.empty((2, len(ids), 4), np.int64)
        place = kernels_of(placing, len(ids) * PLACED_NS).place
        if not place(ids, xy, self.count, self.alive, self._edge, self.position_256, self._box, before, after):
            return False
        self._note(ids.copy(), before, after, len(ids))
        return True

    def move_one(self, item: int, x_256: int, y_256: int) -> bool:
        """Place one item at a new position, as `move` does, and tell whether it is in the scene; else do nothing."""
        if not (0 <= item < self.count and self.alive.item(item)):
            return False
        before = x, y, x_max, y_max = BOX.unpack_from(self._box, BOX.size * item)  # type: ignore[arg-type]
        variant = self.variants[item]
        left, top = (x_256 - variant.pivot_x + HALF) >> 8, (y_256 - variant.pivot_y + HALF) >> 8
        after = (left, top, left + x_max - x, top + y_max - y)
        PLACE.pack_into(self.position_256, PLACE.size * item, x_256, y_256)  # type: ignore[arg-type]
        BOX.pack_into(self._box, BOX.size * item, *after)  # type: ignore[arg-type]
        self._note(item, before, after, 1)
        return True

    def _note(self, ids: Ints | int, before: Ints | Box, after: Ints | Box, n: int) -> None:
        """Write n changes into the journal, as a new version."""
        self.version += 1
        self._journal.append((self.version, ids, before, after))
        self._journal_rows += n
        while self._journal_rows > JOURNAL_ROWS:
            version, old, _, _ = self._journal.popleft()
            self._journal_rows -= np.size(old)
            self._forgotten = version

    def changed_boxes(self, version: int) -> Ints | None:
        """Boxes (n, 4) where deciding items were or are, changed after a version; None if that is forgotten."""
        changes = self.changes(version)
        if changes is None:
            return None
        every = np.concatenate([NO_BOXES, *(np.reshape(box, (-1, 4)) for _, _, *both in changes for box in both)])
        return every[every[:, 0] <= every[:, 2]]

    def changed_ids(self, version: int) -> Ints | None:
        """Items changed after a version, each once, sorted; None if that is forgotten."""
        changes = self.changes(version)
        return None if changes is None else np.unique(np.concatenate([NO_IDS, *(np.ravel(c[1]) for c in changes)]))

    def knows(self, version: int) -> bool:
        """Whether all that changed after a version is still known."""
        return version >= self._forgotten

    def changes(self, version: int) -> list[Change] | None:
        """Journal after a version, the last first; None if that is forgotten."""
        if version < self._forgotten:
            return None
        found = []
        for change in reversed(self._journal):
            if change[0] <= version:
                break
            found.append(change)
        return found

    def boxes(self, ids: Ints) -> Ints:
        """Inclusive boxes (n, 4) of the masks of items; x_max < x_min where nothing is there to be met."""
        corner = pixel(self.position_256.take(ids, axis=0) - self.pivot_256.take(ids, axis=0))
        size = self.size_wh.take(ids, axis=0)
        boxes = np.concatenate([corner, corner + size - 1], axis=1)
        boxes[(self.alive[ids] == 0) | (size[:, 0] == 0)] = NOWHERE
        return boxes

    def corner(self, item: int) -> tuple[int, int]:
        """Pixel (x, y) of the top left of an item's mask."""
        x, y = pixel(self.position_256[item] - self.pivot_256[item]).tolist()
        return x, y

    def deciding_boxes(self, ids: Ints) -> Ints:
        """Like `boxes`, and nowhere for items that decide no hit: what they do, planes need not follow."""
        boxes = self.boxes(ids)
        role = self.role[ids]
        boxes[(role != HITTABLE) & (role != OCCLUDER)] = NOWHERE
        return boxes

    @property
    def has_stack(self) -> bool:
        """Whether the stack of the items as they are now is there."""
        return self._stack is not None and self._stack[0] == self.version

    def stack(self) -> Stack:
        """Items that decide, front to back: greater layer; occluders before objects; then the later added."""
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
        """The stack of the present version, which shares with the last one what did not change."""
        if last is not None and last.forms == self.arrangement:
            return last.placed(self._boxes_in_order(last.ids))
        if last is None or not self._in_order:
            return self.stack_of(*DECIDING)
        ids = last.ids
        columns = (column.take(ids) for column in (self.categories, self.owner))
        return last.reformed(
            self.arrangement, self._boxes_in_order(ids), self.offset.take(ids), self.atlas.flat, *columns
        )

    def _boxes_in_order(self, ids: Ints) -> Ints:
        """Boxes of all that decides."""
        return self._box.take(ids, axis=0)

    def stack_of(self, *roles: Role) -> Stack:
        """Items of some roles, front to back."""
        n = self.count
        wanted = np.isin(self.role[:n], [ROLES.index(role) for role in roles])
        ids = np.flatnonzero((self.alive[:n] == 1) & wanted & (self.size_wh[:n, 0] > 0))
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
            ids, occluder, self.categories[ids], self.owner[ids], self.boxes(ids), self.offset[ids], self.atlas.flat,
            layered, self.arrangement if roles == DECIDING else next(ARRANGEMENTS), n,
        )  # fmt: skip

    def imagery(self) -> list[Role]:
        """Roles of what is in the scene and decides no hit."""
        known = self._imagery
        if known is None or known[0] != self.arrangement:
            count = np.bincount(self.role[: self.count], self.alive[: self.count], len(ROLES)).tolist()
            drawn = [
                role for role in ROLES if count[ROLES.index(role)] and ROLES.index(role) not in (HITTABLE, OCCLUDER)
            ]
            known = self._imagery = self.arrangement, drawn
        return known[1]

    def tiles(self) -> Tiles:
        """Bit rows of the masks of the stack."""
        stack = self.stack()
        known = self._tiles[0].known(stack.forms) if self._tiles else None
        if known is not None:
            return known
        from planes.tiles import TileAtlas  # what nothing is fired at needs none

        if not self._tiles:
            self._tiles.append(TileAtlas())
        variants, ids = self.variants, stack.ids
        return self._tiles[0].tiles(lambda rank: variants[ids[rank]].mask, self.mask.take(ids), stack.forms)

    def bounding(self, kind: Kind, ids: Ints) -> tuple[Volumes, Ints]:
        """Volumes of masks, and the row of each item's, which has pixels: in px about its mask's pixel [0, 0]."""
        from planes.bounding import Bounds  # few scenes need them

        bounds = self._bounds.setdefault(kind, Bounds(kind))
        return bounds.rows(self.mask[ids], self.sprites, self.variants, ids, len(self.stack()))

    def volumes(self, name: str, ids: Ints) -> Volumes:
        """Volumes of items in the world, one row each; see `Scene.volumes`."""
        from planes.bounding import KINDS, Kind, shifted
        from planes.volumes import Aabbs, Circles

        k = boxes_in("kind", name)
        choice("kind", name if k is None else "4 boxes", ("box", "circle", "oriented box", "4 boxes", "polygon"))
        for item in ids[self.size_wh[ids, 0] == 0].tolist():
            raise InputError(f"ids: expected objects with a pixel, got {item}, whose mask is empty")
        if name == "box":
            low, high = np.split(self.boxes(ids).astype(np.float64), 2, axis=1)
            return Aabbs(low - 0.5, high + 0.5)
        if not len(ids):
            return Circles(np.zeros((0, 2)), 0.0)
        volumes, row = self.bounding(Kind(name) if k is None else Kind(KINDS[2], k), ids)
        return shifted(volumes.take(row), pixel(self.position_256[ids] - self.pivot_256[ids]))

    def _use(self, ids: Sequence[int], variants: Sequence[Variant]) -> None:
        """Let the columns of items tell of their masks."""
        take = self.atlas.take
        told = [(take(one), one.uid, one.pivot_x, one.pivot_y, *one.mask.shape[::-1]) for one in variants]
        columns = np.array(told, np.int64).reshape(-1, 6)
        self.offset[ids], self.mask[ids] = columns[:, 0], columns[:, 1]
        self.pivot_256[ids], self.size_wh[ids] = columns[:, 2:4], columns[:, 4:]

    def _compact(self) -> None:
        """Lay the masks in use out anew, without the others."""
        atlas, offset = MaskAtlas(), self.offset.copy()
        for item in np.flatnonzero(self.alive[: self.count]).tolist():
            offset[item] = atlas.take(self.variants[item])
        self.atlas, self.offset = atlas, offset

    def _reserve(self, count: int) -> None:
        size = len(self.alive)
        if count <= size:
            return
        more = max(count - size, size)
        self._box = np.concatenate([self._box, np.tile(np.array(NOWHERE), (more, 1))])
        self._edge = np.concatenate([self._edge, np.zeros((more, 4), np.int64)])
        for name in COLUMNS:
            old: npt.NDArray[np.int64] = getattr(self, name)
            grown = np.zeros((size + more, *old.shape[1:]), np.int64)
            grown[:size] = old
            setattr(self, name, grown)
