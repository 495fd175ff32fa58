"""JSON Schemas of scene files, shots and reports, generated from the tables that validate them.

`python tests/bench/schemas.py` writes them to `weapons/schemas/`, which is part of the package.
"""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from hitplanes import Weapon
from hitplanes.planes.common.tables import (
    TEXT_MAX,
    Const,
    Either,
    Flag,
    Keys,
    Mapped,
    Mask,
    Names,
    Number,
    Numbers,
    OneOrEach,
    Optional,
    Ref,
    Rows,
    Shape,
    Text,
    Value,
    Whole,
    Wholes,
    Within,
    Word,
)
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
        "weapon": {"anyOf": [schema_of(Ref("single")), _kind("rounds")]},
        "single": {"anyOf": [schema_of(Ref("pellet")), _kind("spread"), _kind("sweep")]},
        "pellet": {"anyOf": [schema_of(Ref("ray")), *_kinds(AreaWeapon)]},
        "ray": {"anyOf": _kinds(RayWeapon)},
    }
    shot, objects = schema_of(SHOT), {"anyOf": [schema_of(keys) for keys in OBJECT.values()]}
    return {
        "scene": _document("A scene of hitplanes", SCENE, {"object": objects, "shot": shot, **weapons}),
        "shot": _document("A shot, a line of a log of shots", SHOT, weapons),
        "report": _document("What shots hit, and why", REPORT, weapons),
    }


def write_schemas(folder: Path = FOLDER) -> None:
    """Write every schema to a folder."""
    for name, schema in schemas().items():
        write_text(folder / f"{name}.json", json.dumps(schema, indent=1) + "\n")


def schema_of(form: Value) -> dict[str, Any]:
    """Write a form as JSON Schema."""
    match form:
        case Number(low, high):
            return {"type": "number", **_limits(low, high)}
        case Whole(low, high):
            return {"type": "integer", **_limits(low, high)}
        case Numbers(shape, limit, least, low):
            return _nested(shape, schema_of(Number(-limit if low is None else low, limit)), least)
        case Wholes(shape, low, high):
            return _nested(shape, schema_of(Whole(low, high)), 0)
        case Text():
            return {"type": "string", "minLength": 1, "maxLength": TEXT_MAX}
        case Names():
            return {"type": "array", "items": schema_of(Text()), "uniqueItems": True}
        case Word(words):
            return {"enum": list(words)}
        case Const(value, older):
            return {"enum": [value, *older]} if older else {"const": value}
        case Flag():
            return {"type": "boolean"}
        case Mask():  # a schema cannot say that all rows have one length
            rows = {"type": "array", "items": {"type": "string", "pattern": "^[#.]+$"}, "minItems": 1}
            return {"anyOf": [rows, _nested((None, None), {"enum": [0, 1, True, False]}, 1)]}
        case _:
            return _schema_of_forms(form)


def _schema_of_forms(form: Value) -> dict[str, Any]:
    """Write a form that is made of other forms as JSON Schema."""
    match form:
        case Optional(inner):
            return {"anyOf": [schema_of(inner), {"type": "null"}]}
        case Either(_, first, second) | OneOrEach(first, second):
            return {"anyOf": [schema_of(first), schema_of(second)]}
        case Rows(inner):
            return {"type": "array", "items": schema_of(inner)}
        case Mapped(inner):
            return {"type": "object", "propertyNames": schema_of(Text()), "additionalProperties": schema_of(inner)}
        case Keys(forms, needed):
            properties = {key: schema_of(inner) for key, inner in forms.items()}
            schema = {"type": "object", "properties": properties, "additionalProperties": False}
            return {**schema, "required": list(needed)} if needed else schema
        case Within(inner):
            return schema_of(inner)
        case Ref(definition):
            return {"$ref": f"#/$defs/{definition}"}
        case _:
            raise TypeError(f"no schema is known of {form}")


def _limits(low: float, high: float) -> dict[str, Any]:
    limits = {"minimum": low, "maximum": high}
    return {key: limit for key, limit in limits.items() if math.isfinite(limit)}


def _nested(shape: Shape, item: dict[str, Any], least: int) -> dict[str, Any]:
    for n in reversed(shape):
        item = {"type": "array", "items": item}
        if n is not None:
            item |= {"minItems": n, "maxItems": n}
    return item | {"minItems": least} if least else item


def _document(title: str, table: Keys, definitions: dict[str, Any]) -> dict[str, Any]:
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": title, **schema_of(table), **({"$defs": definitions} if definitions else {})}


def _kinds(base: type[Weapon]) -> list[dict[str, Any]]:
    return [_kind(name) for name, kind in KINDS.items() if issubclass(kind, base)]


def _kind(name: str) -> dict[str, Any]:
    """Return the schema of one kind of weapon."""
    kind: type[Weapon] = KINDS[name]
    needed = [field.name for field in fields(kind) if field.default is MISSING]
    return schema_of(Keys({"kind": Const(name), **kind.table}, ("kind", *needed)))


if __name__ == "__main__":
    write_schemas()
