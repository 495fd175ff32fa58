"""Report JSON to pixels: the scene dimmed, what was hit outlined, each sample marked by its verdict, and cards.

Everything is drawn in whole numbers; text comes last, as a layer of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from planes.arrays import Image, InputError
from planes.items import Role
from planes.scene import Scene
from planes.spans import Box
from weapons.cards import batch_cards, shot_card
from weapons.marks import MARKS
from weapons.overlay import Overlay, blocked_objects
from weapons.panel import Text, draw_texts, page_of
from weapons.world import factor_of, ground_of, mark_heat, mark_samples, outline, outline_seen

__all__ = ["picture_of_report"]

OUTLINES_MAX = 1000
"""More objects than these are not outlined, unless they were hit."""


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
    factor = factor_of(view)
    world = ground_of(scene, report["scene"]["bounds_xyxy"], view, factor)
    if report["batch"]:
        texts, cards = _heat(world, report, scene, view, factor), batch_cards(report)
    else:
        texts = _shots(world, report, scene, view, factor)
        cards = [shot_card(shot, number, scene) for number, shot in enumerate(report["shots"], 1)]
    page, texts = page_of(report, world, texts, cards)
    if text:
        draw_texts(page, texts)
    return page


def _shots(world: Image, report: Mapping[str, Any], scene: Scene, view: Box, factor: int) -> list[Text]:
    """Mark every sample of every shot, outline the objects, and write over them who is who."""
    shots = report["shots"]
    hit = {row["object"] for shot in shots for row in shot["rows"]}
    blocked = blocked_objects(shots, scene)
    others = [item for item in scene.ids(Role.HITTABLE).tolist() if item not in hit | blocked]
    outline_seen(world, scene, others[:OUTLINES_MAX], view, factor)
    for verdict in MARKS:
        mark_samples(world, shots, verdict, view, factor)
    for item in sorted(blocked):
        outline(world, scene, item, view, factor, "blocked")
    for item in sorted(hit):
        outline(world, scene, item, view, factor, "hit")
    overlay = Overlay(world, view, factor)
    overlay.keep_free(shots, scene)
    for number, shot in enumerate(shots, 1):
        overlay.shot(shot, number)
    overlay.links(shots)
    overlay.names(shots, scene)
    return overlay.texts


def _heat(world: Image, report: Mapping[str, Any], scene: Scene, view: Box, factor: int) -> list[Text]:
    """Colour every pixel by the samples that fell on it, and outline the objects."""
    for verdict in MARKS:
        mark_heat(world, report["batch"]["heat"], verdict, view, factor)
    outline_seen(world, scene, scene.ids(Role.HITTABLE).tolist()[:OUTLINES_MAX], view, factor)
    return []
