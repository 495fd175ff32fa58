"""The page of the public API, `weapons/API.md`, made of signatures and docstrings.

python tests/bench/api_page.py

It writes the page anew. A test compares the page with what this makes.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from enum import Enum
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import hitplanes
from hitplanes.planes.broadphase import __all__ as broad_phases
from hitplanes.planes.common.backend import cached_attribute

PAGE = Path(__file__).parents[2] / "weapons" / "API.md"
COMMAND = "python tests/bench/api_page.py"

MODULES: dict[str, tuple[str, ...]] = {
    "hitplanes": tuple(hitplanes.__all__),
    "hitplanes.planes.volumes.fit": (
        "box", "least_circle", "pivot_circle", "capsule", "oriented_box", "boxes", "hull", "convex", "concave",
    ),
    "hitplanes.planes.volumes.overlap": ("overlap", "contains_point", "separating_axis"),
    "hitplanes.planes.volumes.volumes": (
        "Volumes", "Circles", "Aabbs", "Obbs", "Polygons", "Capsules", "BoxSets", "ConcavePolygons",
    ),
    "hitplanes.planes.broadphase": tuple(broad_phases),
    "hitplanes.planes.broadphase.triangles": ("Mesh", "meeting_faces", "triangles_meet"),
}  # fmt: skip
"""Of each module that users import from the names that are for them."""

GROUPS: dict[str, tuple[str, ...]] = {
    "The scene": ("Scene", "Sprite", "Role", "Planes", "load_scene", "read_png", "write_png"),
    "Fire": (
        "fire",
        "fire_shots",
        "sees",
        "scan",
        "prepare",
        "Ready",
        "Hits",
        "RayHits",
        "Verdict",
        "Reason",
        "Spans",
        "ALL",
        "InputError",
    ),
    "Weapons of patterns": ("Point", "Disc", "Ring", "Box", "Polygon", "Cone", "Beam", "Stencil"),
    "Weapons of rays": ("Pistol", "Rifle", "Laser", "Projectile", "Sweep"),
    "Weapons of other weapons, and their JSON": ("Spread", "Rounds", "Weapon", "weapons_of", "weapon_from_json"),
    "The past, and records": ("History", "PastScene", "FixedStep", "ShotRecord", "replay"),
    "Reports": ("report_of", "picture_of_report"),
    "The process": ("use_jit", "warm_up", "use_threads", "__version__"),
}
"""The names of `hitplanes` in the order in which a user meets them."""

VALUES = {"ALL": "All categories: the default of `accept`.", "__version__": "The installed version, a text."}
RESULTS = {
    "hitplanes.weapons.fire.plan": ("Plan", "Stage"),
    "hitplanes.weapons.explain.owners": ("OwnerRow",),
    "hitplanes.weapons.fire.hits": ("HitRow",),
    "hitplanes.weapons.explain.samples": ("Samples", "Share", "Blocked", "Behind", "WhyNot"),
    "hitplanes.weapons.explain.margins": ("Margin",),
    "hitplanes.weapons.explain.ray_samples": ("Miss",),
    "hitplanes.weapons.rays.ray_hits": ("Passes", "Stops"),
    "hitplanes.weapons.replay.record": ("Difference",),
}
"""What answers are made of; nobody imports it."""

GIVEN = {"Hits", "RayHits", "Ready", "PastScene", "Planes", "Plan", "Cells", "Work"}
"""Classes whose objects calls give: nobody makes one."""

INSIDE = {"items", "sides", "run", "leave_out", "leave_out_all", "joined"}
"""What only the library reads."""

PROPERTIES = property, cached_property, cached_attribute
SPELLED = {
    "Pellet": "AreaWeapon | RayWeapon", "Repeated": "AreaWeapon | RayWeapon | Spread | Sweep", "AnyHits": "Hits",
    "Ready[Any]": "Ready", "Places": "ArrayLike", "Angles": "ArrayLike", "Wholes": "ArrayLike",
    "Categories": "ArrayLike", "Owners": "ArrayLike",
    "Unpack[Fired]": "Any",
}  # fmt: skip
"""Types that only a type checker tells apart, as a reader knows them."""

UNDERLINE = re.compile(r"^(\w+)\n-+$", re.MULTILINE)
WIDEST = 100

Member = tuple[str, Any]


def public_names() -> Iterator[tuple[str, str, Any]]:
    """Each module, public name and what it names."""
    for module, names in MODULES.items():
        for name in names:
            yield module, name, getattr(import_module(module), name)


PUBLIC = {thing for _, _, thing in public_names() if inspect.isclass(thing)}


def doc_of(thing: Any) -> str:
    """The docstring, without its indentation."""
    return inspect.cleandoc(thing.__doc__ or "")


def homes(cls: type) -> list[type]:
    """A class, and its bases that are told with it: those that are not public themselves."""
    return [cls, *(base for base in cls.__mro__[1:] if base.__module__.startswith("hitplanes.") and base not in PUBLIC)]


def members(cls: type) -> tuple[list[Member], list[Member]]:
    """Public properties and methods of a class."""
    found: dict[str, Any] = {}
    for home in homes(cls):
        for name, value in vars(home).items():
            if not name.startswith("_") and name not in INSIDE:
                found.setdefault(name, value)
    methods = {n: getattr(v, "__func__", v) for n, v in found.items()}
    return (
        [(name, value) for name, value in found.items() if isinstance(value, PROPERTIES)],
        [(name, value) for name, value in methods.items() if inspect.isfunction(value)],
    )


def signature_of(name: str, thing: Any, bound: bool = False) -> str:
    """A call as it is written, one parameter to a line where it is long."""
    signature = inspect.signature(thing)
    if bound:
        signature = signature.replace(parameters=list(signature.parameters.values())[1:])
    parameters = [plain(str(parameter)) for parameter in _starred(signature)]
    result = signature.return_annotation
    end = (
        ""
        if result in (inspect.Signature.empty, None, "None") or inspect.isclass(thing)
        else f" -> {plain(str(result))}"
    )
    call = f"{name}({', '.join(parameters)}){end}"
    if len(call) <= WIDEST:
        return call
    return "\n".join([f"{name}(", *(f"    {parameter}," for parameter in parameters), f"){end}"])


def _starred(signature: inspect.Signature) -> Iterator[object]:
    """Parameters, with a star before those that are given by name only."""
    starred = False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.VAR_POSITIONAL:
            starred = True
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            starred = True
            yield "*"
        yield parameter


def plain(told: str) -> str:
    """A parameter without the quotes of annotations, and with names for what has one."""
    told = re.sub(r"(: |-> )'([^']*)'", r"\1\2", told).replace(str(hitplanes.ALL), "ALL")
    for name, spelled in SPELLED.items():
        told = re.sub(rf"(?<![\w\[]){re.escape(name)}(?!\w)", spelled, told)
    return re.sub(r"<class '(?:\w+\.)*(\w+)'>|<([\w.]+): [^>]*>", lambda found: found[1] or found[2], told)


def escaped(text: str) -> str:
    """Prose whose stars are stars."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else part.replace("*", r"\*").replace("<", "&lt;") for part in parts)


