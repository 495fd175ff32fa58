"""Intersection of closed triangles in space, and of the faces of two meshes: Moller's seven steps on exact signs.

Moller computes the intervals in which two triangles cut the common line of their planes, and compares them. Here they
are not computed: once the side of the other plane is known for each corner, the order of two ends of intervals is the
sign of one determinant of four corners. All signs are exact on the float64 inputs, so there are no tolerances. A
triangle may be a segment or a point.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt

from ..broadphase import Bvh
from ..common.checks import Bools, Floats, InputError, Ints, array_of, flag, integers, kind_of, reals
from ..common.limits import CHUNK_SAMPLES, FLOAT_HUGE, FLOAT_TINY, ORIENT3D_ERROR
from ..volumes.exact import chunked, orient2d, orient3d
from ..volumes.overlap import overlap
from ..volumes.volumes import Polygons

Corners = Floats  # triangles of n rows, as columns (3, 3, n): corner, axis, row
Sides = Ints  # sides of a plane on which three corners lie, as one number (n,) for their signs: 9 s0 + 3 s1 + s2 + 13

SIDES = [(s0, s1, s2) for s0, s1, s2 in product((-1, 0, 1), repeat=3)]
IN_PLANE = SIDES.index((0, 0, 0))
KEPT = ((1, 2), (2, 0), (0, 1))  # axes that remain if x, y or z is dropped, in the order that keeps the turning sense


def triangles_meet(a: npt.ArrayLike, b: npt.ArrayLike, conservative: bool = False) -> Bools:
    """Test triangles in space for a common point; touching counts.

    Parameters
    ----------
    a, b : (..., 3, 3) float, finite: three corners (x, y, z), which may be equal, or on one line; leading axes
        broadcast
    conservative : skip the exact stage; rows that floats cannot decide are True

    Returns
    -------
    (...) bool

    Raises
    ------
    InputError
        If a or b is not finite or not of this shape, or their leading axes do not broadcast.

    References
    ----------
    Moller, *A Fast Triangle-Triangle Intersection Test* (1997); the order of ends by determinants: Guigue and
    Devillers, *Fast and Robust Triangle-Triangle Overlap Test Using Orientation Predicates* (2003).
    """
    first, second = _triangles("a", a), _triangles("b", b)
    quick = flag("conservative", conservative)
    try:
        np.broadcast_shapes(first.shape, second.shape)
    except ValueError:
        raise InputError(f"b: expected axes that broadcast with {first.shape}, got {second.shape}") from None
    columns = [p[..., i, k] for p in (first, second) for i, k in product(range(3), repeat=2)]
    chunks = chunked(columns, np.bool_)
    with chunks, np.errstate(all="ignore"):
        for *rows, found in chunks:
            pair = np.stack(rows).reshape(2, 3, 3, len(found))
            found[...] = _meet(pair[0], pair[1], quick)
        return np.asarray(chunks.operands[-1])


class Mesh:
    """A triangle mesh with a tree of the boxes of its faces, which is built when first used.

    Parameters
    ----------
    points : (V, 3) float, finite: x, y, z
    faces : (F, 3) indices of points; indices of a face may be equal

    Raises
    ------
    InputError
        If a point is not finite, or an index is out of range.
    """

    def __init__(self, points: npt.ArrayLike, faces: npt.ArrayLike) -> None:
        self.points = reals("points", points, (None, 3))
        self.faces = integers("faces", faces, (None, 3), 0, len(self.points) - 1)
        self.points.flags.writeable = self.faces.flags.writeable = False

    def __len__(self) -> int:
        return len(self.faces)

    @cached_property
    def corners(self) -> Floats:
        """Corners of the faces, (F, 3, 3)."""
        return np.asarray(self.points[self.faces])

    @cached_property
    def boxes(self) -> Floats:
        """Boxes of the faces, (F, 6): least x, y, z, then greatest."""
        return np.concatenate((self.corners.min(axis=1), self.corners.max(axis=1)), axis=1)

    @cached_property
    def tree(self) -> Bvh:
        """Hierarchy of the boxes of the faces."""
        return Bvh(self.boxes)


def meeting_faces(a: Mesh, b: Mesh, conservative: bool = False) -> Ints:
    """Find the pairs of faces of two meshes that share a point, first by the tree of boxes, then by `triangles_meet`.

    Parameters
    ----------
    a, b : meshes; the tree of b is searched
    conservative : as in `triangles_meet`

    Returns
    -------
    (2, K) int64 [face of a, face of b], sorted

    Raises
    ------
    InputError
        If an argument is not a mesh.
    """
    for name, mesh in (("a", a), ("b", b)):
        if not isinstance(mesh, Mesh):
            raise InputError(f"{name}: expected a mesh, got {kind_of(mesh)}")
    pairs = b.tree.query(a.boxes)
    chunks = [pairs[:, k : k + CHUNK_SAMPLES] for k in range(0, pairs.shape[1], CHUNK_SAMPLES)]
    touching = [triangles_meet(a.corners[i], b.corners[j], conservative) for i, j in chunks]
    return pairs[:, np.concatenate(touching)] if touching else pairs


def _triangles(field: str, values: npt.ArrayLike) -> Floats:
    """Check triangles; finite float64 arrays are not copied."""
    array = array_of(field, values)
    if array.shape[-2:] != (3, 3):
        raise InputError(f"{field}: expected shape (..., 3, 3), got {array.shape}")
    if array.dtype == np.float64 and np.isfinite((array.min(initial=0), array.max(initial=0))).all():
        return array
    return reals(field, values, (*(None,) * (array.ndim - 2), 3, 3))


def _meet(a: Corners, b: Corners, conservative: bool) -> Bools:
    """Take one chunk through the seven steps; a decided row leaves the chunk."""
    found = np.zeros(a.shape[-1], np.bool_)
    bound = _bound(a, b)
    # 1. The plane of the second; 2. no, where all corners of the first lie strictly on one side of it.
    first = _sides(b, a, bound, conservative)
    keep = ~_APART[first]
    same = np.flatnonzero(_TOUCHED[first])
    same = same[(a.take(same, axis=2)[:, None] == b.take(same, axis=2)).all(axis=2).any(axis=(0, 1))]  # share a corner
    found[same], keep[same] = True, False
    left = np.flatnonzero(keep)
    a, b, first = a.take(left, axis=2), b.take(left, axis=2), first[left]
    # 3. The plane of the first; 4. no, where all corners of the second lie strictly on one side of it.
    second = _sides(a, b, bound, conservative)
    keep = ~_APART[second]
    # Coplanar and degenerate triangles are a special case; without the exact stage, so is any corner in a plane.
    odd = _TOUCHED if conservative else _WITHIN
    special = keep & (odd[first] | odd[second])
    if special.any():
        odd_rows = np.flatnonzero(special)
        rows = a.take(odd_rows, axis=2), b.take(odd_rows, axis=2), first[odd_rows], second[odd_rows]
        found[left[odd_rows]] = _special(*rows, conservative)
        keep &= ~special
    # 5. The line of both planes; 6. the interval of each triangle on it; 7. yes, where they overlap.
    rest = np.flatnonzero(keep)
    found[left[rest]] = _intervals_meet(a, b, rest, len(SIDES) * first[rest] + second[rest], conservative)
    return found


def _bound(a: Corners, b: Corners) -> float:
    """Bound of the errors of determinants, as in orient3d, from the largest difference of coordinates on one axis."""
    reach = 0.0
    for axis in range(3):
        low = min(p[:, axis].min(initial=np.inf) for p in (a, b))
        high = max(p[:, axis].max(initial=-np.inf) for p in (a, b))
        reach = max(reach, float(high - low))
    return 6 * ORIENT3D_ERROR * reach * (reach * reach + FLOAT_TINY) + FLOAT_TINY


def _sides(plane: Corners, corners: Corners, bound: float, conservative: bool) -> Sides:
    """Sides of the plane of a triangle on which three corners lie.

    The determinants are those of orient3d; the normal of the plane is computed once for all three.
    """
    p, q, r = plane
    (ex, ey, ez), (fx, fy, fz) = p - r, q - r
    normal = np.stack((ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx))
    values = np.empty((3, p.shape[-1]))
    for corner, value in zip(corners, values, strict=True):
        x, y, z = np.multiply(normal, corner - r)
        np.add(np.add(x, y, out=x), z, out=value)
    signs = (values > 0).view(np.int8) - (values < 0).view(np.int8)
    size = np.abs(values, out=values)
    if not (size.min(initial=np.inf) > bound and size.max(initial=0) < FLOAT_HUGE):
        i, row = np.nonzero(~((size > bound) & (size < FLOAT_HUGE)))
        seen = _plainly_in(plane.take(row, axis=2), corners[i, :, row].T)
        signs[i[seen], row[seen]] = 0
        i, row = i[~seen], row[~seen]
        signs[i, row] = orient3d(p[:, row].T, q[:, row].T, corners[i, :, row], r[:, row].T, conservative)
    return np.asarray(9 * signs[0] + 3 * signs[1] + signs[2] + IN_PLANE, np.int64)


def _plainly_in(triangle: Corners, points: Floats) -> Bools:
    """Whether points (3, n) surely lie in the plane of a triangle: they are corners, or level with it on an axis."""
    same = triangle == points
    return np.asarray(same.all(axis=1).any(axis=0) | same.all(axis=0).any(axis=0))


def _intervals_meet(a: Corners, b: Corners, rows: Ints, way: Ints, conservative: bool) -> Bools:
    """Compare the ends of the intervals on the line of both planes; way is 27 first + second sides.

    A triangle's interval lies between its edges pq and pr, where p is the only corner on its side of the other plane.
    The order in which pq of one triangle and pq of the other cross the line is a sign of these four corners.
    """
    found = np.zeros(len(rows), np.bool_)
    (p, s), (q, t), (r, u) = (_ALONE[k].take(way, axis=1) for k in range(3))
    ends = _picked(a, p, rows), _picked(a, q, rows), _picked(b, s, rows), _picked(b, t, rows)
    left = np.flatnonzero(orient3d(*ends, conservative) >= 0)
    rows, p, r, s, u = rows[left], p[left], r[left], s[left], u[left]
    ends = _picked(a, p, rows), _picked(a, r, rows), _picked(b, s, rows), _picked(b, u, rows)
    found[left] = orient3d(*ends, conservative) <= 0
    return found


def _picked(corners: Corners, which: Ints, rows: Ints) -> Floats:
    """One corner of each row, as rows (m, 3)."""
    n = corners.shape[-1]
    place = which * (3 * n) + rows
    flat = corners.reshape(-1)
    return np.stack([flat.take(place + axis * n) for axis in range(3)]).T


def _special(a: Corners, b: Corners, first: Sides, second: Sides, conservative: bool) -> Bools:
    """Decide the rows in which a triangle lies in the other's plane, or has no area."""
    found: Bools = ((a.min(axis=0) <= b.max(axis=0)) & (b.min(axis=0) <= a.max(axis=0))).all(axis=0)  # their boxes do
    if conservative:
        return found
    one, two = (np.ascontiguousarray(p.transpose(2, 0, 1)) for p in (a, b))
    for sides, flat, other in ((first, one, two), (second, two, one)):
        through = np.flatnonzero(found & (sides != IN_PLANE))  # then the other has no area
        found[through] = _pierces(flat[through], sides[through], other[through])
    within = np.flatnonzero(found & (first == IN_PLANE) & (second == IN_PLANE))
    found[within] = _coplanar_meet(one[within], two[within])
    return found


