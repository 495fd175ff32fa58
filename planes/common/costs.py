"""Times of all ways to answer shots, by which the cheapest is chosen; the only numbers that were tuned by timing.

`python tests/bench/calibrate.py` measures them on a machine and writes them here. The choice depends on their ratios
only, and changes no row.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from .backend import jit_is_on


class Costs(NamedTuple):
    """Times, ns. A call is one of `fire`; made is what is kept for later calls."""

    tiles_call: float  # by the tiles of the stack, front to back
    tiles_placement: float
    tiles_pair: float  # a placement and a tile
    tiles_near: float  # a placement and a tile near it
    visible_call: float  # by the visible set
    visible_placement: float
    visible_near: float  # a placement and a tile of the stack near it
    visible_made: float
    visible_tile: float  # made: each tile
    labels_call: float  # by the label plane
    labels_item: float  # made: each item
    labels_pixel: float  # made: each pixel
    labels_box: float  # made: each box of an item that changed, in a plane that was drawn before
    integers_call: float  # counted in integers, which have no compiled form
    integers_placement: float
    integers_pair: float  # a placement and a tile near it
    integers_bit: float  # each bit of the pattern's rows, for each such pair
    box_pair: float  # a box compared with another
    bvh_call: float
    bvh_placement: float
    bvh_moved: float  # made: each item that moved
    bvh_item: float  # made: each item
    cast_call: float  # by casting rays at items
    cast_ray: float
    cast_pair: float  # a ray and an item
    march_call: float  # by marching rays through the distance field
    march_ray: float
    field_pixel: float  # made: each pixel of a distance field
    prepared_march: float  # a prepared ray that marches
    prepared_cast: float  # a prepared ray that is cast
    prepared_cast_item: float
    prepared_tile: float  # a tile of the stack and a prepared shot; by compiled kernels alone
    prepared_near: float  # a tile whose box meets that of a prepared shot
    thread: float  # the least work that is given to a thread of its own


NUMPY = Costs(
    tiles_call=146000, tiles_placement=57.6, tiles_pair=0.137, tiles_near=548,
    visible_call=137000, visible_placement=107, visible_near=35.2, visible_made=81900, visible_tile=1240,
    labels_call=68400, labels_item=5840, labels_pixel=0.0442, labels_box=16800,
    integers_call=84400, integers_placement=232, integers_pair=1980, integers_bit=0.0756,
    box_pair=0.585, bvh_call=63700, bvh_placement=297, bvh_moved=887, bvh_item=433,
    cast_call=203000, cast_ray=602, cast_pair=11.7,
    march_call=173000, march_ray=321, field_pixel=4.06,
    prepared_march=7080, prepared_cast=35000, prepared_cast_item=32.2,
    prepared_tile=inf, prepared_near=inf, thread=inf,
)  # fmt: skip
COMPILED = Costs(
    tiles_call=54600, tiles_placement=41.1, tiles_pair=0.0151, tiles_near=45.6,
    visible_call=56200, visible_placement=40.4, visible_near=7.95, visible_made=73900, visible_tile=1290,
    labels_call=37700, labels_item=333, labels_pixel=0.0426, labels_box=4960,
    integers_call=inf, integers_placement=inf, integers_pair=inf, integers_bit=inf,
    box_pair=0.572, bvh_call=62900, bvh_placement=314, bvh_moved=847, bvh_item=442,
    cast_call=98600, cast_ray=142, cast_pair=0.877,
    march_call=118000, march_ray=110, field_pixel=1.25,
    prepared_march=7220, prepared_cast=3290, prepared_cast_item=1.9,
    prepared_tile=1.17, prepared_near=378, thread=997000,
)  # fmt: skip
"""Times in numpy, and with compiled kernels."""


def costs() -> Costs:
    """Times in the form that runs now."""
    return COMPILED if jit_is_on() else NUMPY
