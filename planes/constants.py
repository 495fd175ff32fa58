"""Limits and units: each with its value, its unit and its reason."""

SUB = 256
"""Positions are integers in 1/256 px: fine enough for sub-pixel aim, coarse enough for exact int64 products."""

HALF = SUB // 2
"""Half a pixel in 1/256 px: the closed square of pixel k is [256 k - 128, 256 k + 128]."""

TRIG_BITS = 30
"""Directions are (cos, sin) times 2**30: times a reach of 2**28 units that is 2**58, inside int64."""

SCALE_BITS = 16
"""Scales are integers in 1/65536: half a pixel over the longest mask side (2**15)."""

POSITION_MAX = 2**40
"""Largest position, px: 256 times it (2**48) is exact in float64 and leaves room for sums in int64."""

REACH_MAX = 2**20
"""Farthest a pattern reaches from its origin, px: differences are below 2**29 units, cross products below 2**58."""

SCALE_MIN = 1 / 256
SCALE_MAX = 256
"""Scale of a sprite: with 2**15 px of side the numerators of the inverse mapping stay below 2**62."""

MASK_SIDE_MAX = 2**15
"""Longest side of a mask, px."""

MASK_AREA_MAX = 2**26
"""Largest area of a mask or an image, px (64 Mpx: a 256 MB picture)."""

FRAMES_MAX = 2**16
"""Frames of one sprite: beyond it a sheet was cut by the wrong size, and each frame takes about 1 KB."""

TEXT_BYTES_MAX = 2**28
"""Longest JSON file, bytes: it takes some ten times as much in memory."""

PLANE_SIDE_MAX = 65_535
"""Longest side of a plane, px."""

PLANE_AREA_MAX = 2**28
"""Largest area of one whole plane, px (1 GiB of uint32 codes). Larger worlds are answered without planes."""

ITEMS_MAX = 2**22
"""Objects that a scene may ever have had: ids are not used again, and each takes about 100 bytes."""

ITEMS_UINT16 = 32_767
"""Item numbers that fit a uint16 code plane, whose lowest bit says "more behind"."""

COST_MAX = 255
"""Largest cost of a px of an object to a bullet: times the length of a ray it leaves room in int64."""

LAYER_MAX = 2**31 - 1
"""Largest layer, either way: it fits 32 bits."""

CATEGORY_BITS = 32
"""Categories are bits of one unsigned 32-bit number."""

ALL = 2**CATEGORY_BITS - 1
"""Every category."""

ALPHA_THRESHOLD = 127
"""A pixel of an image belongs to its mask when alpha is greater: more opaque than not."""

WEIGHT_FULL = 65_535
"""The weight of a sample at full strength; falloff lowers it to 0 at the end of the reach."""

SEED_MAX = 2**64 - 1
"""Largest seed."""

PELLETS_MAX = 65_536
"""Pellets of one shot, over all its rounds: beyond it a loop was forgotten."""

STEPS_MAX = 65_536
"""Tests of a projectile in one frame: beyond it sweeping was forgotten."""

DETAIL_SAMPLES_MAX = 2**25
"""Samples of a shot that are told one by one: each takes about 160 bytes on the way."""

NEAR_PX = 32
"""How far from the pattern `why_not` looks for objects, px."""

VIEW_MAX = 2048
"""A longer side of the world is not shown whole: a picture's view is then what the shots reach, px."""

MARGIN_PX = 8
"""How far `margins` shifts a shot to look for a flip, px."""

FRAGILE_PX = 1
"""A verdict that a shift of this length turns over is fragile, px."""

VARIANT_CACHE_BYTES = 64 * 2**20
"""Turned and scaled masks kept for the next who asks, bytes."""

VARIANT_BYTES = 1536
"""What a kept mask costs beside its pixels, bytes."""

PATTERN_CACHE_BYTES = 64 * 2**20
"""Patterns kept for the next shot of the same aim, bytes."""

ATLAS_SLACK_BYTES = 2**20
"""Masks no longer in use that an atlas tolerates beside half of its size, bytes."""

CHUNK_SAMPLES = 2**18
"""Samples worked on at a time: about the level-2 cache with their indices. With CHUNK_PAIRS it keeps numbers of rows
(placement * rows, group * rows) below 2**62."""

