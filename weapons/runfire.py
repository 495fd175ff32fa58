"""Fire patterns run by run: the whole flow of a weapon with falloff, or one too large for bit rows.

scene -> stack -> weapon -> patterns -> placed -> pre-filter -> samples -> rows
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from planes.arrays import Ints
from planes.constants import CHUNK_PAIRS, CHUNK_SAMPLES
from planes.items import Stack
from planes.sampling import OF_PATTERNS
from planes.scene import Scene
from weapons.arsenal import pierces
from weapons.candidates import Candidates, may_refuse
from weapons.costs import chosen_candidates, chosen_strategy, sweep_pays
from weapons.hits import Hits, Rows, rows_of_met
from weapons.plan import Plan, leave_out_unused
from weapons.resolve import Sight, composed, direct
from weapons.volley import Shots, Volley, volley_of
from weapons.weapon import Weapon

__all__ = ["fired_by_runs", "verdicts_of"]


def fired_by_runs(
    scene: Scene, weapon: Weapon, shots: Shots, stack: Stack, how: tuple[str, str, str], plan: Plan
) -> Hits:
    """Decide what shots hit; `how` are the pre-filter, broad phase and strategy."""
    prefilter, broadphase, strategy = how
    first = volley_of(weapon, shots.take(0, 1))
    plan.run("patterns", "" if len(shots) else "no shots", first.nbytes)
    placements = len(first.shot) * len(shots)
    name, why = chosen_strategy(strategy, scene, stack, first.table, placements)
    asked = placements if name == "direct" or pierces(weapon) or shots.choosy else 0
    swept = sweep_pays(stack, first.table, asked)
    candidates = chosen_candidates(prefilter, broadphase, scene, stack, swept, asked)
    sight = Sight(stack, scene.bounds, pierces(weapon), candidates, plan)
    drawn = None
    plan.run("plan", f"{name}: {why}")
    if name == "composed" and (plane := scene.code_plane()):
        drawn = plane.read(scene.items), plane.box_xyxy
        plan.run("code plane", f"{plane.redrawn} px drawn anew; {why}", plane.redrawn * drawn[0].itemsize)
    rows, verdicts = [], [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for begin, part in _parts(shots, first, candidates):
        volley = first if len(shots) == 1 else volley_of(weapon, part)
        _tell_patterns(plan, volley, 0 if volley is first else volley.nbytes)
        met = composed(volley, part, sight, *drawn) if drawn else direct(volley, part, sight)
        rows.append(rows_of_met(met, volley, stack.ids, begin))
        plan.run("rows", "", rows[-1].nbytes)
        verdicts.append(met.counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
        plan.run("verdicts", "", verdicts[-1].nbytes)
    hits = Hits(Rows.joined(rows), lambda: np.concatenate(verdicts), scene, weapon, shots, plan)
    plan.run("rows", "")
    leave_out_unused(plan, scene, candidates, first.table, may_refuse(stack, shots), why)
    plan.run("plan", "")
    return hits


def verdicts_of(weapon: Weapon, shots: Shots, sight: Sight) -> Ints:
    """Count samples (N, 5) by verdict, of the stack as it was when the shots were fired: it does not change."""
    boxes = Candidates(sight.candidates.items, sight.stack)
    then = Sight(sight.stack, sight.bounds, sight.pierce, boxes, Plan())
    verdicts = [np.zeros((0, len(OF_PATTERNS)), np.int64)]
    for _, part in _parts(shots, volley_of(weapon, shots.take(0, 1)), boxes):
        counts = direct(volley_of(weapon, part), part, then).counts
        verdicts.append(counts.reshape(len(part), -1, len(OF_PATTERNS)).sum(axis=1))
    return np.concatenate(verdicts)


def _tell_patterns(plan: Plan, volley: Volley, made: int) -> None:
    """Record the patterns of a part of the shots, and their weights."""
    plan.run("patterns", f"{len(volley.table.count)} distinct", made + volley.table.spans.nbytes)
    if volley.table.prefix is not None:
        plan.run("weights", "falloff of the hit pixels, by prefix sums", volley.table.prefix.nbytes)


def _parts(shots: Shots, first: Volley, candidates: Candidates) -> Iterator[tuple[int, Shots]]:
    """Cut a batch so that the samples and pairs of a part stay within their chunks.

    All shots of a call have the weapon of the first, and patterns of about its size. With a broad phase parts grow as
    long as placements meet few items.
    """
    placements = max(len(first.shot), 1)
    most = max(1, CHUNK_SAMPLES // max(int(first.count.sum()), placements))
    step = max(1, min(most, CHUNK_PAIRS // (placements * max(len(candidates.stack), 1))))
    begin = 0
    while begin < len(shots):
        yield begin, shots.take(begin, min(begin + step, len(shots)))
        begin += step
        if candidates.index is not None:
            step = max(1, min(2 * step, most, CHUNK_PAIRS * begin // max(candidates.met, 1)))