def _pierces(segment: Floats, sides: Sides, triangle: Floats) -> Bools:
    """Whether a triangle without area, which crosses another's plane or ends there, goes through the other triangle.

    If so, all edges of the other turn the same way about it, seen from its upper end.
    """
    rows = np.arange(len(segment))
    p, q = segment[rows, _HIGHEST[sides]], segment[rows, _LOWEST[sides]]
    signs = np.stack([orient3d(p, q, triangle[:, i], triangle[:, (i + 1) % 3]) for i in range(3)])
    return np.asarray((signs >= 0).all(axis=0))


def _coplanar_meet(a: Floats, b: Floats) -> Bools:
    """The coplanar case: drop an axis that is not in the common plane, and test the hulls in 2-D.

    Two segments without a common plane are apart.
    """
    found = np.ones(len(a), np.bool_)
    axis = _axis(a)
    flat = np.flatnonzero(axis < 0)
    axis[flat] = _axis(b[flat])
    flat = flat[axis[flat] < 0]
    (p, q), (r, s) = _ends(a[flat]), _ends(b[flat])
    found[flat[orient3d(p, q, r, s) != 0]] = False
    for three in ((p, q, r), (p, r, s)):  # no corner is shared, so p is not r
        none = np.flatnonzero(axis[flat] < 0)
        axis[flat[none]] = _axis(np.stack([point[none] for point in three], axis=1))
    rows = np.flatnonzero(found)
    points = (_dropped(p[rows], axis[rows]).reshape(-1, 2) for p in (a, b))
    one, two = (Polygons.around(p, 3 * np.arange(len(rows))) for p in points)
    found[rows] = overlap(one, two)
    return found


