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
    visible_call: float  # by the visible set
    visible_placement: float
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
    tiles_call=210000, tiles_placement=103, tiles_pair=3.79,
    visible_call=218000, visible_placement=148, visible_made=172000, visible_tile=2200,
    labels_call=82500, labels_item=8820, labels_pixel=0.0799, labels_box=18400,
    integers_call=118000, integers_placement=323, integers_pair=2490, integers_bit=0.113,
    box_pair=0.765, bvh_call=91300, bvh_placement=564, bvh_moved=1480, bvh_item=766,
    cast_call=645000, cast_ray=724, cast_pair=14.2,
    march_call=263000, march_ray=471, field_pixel=5.35,
    prepared_march=9360, prepared_cast=43800, prepared_cast_item=51.3,
    prepared_tile=inf, prepared_near=inf, thread=inf,
)  # fmt: skip
COMPILED = Costs(
    tiles_call=120000, tiles_placement=121, tiles_pair=0.376,
    visible_call=78800, visible_placement=46.8, visible_made=126000, visible_tile=1160,
    labels_call=33900, labels_item=532, labels_pixel=0.0741, labels_box=1480,
    integers_call=inf, integers_placement=inf, integers_pair=inf, integers_bit=inf,
    box_pair=0.354, bvh_call=87200, bvh_placement=548, bvh_moved=1320, bvh_item=767,
    cast_call=146000, cast_ray=255, cast_pair=1.26,
    march_call=172000, march_ray=122, field_pixel=1.57,
    prepared_march=9490, prepared_cast=5030, prepared_cast_item=2.69,
    prepared_tile=1.33, prepared_near=302, thread=836000,
)  # fmt: skip
"""Times in numpy, and with compiled kernels."""


def costs() -> Costs:
    """Times in the form that runs now."""
    return COMPILED if jit_is_on() else NUMPY
