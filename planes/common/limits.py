"""Limits and units, each with its value, unit and reason."""

from __future__ import annotations

import numpy as np

SUB = 256  # positions are integers in 1/256 px: fine enough for sub-pixel aim, coarse enough for exact int64 products
HALF = SUB // 2  # half a pixel in 1/256 px: the closed square of pixel k is [256 k - 128, 256 k + 128]

TRIG_BITS = 30
"""Directions are (cos, sin) times 2**30: multiplied by a reach of 2**28 units they stay below 2**58, inside int64."""

SCALE_BITS = 16  # scales are integers in 1/65536: half a pixel over the longest mask side (2**15)
POSITION_MAX = 2**40  # largest position, px: 256 times it (2**48) is exact in float64 and leaves room for sums in int64

REACH_MAX = 2**20
"""Farthest a pattern reaches from its origin, px: differences are below 2**29 units, cross products below 2**58."""

SCALE_MIN = 1 / 256  # smallest scale of a sprite: the inverse of SCALE_MAX
SCALE_MAX = 256  # largest scale of a sprite: for sides of 2**15 px the numerators of inverse mapping stay below 2**62
MASK_SIDE_MAX = 2**15  # longest side of a mask, px
MASK_AREA_MAX = 2**26  # largest area of a mask or an image, px (64 Mpx: a 256 MB picture)
FRAMES_MAX = 2**16  # most frames of one sprite: a sheet with more was cut by the wrong size; a frame takes about 1 KB
TEXT_BYTES_MAX = 2**28  # longest JSON file, bytes: in memory it takes about ten times as much
PLANE_SIDE_MAX = 65_535  # longest side of a plane, px
PLANE_AREA_MAX = 2**28  # largest area of a whole plane, px (1 GiB of labels); larger worlds are answered without planes

ITEMS_MAX = 2**22  # most objects of a scene at a time: each takes about 300 bytes of columns and name
IDS_MAX = 2**28  # most ids in the life of a scene, which are never used again: their rows take 1 GiB
ITEMS_UINT16 = 32_767  # most rows of items that fit a uint16 label plane, whose lowest bit says "more behind"
COST_MAX = 255  # largest cost of a px of an object to a bullet: multiplied by the length of a ray it stays inside int64
LAYER_MAX = 2**31 - 1  # largest layer, positive or negative: it fits 32 bits
CATEGORY_BITS = 32  # categories are bits of one unsigned 32-bit number
ALL: int = 2**CATEGORY_BITS - 1  # every category
EVERYTHING = -1  # filter of shots that meet all items: every category of what may be hit, and of what blocks
ALPHA_THRESHOLD = 127  # a pixel of an image is in its mask if its alpha is greater: more opaque than transparent
ANGLE_STEPS_MAX = 65_536  # most steps of `angle_step` in a turn
WEIGHT_FULL = 65_535  # the weight of a sample at full strength; falloff lowers it to 0 at the end of the reach
SEED_MAX = 2**64 - 1  # largest seed
PELLETS_MAX = 65_536  # most pellets of one shot over all its rounds: more is surely a mistake in the weapon
STEPS_MAX = 65_536  # most tests of a projectile in one frame: with more, a swept test is meant
DETAIL_SAMPLES_MAX = 2**25  # most samples of a shot that are listed one by one: each takes about 160 bytes of memory
NEAR_PX = 32  # how far from the pattern `why_not` looks for objects, px
VIEW_MAX = 2048  # longest side of a world that a picture shows whole, px: of a larger one it shows what the shots reach
MARGIN_PX = 8  # how far `margins` shifts a shot to look for a flip, px
FRAGILE_PX = 1  # a verdict is fragile if a shift of this length changes it, px
VARIANT_CACHE_BYTES = 64 * 2**20  # size of the cache of turned and scaled masks, bytes

MAPPED_PIXELS = 2**16
"""Pixels of turned and scaled masks that are made at a time: their numbers stay in the cache of the processor."""

VARIANT_BYTES = 1536  # overhead of a cached mask beside its pixels, bytes
PATTERN_CACHE_BYTES = 64 * 2**20  # size of the cache of patterns by aim, bytes
ATLAS_SLACK_BYTES = 2**20  # unused masks that an atlas tolerates beyond half of its size, bytes

CHUNK_SAMPLES = 2**18
"""Samples worked on at a time: with their indices they about fill the level-2 cache. With CHUNK_PAIRS this keeps row
numbers (placement * rows, group * rows) below 2**62."""