def _axis(triangles: Floats) -> Ints:
    """Choose the axis (m,) to drop so that the triangle keeps an area; -1 for a triangle without area.

    The axis of the normal's largest component, by floats, is tried first; the exact sign of the area decides.
    """
    e, f = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    guess = np.argmax(np.abs(np.cross(e, f)), axis=1)
    axis = np.full(len(triangles), -1)
    for k in range(3):
        left = np.flatnonzero(axis < 0)
        tried = (guess[left] + k) % 3
        flat = _dropped(triangles[left], tried)
        good = orient2d(flat[:, 0], flat[:, 1], flat[:, 2]) != 0
        axis[left[good]] = tried[good]
    return axis


def _dropped(points: Floats, axis: Ints) -> Floats:
    """Points (m, k, 2) in 2-D: the coordinate of each row's axis is dropped, for axis -1 that of z."""
    return np.take_along_axis(points, np.array(KEPT)[axis][:, None], axis=2)


def _ends(segments: Floats) -> tuple[Floats, Floats]:
    """Two ends of three points on a line, which are the first and last of them in lexicographic order."""
    order = np.lexsort(segments.transpose(2, 0, 1)[::-1], axis=-1)
    rows = np.arange(len(segments))
    return segments[rows, order[:, 0]], segments[rows, order[:, 2]]


