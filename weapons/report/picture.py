"""Pictures of one report, or of two reports side by side with their difference.

All is blended in whole numbers, with the same bytes for any version of OpenCV; text is drawn last, as its own layer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import Any

import numpy as np

from hitplanes.planes.common.checks import Bools, Image, InputError, flag, kind_of, shown
from hitplanes.planes.common.limits import VIEW_MAX
from hitplanes.planes.common.tables import Const
from hitplanes.planes.grid.spans import Box
from hitplanes.planes.scene.objects import Role
from hitplanes.planes.scene.scene import Scene

from .canvas import (
    EDGE,
    FAINT,
    INK,
    LINE,
    PAGE_GROUND,
    TOP,
    Entry,
    Legend,
    Text,
    World,
    clipped,
    covered,
    draw_texts,
    factor_of,
    fill,
    heat_boxes,
    page_of,
    sign_entries,
)
from .cards import batch_cards, hit_now, shot_card
from .differences import differences, first_of
from .overlay import OF_RAYS, Overlay, draw_present, draw_rays
from .report import FORMAT
from .symbols import MARKS, verdict_mark


def picture_of_report(report: Mapping[str, Any], scene: Scene, *, text: bool = True) -> Image:
    """Draw a report.

    Parameters
    ----------
    report : report made by `report_of`
    scene : the scene of the report
    text : False leaves the text layer out

    Returns
    -------
    (h, w, 3) bytes, RGB

    Raises
    ------
    InputError
        If it is not a report, or the scene is not that of the report.
    """
    _check(report, scene)
    text = flag("text", text)
    if scene.content_hash() != report["scene"]["hash"]:
        raise InputError(f"scene: expected hash {report['scene']['hash']}, got {scene.content_hash()}: it has changed")
    view = tuple(report["view_xyxy"])
    world = World(scene, report["scene"]["bounds_xyxy"], view, factor_of(view))
    if "filter" in report:
        from .prefilter_trace import draw_cells  # few reports need it

        draw_cells(world, report)
    if report["batch"]:
        for verdict in MARKS:
            world.mark_heat(report["batch"], verdict)
        world.outline_seen(scene.ids(Role.HITTABLE).tolist())
        texts, cards = _names(world, report, scene) if text else [], batch_cards(report)
    else:
        texts = _shots(world, report, scene)
        cards = [shot_card(shot, n, scene, hit_now(report, n)) for n, shot in enumerate(report["shots"])]
    page, texts = page_of(report, world, texts, cards)
    if text:
        draw_texts(page, texts)
    return page


def _check(report: object, scene: object) -> None:
    """Refuse what is no report, and what is no scene."""
    if not isinstance(report, Mapping):
        raise InputError(f"report: expected one, as report_of makes it, got {shown(report)}")
    Const(FORMAT).check("report: format", report.get("format"))
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a Scene, got {kind_of(scene)}")


def _names(world: World, report: Mapping[str, Any], scene: Scene) -> list[Text]:
    """Make room for the names of what a batch hit, beside the objects, and return them."""
    hit = [{"rows": report["batch"]["objects"], "samples": {}, "blockers": ()}]
    overlay = Overlay(world)
    overlay.keep_free(hit, scene)
    overlay.names(hit, scene)
    return overlay.texts


def _shots(world: World, report: Mapping[str, Any], scene: Scene) -> list[Text]:
    """Mark all samples of all shots, outline the objects, and return the labels."""
    shots = report["shots"]
    hit = {row["object"] for shot in shots for row in shot["rows"]}
    blocked = {entry["object"] for shot in shots for by in shot["blockers"] for entry in by["blocked"]} - hit
    world.outline_seen([item for item in scene.ids(Role.HITTABLE).tolist() if item not in hit | blocked])
    world.mark_samples(shots, OF_RAYS)
    for shot in shots:  # the edges of what lies sheltered, as people draw light
        world.outline_runs(shot.get("sheltered", ()), "shadow")
    for kind, items in (("blocked", blocked), ("hit", hit)):
        for item in sorted(items):
            world.outline(item, kind)
    if "filter" in report:
        from .prefilter_trace import draw_volumes

        draw_volumes(world, report, scene)
    moved = draw_present(world, report) if "now" in report else False
    labels, drawn = draw_rays(world, report)
    overlay = Overlay(world)
    overlay.keep_free(shots, scene)
    overlay.reserve(drawn | moved)
    for number, shot in enumerate(shots):
        overlay.shot(shot, number)
    overlay.distances(shots)
    overlay.names(shots, scene)
    overlay.links(shots, hit)
    return [*labels, *overlay.texts]


WIDTH, HEIGHT, GAP = 640, 720, 12  # about the size of each of the three pictures, and the space between them, px
LONGEST = 1200  # longest side of the compared box, px; a longer one is cut around its middle
AROUND = 24  # width of the border shown around the pixels that differ, px
LIGHT = 60  # brightness of the scene under the difference, of 255
LINES_MAX = 60  # most differences listed on the page; the command prints all

LOOKS = {"both": "empty", "other verdict": "filtered", "only expected": "occluded", "only got": "hit"}
"""Verdict whose mark each kind of pixel uses; the shapes differ even in grey."""


def picture_of_difference(
    expected: Mapping[str, Any], got: Mapping[str, Any], scenes: tuple[Scene | None, Scene | None] = (None, None), *,
    text: bool = True,
) -> Image:  # fmt: skip
    """Draw two reports and their difference, as (h, w, 3) bytes, RGB.

    A scene of None leaves the ground of its report empty; without `text` the text layer is left out.
    """
    whole = _around(tuple(expected["view_xyxy"]), tuple(got["view_xyxy"]))
    kinds = compared_pixels(expected, got, whole)
    counts = {name: int(at.sum()) for name, at in kinds.items()}
    view = _focus(kinds, whole)
    x, y = view[0] - whole[0], view[1] - whole[1]
    kinds = {name: at[y : y + view[3] - view[1] + 1, x : x + view[2] - view[0] + 1] for name, at in kinds.items()}
    factor = factor_of(view, WIDTH, HEIGHT)
    worlds = [
        World(scene, report["scene"]["bounds_xyxy"], view, factor)
        for scene, report in zip(scenes, (expected, got), strict=True)
    ]
    numbered = _changed(expected["shots"], got["shots"])
    sides = [
        (world.image, _marked(world, report, numbered)) for world, report in zip(worlds, (expected, got), strict=True)
    ]
    sides.append((_difference(got, scenes[1], kinds, view, factor), []))
    painted = worlds[0].painted | worlds[1].painted
    wide = sides[0][0].shape[1] + 2 * EDGE
    verdicts = [Entry(verdict, verdict_mark(verdict)) for verdict in reversed(MARKS) if verdict in painted]
    kept = [Entry(f"{name}: {n}", verdict_mark(LOOKS[name])) for name, n in reversed(counts.items()) if n]
    legends = [Legend([*verdicts, *sign_entries(painted)], 2 * (wide - EDGE)), Legend(kept, wide)]
    page, texts = _page(sides, legends, differences(expected, got))
    if text:
        draw_texts(page, texts)
    return page


def compared_pixels(expected: Mapping[str, Any], got: Mapping[str, Any], view: Box) -> dict[str, Bools]:
    """Masks (h, w) of the pixels of a view that were hit in both reports or in one, or had another verdict change."""
    mine, other = (_verdict_planes(report, view) for report in (expected, got))
    a, b = mine["hit"], other["hit"]
    changed = np.logical_or.reduce([mine[verdict] != other[verdict] for verdict in MARKS])
    return {"both": a & b, "other verdict": changed & ~(a | b), "only expected": a & ~b, "only got": b & ~a}


def _verdict_planes(report: Mapping[str, Any], view: Box) -> dict[str, Bools]:
    """Mask (h, w) for each verdict of the pixels that have it in any shot."""
    planes = {v: covered(view, [shot["samples"].get(v, ()) for shot in report["shots"]]) for v in MARKS}
    if report["batch"]:
        for verdict, plane in planes.items():
            for _, box in heat_boxes(report["batch"]["heat"], verdict):
                fill(plane, view, box)
    return planes


def _focus(kinds: Mapping[str, Bools], whole: Box) -> Box:
    """Box around the pixels that differ, else around those that were hit, else the whole box."""
    for names in (("only expected", "only got"), ("other verdict",), ("both",)):
        at = np.argwhere(np.logical_or.reduce([kinds[name] for name in names]))[:, ::-1]
        if len(at):
            low = np.maximum(at.min(axis=0) - AROUND, 0) + whole[:2]
            high = np.minimum(at.max(axis=0) + AROUND + whole[:2], whole[2:])
            return _cut(*low.tolist(), *high.tolist())
    return _cut(*whole)


def _cut(x: int, y: int, x_max: int, y_max: int) -> Box:
    """Box cut to at most LONGEST px a side around its middle."""
    over_x, over_y = max(0, x_max - x + 1 - LONGEST), max(0, y_max - y + 1 - LONGEST)
    return x + over_x // 2, y + over_y // 2, x_max - (over_x + 1) // 2, y_max - (over_y + 1) // 2


def _around(a: Box, b: Box) -> Box:
    """Box around both, or the first alone if they lie far apart."""
    x, y, x_max, y_max = min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])
    return (x, y, x_max, y_max) if max(x_max - x, y_max - y) <= 2 * VIEW_MAX else a


def _changed(expected: Sequence[Any], got: Sequence[Any]) -> set[int]:
    """Places of the shots whose samples or rows differ; of all, if none do or if they are not the same number."""
    every = set(range(max(len(expected), len(got))))
    if len(expected) != len(got):
        return every
    seen = [[(shot["samples"], shot["rows"]) for shot in shots] for shots in (expected, got)]
    return {place for place, (was, now) in enumerate(zip(*seen, strict=True)) if was != now} or every


def _marked(world: World, report: Mapping[str, Any], numbered: Set[int]) -> list[Text]:
    """Mark the samples of one report, and number some of its shots, by their places."""
    world.mark_samples(report["shots"], OF_RAYS)
    for verdict in MARKS if report["batch"] else ():
        world.mark_heat(report["batch"], verdict)
    for item in sorted({row["object"] for shot in report["shots"] for row in shot["rows"]}):
        world.outline(item, "hit")
    numbers, drawn = draw_rays(world, report)
    overlay = Overlay(world)
    overlay.reserve(drawn)
    for number, shot in enumerate(report["shots"]):
        if number in numbered:
            overlay.shot(shot, number)
    return [*numbers, *overlay.texts]


def _difference(
    got: Mapping[str, Any], scene: Scene | None, kinds: Mapping[str, Bools], view: Box, factor: int
) -> Image:
    """Picture of the pixels that were hit in both reports or in one."""
    world = World(scene, got["scene"]["bounds_xyxy"], view, factor, LIGHT)
    if scene is not None:
        world.outline_seen(scene.ids(Role.HITTABLE).tolist())
    for name, at in kinds.items():
        world.lay(at, LOOKS[name])
    return world.image


def _page(
    sides: Sequence[tuple[Image, list[Text]]], legends: Sequence[Legend], words: Sequence[str]
) -> tuple[Image, list[Text]]:
    """Page with the three pictures in a row, two legends, and the differences in words."""
    high, wide = sides[0][0].shape[:2]
    width = 2 * EDGE + 3 * wide + 2 * GAP
    below = TOP + high + 14 + max(legend.height for legend in legends)
    lines = first_of(words, LINES_MAX) or ["no difference"]
    page = np.full((below + LINE * len(lines) + 12, width, 3), PAGE_GROUND, np.uint8)
    texts = []
    for i, ((world, labels), title) in enumerate(zip(sides, ("expected", "got", "difference"), strict=True)):
        left = EDGE + i * (wide + GAP)
        page[TOP : TOP + high, left : left + wide] = world
        texts += [label._replace(x=label.x + left, y=label.y + TOP) for label in labels]
        texts.append(Text(left, 28, title, INK, bold=True))
    for legend, left in zip(legends, (EDGE, EDGE + 2 * (wide + GAP)), strict=True):
        texts += legend.draw(page, left, TOP + high + 14)
    for i, line in enumerate(lines):
        texts.append(Text(EDGE, below + 14 + LINE * i, clipped(line, width - 2 * EDGE), FAINT))
    return page, texts
