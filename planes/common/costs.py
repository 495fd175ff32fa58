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
    tiles_call=143000, tiles_placement=56.5, tiles_pair=0.132, tiles_near=531,
    visible_call=135000, visible_placement=102, visible_near=34.9, visible_made=81800, visible_tile=1200,
    labels_call=66200, labels_item=5610, labels_pixel=0.0405, labels_box=17200,
    integers_call=83700, integers_placement=220, integers_pair=1990, integers_bit=0.0859,
    box_pair=0.585, bvh_call=63300, bvh_placement=319, bvh_moved=893, bvh_item=453,
    cast_call=198000, cast_ray=608, cast_pair=12.2,
    march_call=177000, march_ray=345, field_pixel=4.09,
    prepared_march=6910, prepared_cast=34600, prepared_cast_item=30.9,
    prepared_tile=inf, prepared_near=inf, thread=inf,
)  # fmt: skip
COMPILED = Costs(
    tiles_call=52000, tiles_placement=39.5, tiles_pair=0.0188, tiles_near=41.9,
    visible_call=53500, visible_placement=38.3, visible_near=7.28, visible_made=76500, visible_tile=1220,
    labels_call=36000, labels_item=324, labels_pixel=0.0408, labels_box=5000,
    integers_call=inf, integers_placement=inf, integers_pair=inf, integers_bit=inf,
    box_pair=0.594, bvh_call=61300, bvh_placement=300, bvh_moved=847, bvh_item=413,
    cast_call=96700, cast_ray=131, cast_pair=0.791,
    march_call=113000, march_ray=75.6, field_pixel=4.09,
    prepared_march=7020, prepared_cast=3100, prepared_cast_item=1.82,
    prepared_tile=0.955, prepared_near=352, thread=953000,
)  # fmt: skip
"""Times in numpy, and with compiled kernels."""


def costs() -> Costs:
    """Times in the form that runs now."""
    return COMPILED if jit_is_on() else NUMPY