def _alone(sides: tuple[int, ...]) -> tuple[int, bool]:
    """The corner that is alone on its side of a plane, and whether that side is the upper one.

    Corners in the plane count as on the other side; a corner in the plane is alone if both others are on one side. Both
    edges from the lone corner cross the plane, or end in it, in one point each.
    """
    for sign in (1, -1):
        if sides.count(sign) == 1 and sides.count(-sign) + sides.count(0) == 2:
            return sides.index(sign), sign > 0
    return (sides.index(0), sides.count(-1) == 2) if sides.count(0) == 1 else (0, True)


def _corners_of_ends() -> Ints:
    """Corners p, q, r of both triangles (3, 2, 27 * 27), chosen so that the intervals have one direction.

    If the lone corner of one triangle lies below the plane of the other, q and r of the other are swapped.
    """
    rows = []
    for (first, first_up), (second, second_up) in product([_alone(sides) for sides in SIDES], repeat=2):
        one, two = (1, 2) if second_up else (2, 1), (1, 2) if first_up else (2, 1)
        rows.append([(first, second), *((first + i, second + j) for i, j in zip(one, two, strict=True))])
    return np.moveaxis(np.array(rows) % 3, 0, -1).copy()


_APART = np.array([abs(sum(sides)) == 3 for sides in SIDES])
_WITHIN = np.array([sides == (0, 0, 0) for sides in SIDES])
_TOUCHED = np.array([0 in sides for sides in SIDES])
_HIGHEST = np.array([sides.index(max(sides)) for sides in SIDES])
_LOWEST = np.array([sides.index(min(sides)) for sides in SIDES])
_ALONE = _corners_of_ends()
