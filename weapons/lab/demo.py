"""Animations of a broad phase: moving boxes, the cells that follow them, and the two steps of a query.

Step 1 visits the nodes of the structure; step 2 compares the query with the boxes in the leaves. Everything drawn comes
from `BroadPhase.work`, so the same code draws all three structures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hitplanes.planes.broadphase.boxes import BroadPhase, Cells
from hitplanes.planes.broadphase.bvh import Bvh
from hitplanes.planes.broadphase.grids import Grid
from hitplanes.planes.broadphase.quadtree import Quadtree
from hitplanes.planes.common.checks import Bools, Floats, Image, InputError, Ints, choice, integer, path_of
from hitplanes.planes.common.limits import SUB, TRIG_BITS
from hitplanes.planes.files.png import check_output, cv2, write_bytes, write_png
from hitplanes.planes.files.scene_folder import new_folder
from hitplanes.planes.grid.fixed_point import unit
from hitplanes.planes.scene.render import blend

from ..report.canvas import CARD, FAINT, INK, PAGE_GROUND, Entry, Legend, Text, draw_texts
from ..report.phrases import percent
from ..report.symbols import MARKS, Color

NO_DITHER = 3  # for OpenCV, unlike its documentation; -1 to 2 put dots on plain areas
COLORS = 6  # bits of the palette; 64 colours are enough for flat drawings, and make small files


def can_write_gif() -> bool:
    """Whether this OpenCV writes GIF files: from 4.12 on, unless it was built without."""
    return hasattr(cv2, "imencodeanimation") and cv2.haveImageWriter("x.gif")


def write_gif(path: Path, frames: Iterable[Image], milliseconds: int) -> None:
    """Write frames (h, w, 3) of RGB bytes as an endless GIF; an error leaves no incomplete file."""
    path = check_output(path)
    if not can_write_gif():
        raise InputError(f"output: expected the name of a folder: OpenCV {cv2.__version__} writes no GIF, got {path}")
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in frames]
    animation.durations = [milliseconds] * len(animation.frames)
    flat = [cv2.IMWRITE_GIF_QUALITY, COLORS, cv2.IMWRITE_GIF_DITHER, NO_DITHER, cv2.IMWRITE_GIF_TRANSPARENCY, 0]
    good, data = cv2.imencodeanimation(".gif", animation, flat)
    if not good:
        raise InputError(f"output: cannot write {path}: OpenCV {cv2.__version__} did not encode it")
    write_bytes(path, data.tobytes())


def write_frames(folder: Path, frames: Iterable[Image]) -> None:
    """Write frames (h, w, 3) of RGB bytes as 000.png, 001.png, ...; an error or an interrupt removes the files."""
    folder = path_of("output", folder)
    with new_folder(folder) as files:
        for frame in frames:
            files.append(folder / f"{len(files):03}.png")
            write_png(files[-1], frame)


FRAMES = 80  # of a round; the next round is the same
MILLISECONDS = 70  # duration of a frame
SEED = 22  # of the boxes' orbits
FLOCKS, FLOCK, WANDERERS = 3, 60, 120  # number of flocks, boxes in each, and boxes that move on their own
WIDTH, HEIGHT = 300, 248  # size of the world, px; each of the two panes shows it
MARGIN, GAP, TOP, PAGE_HEIGHT = 12, 16, 52, 392  # around the panes, between and above them, and of the page, px
NAME, BAR, CHART = 96, 160, 180  # widths of a bar's name, of the longest bar, and of the chart of all frames, px
WALL = 6  # least distance of a box's centre from the edge of the world, px
MIDDLE = np.array([WIDTH / 2, HEIGHT / 2])
QUERY_HALF = np.array([20.0, 16.0])  # half the sides of the query, which is the box of a shot, px
QUERY_REACH, QUERY_TURNS = np.array([[112.0, 88.0]]), np.array([[1, 2]])
"""Amplitudes (px) and turns of the figure of eight along which the query moves."""


class Kind(NamedTuple):
    """A structure that can be shown: its long and short name, the name of its leaves, and its constructor."""

    title: str
    name: str
    leaves: str
    make: Callable[[Floats], BroadPhase]


KINDS = {
    "quadtree": Kind("Quadtree", "quadtree", "leaves", lambda boxes: Quadtree(boxes, capacity=6)),
    "grid": Kind("Uniform grid", "grid", "cells", lambda boxes: Grid(boxes, cell=20)),
    "bvh": Kind("Bounding volume hierarchy", "BVH", "leaves", Bvh),
}
"""Structures by name, coarser than the fastest so that their cells can be seen."""

FOUND, VISITED = MARKS["hit"][0], MARKS["occluded"][0]
TESTED, REST, CELL, ON_THE_WAY = (246, 228, 150), (88, 94, 106), (80, 86, 98), (62, 116, 148)
TINT = 84  # opacity of an opened leaf, of 255
RING = 1.4  # thickness of a ring, px
ROOM = 16  # padding around a picture, in which discs may begin, px


@dataclass(frozen=True)
class Moment:
    """A frame: the nodes of the structure (C,), the boxes (N, 4), px, and the work of one query (4,).

    It visited nodes; comparisons or look-ups of `nodes` and of boxes (`tests`) are counted, a box in several leaves in
    each. `tested` boxes were compared with the query, and `found` ones overlap it.
    """

    cells: Cells
    visited: Bools
    nodes: int
    boxes: Floats
    tests: int
    tested: Bools
    found: Bools
    query: Floats

    @property
    def entered(self) -> Bools:
        """Leaves that the query opened, (C,) bool."""
        return np.asarray(self.visited & self.cells.leaf)

    @property
    def cost(self) -> int:
        """Number of comparisons of nodes and of boxes."""
        return self.nodes + self.tests


def moments(kind: str, frames: int = FRAMES) -> Iterator[Moment]:
    """Move boxes in a structure, one of KINDS, and query it at each of the steps of a round."""
    kind = choice("kind", kind, KINDS)
    frames = integer("frames", frames, 1, 2**31)
    places, half = _orbits(frames)
    track = _on_ellipse(frames, MIDDLE[None], QUERY_REACH, QUERY_TURNS, np.random.default_rng(SEED))[:, 0]
    structure = KINDS[kind].make(_around(places[0], half))
    ids = structure.ids
    for centres, aim in zip(places, track, strict=True):
        boxes, query = _around(centres, half), _around(aim, QUERY_HALF)
        structure.move(ids, boxes)
        work, cells = structure.work(query[None]), structure.cell_boxes()
        met = work.tested[1], structure.query(query[None])[1]
        tested, found = (np.isin(np.arange(len(boxes)), numbers) for numbers in met)
        visited = np.isin(cells.number, work.visited[1])
        yield Moment(cells, visited, work.compared, boxes, work.tested.shape[1], tested, found, query)


def _around(centre: Floats, half: Floats) -> Floats:
    return np.concatenate((centre - half, centre + half), axis=-1)


def _orbits(frames: int) -> tuple[Floats, Floats]:
    """Return the centres (frames, N, 2) of the boxes on closed orbits, and half their sides (N, 1), px.

    Boxes of a flock circle its centre, which circles the middle of the world; others circle their own centres.
    """
    rng = np.random.default_rng(SEED)
    n, reach, turns = FLOCKS * FLOCK, np.array([[96, 70], [82, 84], [104, 56]]), np.array([[1, 1], [-1, 1], [1, -1]])
    leaders = _on_ellipse(frames, np.tile(MIDDLE, (FLOCKS, 1)), reach, turns, rng)
    reach = np.abs(rng.normal(0, 22, (n, 2))) + 3
    own = _on_ellipse(frames, np.zeros((n, 2)), reach, rng.choice([-2, -1, 1, 2], (n, 2)), rng)
    reach = rng.uniform(5, (70, 60), (WANDERERS, 2))
    least = reach + WALL
    about = least + rng.uniform(0, 1, (WANDERERS, 2)) * 2 * (MIDDLE - least)
    wanderers = _on_ellipse(frames, about, reach, rng.choice([-2, -1, 1, 2], (WANDERERS, 2)), rng)
    places = np.concatenate((np.repeat(leaders, FLOCK, axis=1) + own, wanderers), axis=1)
    half = rng.choice([1.5, 2.0, 2.5, 3.5], (places.shape[1], 1))
    return np.clip(places, WALL, MIDDLE * 2 - WALL), half


def _on_ellipse(frames: int, middle: Floats, reach: Floats, turns: Ints, rng: np.random.Generator) -> Floats:
    """Return positions (frames, N, 2) of points with the given turns in x and y, from random angles on."""
    begin = rng.integers(0, 360, middle.shape)
    angle = 360 * np.arange(frames)[:, None, None] * turns / frames + begin
    return np.asarray(np.rint((middle + reach * (unit(angle)[0] / 2**TRIG_BITS)) * SUB) / SUB)


def write_demo(kind: str, output: Path, frames: int = FRAMES) -> Path:
    """Write a round of a structure as a GIF, or as PNG files into a folder, and return the path.

    The output ends in .gif or is a folder. If OpenCV writes no GIF, the name without .gif is the folder.
    """
    output = path_of("output", output)
    gif = output.suffix.lower() == ".gif"
    if not gif and output.suffix and not output.is_dir():
        wanted = "a name that ends in .gif, or of a folder, without an ending"
        raise InputError(f"--output: expected {wanted}, got {output.name!r}")
    if gif and can_write_gif():
        write_gif(output, demo_frames(kind, frames), MILLISECONDS)
    else:
        output = output.with_suffix("") if gif else output
        write_frames(output, demo_frames(kind, frames))
    return output


def demo_frames(kind: str, frames: int = FRAMES) -> Iterator[Image]:
    """Yield the frames of a round, (h, w, 3) RGB bytes."""
    history: list[Moment] = []
    for moment in moments(kind, frames):
        history.append(moment)
        yield picture_of(kind, history, frames)


def picture_of(kind: str, history: Sequence[Moment], frames: int = FRAMES) -> Image:
    """Draw the last moment of a history: both steps, a legend, and the tests made so far."""
    now, shown = history[-1], KINDS[kind]
    page = np.full((PAGE_HEIGHT, 2 * (MARGIN + WIDTH) + GAP, 3), PAGE_GROUND, np.uint8)
    left, right = MARGIN, MARGIN + WIDTH + GAP
    page[TOP : TOP + HEIGHT, left : left + WIDTH] = _first_step(now)
    page[TOP : TOP + HEIGHT, right : right + WIDTH] = _second_step(now)
    opened, leaves = (len(_distinct(now.cells.box[which])) for which in (now.entered, now.cells.leaf))
    texts = [
        Text(left, 20, f"{shown.title}: {len(now.boxes)} moving objects, one query a frame", INK, bold=True),
        Text(left, TOP - 8, f"1  find the {shown.leaves}: {opened} of {leaves}", VISITED),
        Text(right, TOP - 8, f"2  compare within them: {now.found.sum()} found", FOUND),
    ]
    texts += _legend(now, page.shape[1]).draw(page, left, TOP + HEIGHT + 10)
    texts += _counters(page, shown.name, history, frames)
    draw_texts(page, texts)
    return page


def _distinct(boxes: Floats) -> Floats:
    """Return distinct cells that are not empty; a grid lists a cell with settled and new boxes twice."""
    return np.unique(boxes[boxes[:, 0] <= boxes[:, 2]], axis=0)


def _first_step(now: Moment) -> Image:
    """Draw the cells, with those that the query visits highlighted, and the leaves that it opens filled."""
    pane = _pane(now, TINT)
    _discs(pane, now, np.ones(len(now.boxes), np.bool_), REST)
    for which, color in ((~now.visited, CELL), (now.visited & ~now.entered, ON_THE_WAY), (now.entered, VISITED)):
        for box in now.cells.box[which]:
            _frame(pane, box, color)
    _frame(pane, now.query, INK, 2)
    return pane


def _second_step(now: Moment) -> Image:
    """Draw the boxes: compared ones as rings, and those that overlap the query filled, with a rim."""
    pane = _pane(now, TINT // 2)
    _discs(pane, now, ~now.tested, REST)
    _frame(pane, now.query, INK, 2)
    _discs(pane, now, now.tested & ~now.found, TESTED, 1, hollow=True)
    _discs(pane, now, now.found, INK, 1)
    _discs(pane, now, now.found, FOUND)
    return pane


def _pane(now: Moment, tint: int) -> Image:
    """Return a pane in which the opened leaves are tinted."""
    pane = np.full((HEIGHT, WIDTH, 3), CARD, np.uint8)
    for box in _distinct(now.cells.box[now.entered]):
        x0, y0, x1, y1 = _corners(box)
        if x0 < x1 and y0 < y1:
            blend(pane, VISITED, np.full((y1 - y0, x1 - x0), tint, np.uint8), x0, y0)
    return pane


def _discs(pane: Image, now: Moment, which: Bools, color: Color, more: int = 0, hollow: bool = False) -> None:
    """Draw the inscribed discs of boxes, or rings, with a radius larger by `more` px."""
    low, high = now.boxes[which, :2], now.boxes[which, 2:]
    _round(pane, (low + high) / 2, (high - low)[:, 0] / 2 + more, color, hollow)


def _round(picture: Image, centre: Floats, radius: Floats, color: Color, hollow: bool = False) -> None:
    """Blend discs or rings with soft edges: centres (N, 2) and radii (N,), px."""
    across = np.arange(-1, 2 * int(radius.max(initial=0)) + 3)
    first = np.floor(centre - radius[:, None]).astype(np.int64)
    x, y = (first[:, axis, None] + across for axis in (0, 1))
    far = np.hypot((x - centre[:, :1])[:, None, :], (y - centre[:, 1:])[:, :, None])
    inside = radius[:, None, None] + 0.5 - far
    soft = np.clip(inside, 0, 1) - hollow * np.clip(inside - RING, 0, 1)
    alpha = np.zeros((picture.shape[0] + 2 * ROOM, picture.shape[1] + 2 * ROOM), np.uint8)
    np.maximum.at(alpha, (y[:, :, None] + ROOM, x[:, None, :] + ROOM), np.rint(255 * soft).astype(np.uint8))
    blend(picture, color, alpha, -ROOM, -ROOM)


def _corners(box: Floats) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = np.rint(np.clip(box, -2, 2 * WIDTH)).astype(int).tolist()
    return x0, y0, x1, y1


def _frame(pane: Image, box: Floats, color: Color, thick: int = 1) -> None:
    """Draw the border of a box that is not empty."""
    x0, y0, x1, y1 = _corners(box)
    if x0 <= x1 and y0 <= y1:
        cv2.rectangle(pane, (x0, y0), (x1, y1), color, thick)


def _legend(now: Moment, width: int) -> Legend:
    """Return a legend with a mark for each style of cell and box."""
    marks = np.full((6, 14, 14, 3), CARD, np.uint8)
    query, entered, way, rest, tested, found = marks
    cv2.rectangle(query, (1, 3), (12, 10), INK, 2)
    blend(entered, VISITED, np.full((14, 14), TINT, np.uint8), 0, 0)
    cv2.rectangle(entered, (0, 0), (13, 13), VISITED, 1)
    cv2.rectangle(way, (0, 0), (13, 13), ON_THE_WAY, 1)
    for mark, color, radius in ((rest, REST, 4.0), (tested, TESTED, 4.0), (found, INK, 5.0), (found, FOUND, 4.0)):
        _round(mark, np.full((1, 2), 6.5), np.array([radius]), color, color == TESTED)
    words = ("query", "opened", "on the way", "not tested", "compared", "found")
    entries = [Entry(word, mark) for word, mark in zip(words, marks, strict=True)]
    if now.cells.leaf.all():
        del entries[2]
    return Legend(entries, width)


def _counters(page: Image, name: str, history: Sequence[Moment], frames: int) -> list[Text]:
    """Draw the tests of this frame and of brute force as bars, and those of all frames so far as a chart.

    A comparison with a node counts as much as one with a box.
    """
    now, top = history[-1], TOP + HEIGHT + 44
    left, n = MARGIN + NAME, len(now.boxes)
    texts = []
    text = f"{now.tests} boxes + {now.nodes} {'cells' if now.cells.leaf.all() else 'nodes'}"
    rows = (top, "brute force", n, REST, f"{n} boxes", FAINT), (top + 22, name, now.cost, VISITED, text, INK)
    for y, word, tests, color, count_text, ink in rows:
        wide = round(BAR * tests / n)
        page[y : y + 13, left : left + wide] = color
        texts += [Text(left - 8, y + 11, word, FAINT, right=True), Text(left + wide + 8, y + 11, count_text, ink)]
    for count, color in ((now.tests, TESTED), (now.found.sum(), FOUND)):
        page[top + 22 : top + 35, left : left + round(BAR * count / n)] = color
    right = page.shape[1] - MARGIN
    _chart(page[top : top + 35, right - CHART : right], history, frames)
    saved = percent(1 - sum(moment.cost for moment in history) / (n * len(history)))
    texts.append(Text(right - CHART - 10, top + 11, "tests saved so far", FAINT, right=True))
    return [*texts, Text(right - CHART - 10, top + 33, saved, INK, bold=True, right=True)]


def _chart(part: Image, history: Sequence[Moment], frames: int) -> None:
    """Draw a column for each frame so far: tests of brute force, of nodes and boxes, and boxes found."""
    high, wide = part.shape[:2]
    for frame, moment in enumerate(history):
        column = part[:, frame * wide // frames : (frame + 1) * wide // frames]
        column[:] = CELL
        for count, color in ((moment.cost, VISITED), (moment.tests, TESTED), (int(moment.found.sum()), FOUND)):
            column[high - round(high * count / len(moment.boxes)) :] = color
