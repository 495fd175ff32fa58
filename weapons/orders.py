"""Shots as JSON: a weapon by name, categories and owners by name; checked, then fired."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from planes.arrays import InputError, choice, integer, real, reals, within
from planes.constants import ALL, POSITION_MAX, SEED_MAX
from planes.scene import Scene
from planes.scenefile import keys_of, names_of, typed
from weapons.arsenal import Weapon
from weapons.firing import fire
from weapons.hits import Hits

__all__ = ["Order", "fire_order", "order_from_json", "orders_of"]

KEYS = ("weapon", "at", "aim", "toward", "accept", "exclude", "seed", "shot")


@dataclass(frozen=True)
class Order:
    """One shot: which weapon of the arsenal, fired how; `accept` holds category names, `exclude` owner ids."""

    name: str
    weapon: Weapon
    at: tuple[float, float]
    aim: float | None = None
    toward: tuple[float, float] | None = None
    accept: tuple[str, ...] | None = None
    exclude: tuple[int, ...] = ()
    seed: int = 0
    shot: int = 0
    categories: int = ALL


def orders_of(scene: Scene, arsenal: Mapping[str, Weapon]) -> list[Order]:
    """Shots of a scene's file, numbered in their order unless they say otherwise."""
    return [order_from_json(data, scene, arsenal, f"shots[{row}]", row) for row, data in enumerate(scene.shots)]


def order_from_json(
    data: object, scene: Scene, arsenal: Mapping[str, Weapon], place: str = "shot", number: int = 0
) -> Order:
    """Check one shot.

    Parameters
    ----------
    data : JSON of the shot
    place : in front of errors
    number : of the shot, unless the JSON has one

    Raises
    ------
    InputError
        Naming the place and the field.
    """
    with within(place):
        shot = keys_of("shot", data, KEYS)
        for key in ("weapon", "at"):
            if key not in shot:
                raise InputError(f"{key}: expected a value, got nothing")
        name = choice("weapon", shot["weapon"], arsenal)
        accept = names_of("accept", shot["accept"]) if "accept" in shot else None
        return Order(
            name,
            arsenal[name],
            _point("at", shot["at"]),
            None if shot.get("aim") is None else real("aim", shot["aim"], -(10**9), 10**9),
            None if shot.get("toward") is None else _point("toward", shot["toward"]),
            None if accept is None else tuple(accept),
            tuple(_owner(scene, value, i) for i, value in enumerate(typed("exclude", shot.get("exclude", []), list))),
            integer("seed", shot.get("seed", 0), 0, SEED_MAX),
            integer("shot", shot.get("shot", number), 0, 2**63 - 1),
            ALL if accept is None else scene.category_bits(*accept),
        )


def fire_order(scene: Scene, order: Order) -> Hits:
    """Fire one shot."""
    return fire(
        scene,
        order.weapon,
        order.at,
        aim=order.aim,
        toward=order.toward,
        accept=order.categories,
        exclude=order.exclude or None,
        seed=order.seed,
        shot=[order.shot],
    )


def _point(name: str, value: object) -> tuple[float, float]:
    x, y = reals(name, value, (2,), POSITION_MAX).tolist()
    return x, y


def _owner(scene: Scene, value: object, row: int) -> int:
    """Owner of a named object, or an owner's id."""
    with within(f"exclude[{row}]"):
        if isinstance(value, str):
            return int(scene.items.owner[scene.find(value)])
        return integer("owner", value, 0, scene.items.count - 1)
