"""JSON Schemas of scene files, shots and reports, generated from the tables that validate them.

`python tests/bench/schemas.py` writes them to `weapons/schemas/`, which is part of the package.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from hitplanes import Weapon
from hitplanes.planes.common.tables import Const, Keys, Ref
from hitplanes.planes.files.png import write_text
from hitplanes.planes.files.scene_folder import OBJECT, SCENE
from hitplanes.weapons.cli.report_file import REPORT
from hitplanes.weapons.kinds.areas import KINDS, AreaWeapon
from hitplanes.weapons.kinds.rays import RayWeapon
from hitplanes.weapons.replay.shot_log import SHOT

COMMAND = "python tests/bench/schemas.py"
FOLDER = Path(__file__).parents[2] / "weapons" / "schemas"


def schemas() -> dict[str, dict[str, Any]]:
    """Return the JSON Schemas "scene", "shot" and "report" by name."""
    weapons = {
        "weapon": {"anyOf": [Ref("single").schema(), _kind("rounds")]},
        "single": {"anyOf": [Ref("pellet").schema(), _kind("spread"), _kind("sweep")]},
        "pellet": {"anyOf": [Ref("ray").schema(), *_kinds(AreaWeapon)]},
        "ray": {"anyOf": _kinds(RayWeapon)},
    }
    shot, objects = SHOT.schema(), {"anyOf": [keys.schema() for keys in OBJECT.values()]}
    return {
        "scene": _document("A scene of hitplanes", SCENE, {"object": objects, "shot": shot, **weapons}),
        "shot": _document("A shot, a line of a log of shots", SHOT, weapons),
        "report": _document("What shots hit, and why", REPORT, weapons),
    }


def write_schemas(folder: Path = FOLDER) -> None:
    """Write every schema to a folder."""
    for name, schema in schemas().items():
        write_text(folder / f"{name}.json", json.dumps(schema, indent=1) + "\n")


def _document(title: str, table: Keys, definitions: dict[str, Any]) -> dict[str, Any]:
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": title, **table.schema(), **({"$defs": definitions} if definitions else {})}


def _kinds(base: type[Weapon]) -> list[dict[str, Any]]:
    return [_kind(name) for name, kind in KINDS.items() if issubclass(kind, base)]


def _kind(name: str) -> dict[str, Any]:
    """Return the schema of one kind of weapon."""
    kind: type[Weapon] = KINDS[name]
    needed = [field.name for field in fields(kind) if field.default is MISSING]
    return Keys({"kind": Const(name), **kind.table}, ("kind", *needed)).schema()


if __name__ == "__main__":
    write_schemas()