CHUNK_PAIRS = 2**21
"""(placement, item) box tests made at a time: 2 MB of booleans."""

CHUNK_CELLS = 2**19
"""Cells of rays on items that are worked on at a time, about: each takes some 150 bytes on the way."""

BOXES_MAX = 64
"""Boxes that one mask may be covered by: with more, the mask itself is tested sooner."""

OUTLINE_PIXELS = 2**18
OUTLINE_CORNERS = 4096
"""Blocks and corners of an outline before it is made simpler: each corner looks at all the others."""

GROWN_PX = 0.5**0.5 + 1 / 256
"""A turned or scaled frame's volume grows by half a pixel's diagonal, and what rounding may take."""

TRIG_ERROR = 2.0**-29
"""Relative length that a turn by a sine and cosine of 30 bits may gain or lose."""

SHARP = 2.0**-6
"""1 + cos of the turn at a corner: with less, at an angle below 10 degrees, growing would move it 11 times as far."""

PLACE = 2.0**-16
"""Corners of bounding volumes are multiples of it, px: far below 1/256, and whole shifts are exact."""

CORNERS = 8
"""Most corners of a polygon that goes before the pixels: with more, each pair costs more than it saves."""

PAIRS_AT_ONCE = 2**14
"""Pairs of volumes compared at a time: a megabyte or two with their corners."""

BOUNDING_CACHE_BYTES = 32 * 2**20
"""Bounding volumes of masks kept for the next who asks, bytes."""

BOUNDING_BYTES = 1024
"""What a kept volume costs beside its corners, bytes."""

INDEX_SLACK = 4096
"""Boxes that came and went which an index tolerates beside half of its own, before it is built anew."""

BOUNDS_SLACK = 256
"""Volumes of masks no longer in use that a scene keeps, beside as many as it has items."""

JOURNAL_ROWS = 2**16
"""Changes that a scene remembers; a plane that lags behind by more is drawn anew."""

HISTORY_TICKS_MAX = 2**16
"""Ticks that a history holds at most: 18 minutes of 60 a second; beyond it a scene is better saved."""

TICK_MAX = 2**45
"""Largest tick, either way: a float64 holds it to 1/256."""

ROUNDING = 2.0**-53
"""Largest relative error of one float64 operation."""

ORIENT2D_ERROR = 3.3307e-16
ORIENT3D_ERROR = 7.7716e-16
"""Relative error of the determinants, of the sum of their terms' magnitudes: Shewchuk (1997), table 1."""

SIDE_ERROR = 64 * ROUNDING
"""Of a side of an edge, of the square of the reach of both hulls: 48 roundings, of products of two differences."""

DISTANCE_ERROR = 128 * ROUNDING
"""Of a distance to an edge, of that reach: 3 roundings of corners, and 32 of differences of up to twice the reach. What
is left covers the roundings of squares: a radius that is near the distance is below 3 times the reach."""

FLOAT_TINY = 1e-290
"""Below it a value of a float filter may have lost digits to underflow, far above the least float."""

FLOAT_HUGE = 1e300
"""Beyond it a value of a float filter may have overflowed on the way."""

BOUND_HUGE = 1e280
"""A float filter with a smaller bound has not overflowed; or it was a distance, which then is far beyond its bound."""

LENGTH_TINY = 1e-140
"""A length whose square underflows is shorter than this."""

CHUNK_ROWS = 32_768
"""Rows of a float filter worked on at a time: 256 KB for each of its arrays; with fewer the calls cost more."""
OVERSIZED_CELLS = 64
"""A box over more cells of a grid is kept in a list beside it: one huge box among tiny ones would fill memory."""

GRID_FRESH = 512
"""Cell entries that a grid keeps apart before it sorts them in with all others (or a 16th of those, if more)."""

QUADTREE_CAPACITY = 16
"""Boxes that a leaf of a quadtree holds before it splits: to test so many costs about as much as to go a level down."""

QUADTREE_DEPTH = 16
"""Levels of a quadtree: cells down to 2**-16 of the world; each pile of boxes in one spot costs four nodes a level."""

BVH_LEAF = 8
"""Most boxes in a leaf of a new BVH: at 4 to 8 a query tests about as many boxes as nodes."""

BVH_SMALL = 64
"""Boxes that are not worth a tree of their own when others come after them."""
