"""What decides hits, front to back, as columns: a view of one version of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planes.arrays import Bools, Floats, Ints
from planes.spans import Box

__all__ = ["Stack", "clipped"]


@dataclass(frozen=True, eq=False)
class Stack:
    """The items that decide hits, front to back, as columns; a view of one version of a scene.

    Parameters
    ----------
    ids, categories, owner : (M,) int64
    occluder : (M,) bool
    box_xyxy : (M, 4) int64, inclusive, px
    offset : (M,) where the item's mask begins in `masks`, row by row
    masks : flat booleans of all masks in use
    layered : whether the items lie on more layers than one
    forms : a number of what the items are and of their order: stacks that have the same number differ only in boxes
    count : of the ids of the scene, with those that are not in the stack
    """

    ids: Ints
    occluder: Bools
    categories: Ints
    owner: Ints
    box_xyxy: Ints
    offset: Ints
    masks: Bools
    layered: bool
    forms: int
    count: int

    def placed(self, box_xyxy: Ints) -> Stack:
        """The same items in the same order at other places; this one keeps its own, and both share the rest."""
        return self._with(("sizes",), box_xyxy=box_xyxy)

    def reformed(self, forms: int, box_xyxy: Ints, offset: Ints, masks: Bools, categories: Ints, owner: Ints) -> Stack:
        """The same ids in the same order, of other masks, categories or owners."""
        return self._with(
            ("sizes", "width", "has_unmet"), forms=forms, box_xyxy=box_xyxy, offset=offset, masks=masks,
            categories=categories, owner=owner,
        )  # fmt: skip

    def _with(self, stale: tuple[str, ...], **columns: object) -> Stack:
        """A stack of some other columns, that shares the rest and what was worked out of it, but for what is stale."""
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
        """Bytes of the columns; the masks are those of the scene."""
        columns = (self.ids, self.occluder, self.categories, self.owner, self.box_xyxy, self.offset)
        return sum(column.nbytes for column in columns)

    @cached_property
    def rank_of(self) -> Ints:
        """Place in the stack of each id of the scene (count,), 0 in front; -1 of what is not in it."""
        ranks = np.full(self.count, -1)
        ranks[self.ids] = np.arange(len(self.ids))
        ranks.flags.writeable = False
        return ranks

    @cached_property
    def rank_by_code(self) -> Ints:
        """Place in the stack of the front item of a code plane, by its id + 1; 0 where there is none."""
        ranks = np.zeros(int(self.ids.max(initial=-1)) + 2, np.int64)
        ranks[self.ids + 1] = np.arange(len(self.ids))
        ranks.flags.writeable = False
        return ranks

    @cached_property
    def is_object(self) -> Bools:
        """Whether an id + 1 (count + 1,), as code planes have it, is of an item that can be hit; 0 is of none."""
        objects = np.zeros(self.count + 1, np.bool_)
        objects[self.ids[~self.occluder] + 1] = True
        objects.flags.writeable = False
        return objects

    @cached_property
    def has_occluders(self) -> bool:
        """Whether any item is an occluder."""
        return bool(self.occluder.any())

    @cached_property
    def has_unmet(self) -> bool:
        """Whether any item is of no category, so that every shot refuses it."""
        return not self.categories.all()

    @cached_property
    def width(self) -> Ints:
        """Pixels in a row of each mask."""
        return self.box_xyxy[:, 2] - self.box_xyxy[:, 0] + 1

    @cached_property
    def sizes(self) -> tuple[Floats, Floats]:
        """Mean width and height of the items, and width and height of the box around all of them, px."""
        x, y, x_max, y_max = np.ascontiguousarray(self.box_xyxy.T)
        mean = np.array([(x_max - x).mean(), (y_max - y).mean()]) + 1
        return mean, np.array([x_max.max() - x.min(), y_max.max() - y.min()], np.float64) + 1

    def mask(self, rank: int) -> Bools:
        """Mask (h, w) of the item of a rank, 0 in front."""
        x, y, x_max, y_max = self.box_xyxy[rank].tolist()
        size = (x_max - x + 1) * (y_max - y + 1)
        return self.masks[self.offset[rank] : self.offset[rank] + size].reshape(y_max - y + 1, x_max - x + 1)


def clipped(boxes_xyxy: Ints, box_xyxy: Box) -> Ints:
    """Cut inclusive boxes (n, 4) to a box; what lies outside of it ends before it begins."""
    low, high = np.maximum(boxes_xyxy[:, :2], box_xyxy[:2]), np.minimum(boxes_xyxy[:, 2:], box_xyxy[2:])
    return np.concatenate([low, high], axis=1)
