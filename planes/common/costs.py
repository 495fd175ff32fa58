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
    tiles_call=144000, tiles_placement=55.1, tiles_pair=0.121, tiles_near=533,
    visible_call=134000, visible_placement=103, visible_near=34.8, visible_made=79800, visible_tile=1380,
    labels_call=67400, labels_item=5960, labels_pixel=0.0461, labels_box=16500,
    integers_call=83900, integers_placement=175, integers_pair=2000, integers_bit=0.0845,
    box_pair=0.577, bvh_call=62900, bvh_placement=295, bvh_moved=882, bvh_item=413,
    cast_call=198000, cast_ray=609, cast_pair=11.8,
    march_call=171000, march_ray=327, field_pixel=4.01,
    prepared_march=7000, prepared_cast=34900, prepared_cast_item=32,
    prepared_tile=inf, prepared_near=inf, thread=inf,
)  # fmt: skip
COMPILED = Costs(
    tiles_call=52400, tiles_placement=39.7, tiles_pair=0.0174, tiles_near=43.2,
    visible_call=55100, visible_placement=39.4, visible_near=7.5, visible_made=79000, visible_tile=1400,
    labels_call=37700, labels_item=368, labels_pixel=0.0459, labels_box=4920,
    integers_call=inf, integers_placement=inf, integers_pair=inf, integers_bit=inf,
    box_pair=0.587, bvh_call=64000, bvh_placement=302, bvh_moved=881, bvh_item=423,
    cast_call=98900, cast_ray=131, cast_pair=0.859,
    march_call=116000, march_ray=78.9, field_pixel=1.16,
    prepared_march=2890, prepared_cast=3130, prepared_cast_item=1.83,
    prepared_tile=1.25, prepared_near=325, thread=756000,
)  # fmt: skip
"""Times in numpy, and with compiled kernels."""


def costs() -> Costs:
    """Times in the form that runs now."""
    return COMPILED if jit_is_on() else NUMPY
