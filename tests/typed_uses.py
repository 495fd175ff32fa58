"""Right and wrong uses for type checkers, which `test_types.py` runs on this file; it is never executed.

A wrong use is marked with the error that is expected; a mark without an error is an error, too.
"""

# pyright: basic, reportUnnecessaryTypeIgnoreComment=true, reportUnusedExpression=false

from pathlib import Path
from typing import assert_type

import numpy as np
import numpy.typing as npt

from hitplanes import (
    Disc,
    History,
    Hits,
    Laser,
    Pistol,
    RayHits,
    Ready,
    Rounds,
    Scene,
    ShotRecord,
    Spread,
    Sweep,
    Weapon,
    fire,
    fire_shots,
    prepare,
    scan,
    sees,
    weapons_of,
)

scene = Scene((90, 60), categories=["tank"])
tank = scene.add(np.ones((4, 4), np.bool_), (9, 9))
ONE: Weapon = weapons_of(scene)["gun"]

# The answer of rays has what rays have.
assert_type(fire(scene, Disc(3), (5, 5)), Hits)
assert_type(fire(scene, ONE, (5, 5)), Hits)
assert_type(fire(scene, Spread(Disc(3), 5, 9), (5, 5)), Hits)
assert_type(fire(scene, Rounds(Disc(3), 5), (5, 5)), Hits)
assert_type(fire(scene, Pistol(80), (5, 5)), RayHits)
assert_type(fire(History(scene), Laser(80), (5, 5), tick=2), RayHits)
assert_type(fire(scene, Sweep(Pistol(80), 40, 5), (5, 5)), RayHits)
assert_type(fire(scene, Spread(Pistol(80), 5, 9), (5, 5)), RayHits)
assert_type(fire(scene, Rounds(Spread(Pistol(80), 5, 9), 3), (5, 5)), RayHits)
assert_type(fire(scene, Rounds(Sweep(Pistol(80), 40, 5), 3), (5, 5)), RayHits)
assert_type(prepare(scene, Pistol(80)), Ready[RayHits])
assert_type(prepare(scene, Pistol(80), accept="tank").fire((5, 5)), RayHits)
assert_type(prepare(scene, Disc(4), blocked_by=[]).fire((5, 5), aim=3), Hits)
assert_type(ShotRecord(Path("match.jsonl")).fire(scene, Pistol(80), (5, 5), exclude=tank), RayHits)
assert_type(fire(scene, Disc(3), (5, 5))[0].first_xy, tuple[int, int])
assert_type(fire(scene, Disc(3), (5, 5))[1:][0].pixels, int)
assert_type(fire(scene, Disc(3), (5, 5)).by_owner()[0].first_xy, tuple[int, int])
scene.shots.append(fire(scene, Disc(3), (5, 5)).to_shot())
assert_type(fire_shots(scene), list[Hits])
fire(scene, Pistol(80), (5, 5)).stop.distance.tolist()
print(fire(scene, Disc(3), (5, 5)).stop)  # type: ignore[attr-defined]

# Arguments as the documentation says them.
fire(scene, Disc(3), [(1, 2), (3, 4)], aim=[3, 4.5], accept=["tank"], exclude=[1, 2], seed=7, shot=[4, 5])
fire(scene, Disc(3), np.zeros((2, 2)), aim=np.array([3, 4]), accept=np.array([1, 2]), exclude=np.array([[1, -1]]))
fire(scene, Disc(3), (np.float32(1), np.int64(2)), toward=[5, 6.5], accept=5, exclude=np.int64(2), blocked_by=0)
fire(scene, Disc(3), scene.position(tank), toward=scene.position([tank])[0], exclude=[[1, 2], [3, -1]])
fire(scene, Disc(3), (1, 2), toward=[(3, 4), (5, 6)])
fire(scene, Pistol(80), (1, 2), aim=np.arange(5))
scene.set(tank, position_xy=(1, 2), angle=3)
scene.carve(fire(scene, Disc(3), (5, 5)))
scene.carve(fire(scene, Pistol(80), (5, 5)))
scene.carve({tank: [(5, 5)], int(scene.ids()[0]): np.zeros((3, 2), np.int64)})
assert_type(sees(scene, (5, 5), [(1, 2), (3, 4)], accept="tank", blocked_by=[], exclude=tank), npt.NDArray[np.bool_])
assert_type(scan(History(scene), np.zeros((2, 2)), np.arange(9), 80, tick=[1, 2.5]), npt.NDArray[np.float64])
scan(scene, (5, 5), [0, 90.5], range=7.5, exclude=[tank])

# And as it does not.
scene.carve([tank])  # type: ignore[arg-type]
fire(scene, Disc(3), "banana")  # type: ignore[arg-type]
fire(scene, Disc(3), (1, 2), accept=3.5)  # type: ignore[call-overload]
fire(scene, Disc(3), (1, 2), blocked_by=[2.5])  # type: ignore[arg-type]
fire(scene, Disc(3), (1, 2), aim="up")  # type: ignore[arg-type]
fire(scene, Disc(3), (1, 2), aims=3)  # type: ignore[call-overload]
fire(scene, Disc, (1, 2))  # type: ignore[call-overload]
fire(scene, Disc(3))  # type: ignore[call-overload]
sees(scene, (5, 5))  # type: ignore[call-arg]
sees(scene, (5, 5), "here")  # type: ignore[arg-type]
scan(scene, (5, 5), [0, 90], None)  # type: ignore[arg-type]
prepare(scene, Pistol(80), tick=3)  # type: ignore[call-overload]
Spread(Sweep(Pistol(80), 40, 5), 5, 9)  # type: ignore[type-var]