def entries(section: str) -> dict[str, str]:
    """Names of a section of a docstring, and what is told of each."""
    found: dict[str, str] = {}
    for entry in re.split(r"\n(?=\S)", section.strip()):
        head, _, rest = entry.partition("\n")
        name, _, told = head.partition(" : ")
        found[name] = " ".join([told, *(line.strip() for line in rest.splitlines())]).strip()
    return found


def sections(doc: str) -> dict[str, str]:
    """A docstring by its underlined headings; what stands before the first is under no name."""
    parts = UNDERLINE.split(doc)
    return {
        "": parts[0].strip(),
        **{name: text.strip("\n") for name, text in zip(parts[1::2], parts[2::2], strict=True)},
    }


def told_of(thing: Any, inherited: Iterable[Any] = ()) -> Iterator[str]:
    """A docstring as Markdown; parameters of some bases are told with its own."""
    parts = sections(doc_of(thing))
    for base in inherited:
        more = sections(doc_of(base)).get("Parameters")
        if more and more not in parts.get("Parameters", ""):
            parts["Parameters"] = "\n".join(filter(None, [parts.get("Parameters"), more]))
    for name, text in parts.items():
        if name and text:
            yield f"{name}:"
            yield ""
        if not name or name == "References":
            for paragraph in text.split("\n\n"):
                yield paragraph if paragraph.startswith("    ") else escaped(paragraph)
                yield ""
        else:
            yield from (f"- `{key}`: {escaped(told)}" if told else f"- `{key}`" for key, told in entries(text).items())
            yield ""


