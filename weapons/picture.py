"""Report JSON to pixels: the scene dimmed, what was hit outlined, each sample marked by its verdict, and cards.

Everything is blended in whole numbers and the same bytes on any OpenCV; text comes last, as a layer of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from planes.arrays import Image, InputError
from planes.items import Role
from planes.scene import Scene
from weapons.cards import batch_cards, hit_now, shot_card
from weapons.ghosts import draw_present
from weapons.marks import MARKS
from weapons.overlay import Overlay
from weapons.panel import Text, draw_texts, page_of
from weapons.raymarks import draw_rays, marked
from weapons.world import World, factor_of

__all__ = ["picture_of_report"]


def picture_of_report(report: Mapping[str, Any], scene: Scene, *, text: bool = True) -> Image:
    """Draw a report.

    Parameters
    ----------
    report : as `report_of` makes it
    scene : the scene that it was made of
    text : False leaves the text layer out

    Returns
    -------
    (h, w, 3) bytes, RGB

    Raises
    ------
    InputError
        If the scene is not the one of the report.
    """
    if scene.content_hash() != report["scene"]["hash"]:
        raise InputError(f"scene: expected hash {report['scene']['hash']}, got {scene.content_hash()}: it has changed")
    view = tuple(report["view_xyxy"])
    world = World(scene, report["scene"]["bounds_xyxy"], view, factor_of(view))
    if "filter" in report:
        from weapons.sketch import draw_cells  # few reports need it

        draw_cells(world, report)
    if report["batch"]:
        texts, cards = _heat(world, report, scene), batch_cards(report)
    else:
        texts = _shots(world, report, scene)
        again = [hit_now(report, number) for number in range(len(report["shots"]))]
        cards = [
            shot_card(shot, n, scene, now) for n, (shot, now) in enumerate(zip(report["shots"], again, strict=True))
        ]
    page, texts = page_of(report, world, texts, cards)
    if text:
        draw_texts(page, texts)
    return page


def _shots(world: World, report: Mapping[str, Any], scene: Scene) -> list[Text]:
    """Mark every sample of every shot, outline the objects, and write over them who is who."""
    shots = report["shots"]
    hit = {row["object"] for shot in shots for row in shot["rows"]}
    blocked = {told["object"] for shot in shots for by in shot["blockers"] for told in by["blocked"]} - hit
    world.outline_seen([item for item in scene.ids(Role.HITTABLE).tolist() if item not in hit | blocked])
    for verdict in MARKS:
        world.mark_samples(marked(shots, verdict), verdict)
    for kind, items in (("blocked", blocked), ("hit", hit)):
        for item in sorted(items):
            world.outline(item, kind)
    if "filter" in report:
        from weapons.sketch import draw_volumes

        draw_volumes(world, report, scene)
    moved = draw_present(world, report) if "now" in report else False
    told, drawn = draw_rays(world, report)
    overlay = Overlay(world)
    overlay.keep_free(shots, scene)
    overlay.taken |= drawn | moved
    for number, shot in enumerate(shots):
        overlay.shot(shot, number)
    overlay.distances(shots)
    overlay.names(shots, scene)
    overlay.links(shots, hit)
    return [*told, *overlay.texts]


def _heat(world: World, report: Mapping[str, Any], scene: Scene) -> list[Text]:
    """Colour every pixel by the samples that fell on it, and outline the objects."""
    for verdict in MARKS:
        world.mark_heat(report["batch"]["heat"], verdict)
    world.outline_seen(scene.ids(Role.HITTABLE).tolist())
    return []