CHUNK_PAIRS = 2**21  # (placement, item) box tests made at a time: 2 MB of booleans
CHUNK_CELLS = (
    2**19
)  # cells of rays on items, or stretches of rows behind them, worked on at a time: some 150 bytes each
BOXES_MAX = 64  # most boxes of a box cover of one mask: with more, testing the mask itself is faster
OUTLINE_PIXELS = 2**18  # most blocks of an outline; a larger mask is traced in coarser blocks
OUTLINE_CORNERS = 4096  # most corners of an outline before it is simplified: each corner is compared with all others

GROWN_PX = 0.5**0.5 + 1 / 256
"""Growth of the volume of a turned or scaled frame, px: half a pixel's diagonal, and a margin for rounding."""

TRIG_ERROR = 2.0**-29  # largest relative change of length by a turn whose sine and cosine have 30 bits
SHARP = 2.0**-6  # least 1 + cos of the turn at a corner: at one below 10 degrees, growing would move it 11 times as far

PLACE = 2.0**-16
"""Grid of the corners of bounding volumes and the centres of circles, px: far below 1/256, and a shift by whole pixels
is exact up to 2**36 px from the origin."""

CORNERS = 8  # most corners of a polygon that is tested before the pixels: with more, each pair costs more than it saves
PAIRS_AT_ONCE = 2**14  # pairs of volumes compared at a time: a megabyte or two with their corners
BOUNDING_CACHE_BYTES = 32 * 2**20  # size of the cache of bounding volumes of masks, bytes
BOUNDING_BYTES = 1024  # overhead of a cached volume beside its corners, bytes
INDEX_SLACK = 4096  # removed boxes that an index tolerates beyond half of its own, before it is rebuilt
BOUNDS_SLACK = 256  # volumes of unused masks that a scene keeps, in addition to one per item
JOURNAL_ROWS = 2**16  # most changes in the journal of a scene; a plane that lags behind by more is drawn anew
JOURNAL_FEW = 2**10  # changes that the journal holds in any scene; each takes about 500 bytes
JOURNAL_EACH = 4  # further changes that the journal holds for each object: following more costs more than building anew
HISTORY_TICKS_MAX = 2**16  # most ticks of a history: 18 minutes at 60 a second; for longer times save the scene
TICK_MAX = 2**45  # largest tick, positive or negative: a float64 holds it to 1/256
ROUNDING = 2.0**-53  # largest relative error of one float64 operation
ORIENT2D_ERROR = 3.3307e-16  # of the 2-D determinant, relative to its terms' magnitudes: Shewchuk (1997), table 1
ORIENT3D_ERROR = 7.7716e-16  # of the 3-D determinant, relative to its terms' magnitudes: Shewchuk (1997), table 1

SIDE_ERROR = 64 * ROUNDING
"""Error of the side of an edge, relative to the squared reach of both hulls: 48 roundings of products of two
differences."""

DISTANCE_ERROR = 128 * ROUNDING
"""Error of a distance to an edge, relative to that reach: 3 roundings of corners, 32 of differences of up to twice the
reach. The rest covers the roundings of squares: a radius near the distance is below 3 times the reach."""

FLOAT_TINY = 1e-290  # smaller values of a float filter may have lost digits to underflow; far above the least float
FLOAT_HUGE = 1e300  # larger values of a float filter may have overflowed in between
BOUND_HUGE = 1e280  # a float filter with a smaller bound has not overflowed, but for a distance far beyond its bound
LENGTH_TINY = 1e-140  # shorter lengths may have squares that underflow
CHUNK_ROWS = 32_768  # rows of a float filter worked on at a time: 256 KB an array; with fewer rows the calls cost more
OVERSIZED_CELLS = 64  # most cells of a grid that a box may cover: a huge one would fill memory, and is kept in a list
GRID_FRESH = 512  # new cell entries that a grid keeps apart before it sorts them in (or a 16th of the others, if more)
QUADTREE_CAPACITY = 16  # most boxes in a leaf before it splits: testing so many costs about as much as a level
QUADTREE_DEPTH = 16  # most levels: cells down to 2**-16 of the world; boxes piled on one spot cost four nodes a level
BVH_LEAF = 8  # most boxes in a leaf of a new BVH: at 4 to 8 a query tests about as many boxes as nodes
BVH_SMALL = 64  # fewest boxes that get a tree of their own if more boxes follow
GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # increment of splitmix64: 2**64 over the golden ratio, rounded to an odd number

STRUCTURES = {"none": "BruteForce", "grid": "Grid", "quadtree": "Quadtree", "bvh": "Bvh"}
"""Names of broad phases, and their classes in `hitplanes.planes.broadphase`."""