def method_lines(name: str, method: Any) -> Iterator[str]:
    """One method: its call, and what it does."""
    call = signature_of(name, method, bound=True)
    yield f"#### `.{call if chr(10) not in call else name}`"
    yield ""
    if chr(10) in call:
        yield from _block(call)
    yield from told_of(method)


def _block(text: str) -> list[str]:
    return ["```text", text, "```", ""]


def lines_of(name: str, thing: Any) -> Iterator[str]:
    """All that the page tells of one name."""
    yield f"### `{name}`"
    yield ""
    if name in VALUES:
        yield VALUES[name]
        yield ""
    elif inspect.isclass(thing) and issubclass(thing, Enum):
        yield from told_of(thing)
        yield from (f"- `{member.name}` = `{member.value!r}`" for member in thing)
        yield ""
    elif inspect.isclass(thing):
        if name not in GIVEN and not inspect.isabstract(thing):
            yield from _block(signature_of(name, thing))
        bases = [f"`{base.__name__}`" for base in thing.__mro__[1:] if base in PUBLIC]
        if bases:
            yield f"Has all of {', '.join(bases)}."
            yield ""
        yield from told_of(thing, homes(thing)[1:])
        properties, methods = members(thing)
        told = [f"- `.{key}`: {escaped(summary(value))}" for key, value in properties]
        if told:
            yield from ("Properties:", "", *told, "")
        for key, method in methods:
            yield from method_lines(key, method)
    else:
        yield from _block(signature_of(name, thing))
        yield from told_of(thing)


def result_lines(name: str, thing: Any) -> Iterator[str]:
    """What the page tells of a part of an answer: a named tuple, or columns."""
    yield f"### `{name}`"
    yield ""
    if issubclass(thing, tuple):
        yield from _block(signature_of(name, thing))
    yield from told_of(thing)


def summary(thing: Any) -> str:
    """A docstring in one line."""
    return " ".join(doc_of(thing).split())


def page() -> str:
    """The whole page."""
    lines = ["# The public API", "", f"`{COMMAND}` writes this page from signatures and docstrings; edit those.", ""]
    names = dict.fromkeys(name for group in GROUPS.values() for name in group)
    left = [name for name in MODULES["hitplanes"] if name not in names]
    for heading, group in {**GROUPS, **({"Others": tuple(left)} if left else {})}.items():
        lines += [f"## {heading}: `from hitplanes import ...`", ""]
        for name in group:
            lines += lines_of(name, getattr(hitplanes, name))
    lines += ["## What answers are made of", ""]
    for module, group in RESULTS.items():
        for name in group:
            lines += (lines_of if name in GIVEN else result_lines)(name, getattr(import_module(module), name))
    for module, group in list(MODULES.items())[1:]:
        lines += [f"## `{module}`", "", escaped(doc_of(import_module(module)).split("\n\n")[0]), ""]
        for name in group:
            lines += lines_of(name, getattr(import_module(module), name))
    return "\n".join(lines).rstrip() + "\n"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.name, "has", len(PAGE.read_text(encoding="utf-8").splitlines()), "lines")


if __name__ == "__main__":
    main()
