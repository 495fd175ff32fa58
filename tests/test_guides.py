"""What the guides beside the code show is run as written, and what they name is there."""

from __future__ import annotations

import inspect
import re
import runpy
import shutil
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import pytest
from bench import api_page
from guides import examples, text_of

import hitplanes
from hitplanes import load_scene

ROOT = Path(__file__).parents[1]
RECIPES = ROOT / "weapons" / "RECIPES.md"
OF_SCENES = ROOT / "planes" / "RECIPES.md"
GUIDES = [RECIPES, OF_SCENES, ROOT / "tests" / "README.md", ROOT / "fixtures" / "README.md"]
INSIDE = r"((?:(?!```).)*?)"
GOLDEN = "A golden test in CI"


def name_of(guide: Path) -> str:
    return f"{guide.parent.name}-{guide.name}"


def section(guide: Path, heading: str) -> str:
    return text_of(guide).split(f"\n## {heading}\n")[1].split("\n## ")[0]


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n{INSIDE}```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("guide", GUIDES, ids=name_of)
def test_every_example_shows_what_it_prints(guide: Path) -> None:
    """But for the golden test, which has a test of its own; test_readme runs them all."""
    assert not [example for example in examples(guide) if not example.shown and "hits_golden" not in example.code]


def test_a_recipe_is_short() -> None:
    recipes = [(g, h) for g in (RECIPES, OF_SCENES) for h in re.findall(r"^## (.*)$", text_of(g), flags=re.MULTILINE)]
    assert len(recipes) >= 13
    for guide, heading in recipes:
        (code,) = blocks(section(guide, heading), "python")
        assert len([line for line in code.splitlines() if line]) <= 20, heading


def test_golden_recipe_runs_as_ci_would(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    told = section(RECIPES, GOLDEN)
    (code,), (shown,) = blocks(told, "python"), blocks(told, "text")
    update, stale = re.findall(r"`pytest (--[a-z-]+)`", told)
    test = pytester.path / "test_blast.py"
    test.write_text(code)
    shutil.copytree(ROOT / "fixtures" / "gallery", pytester.path / "level1")

    def ran(*words: str) -> tuple[int, str]:
        done = pytester.runpytest_inprocess("-q", "-p", "no:cacheprovider", *words)
        return int(done.ret), done.stdout.str()

    assert ran(stale)[0] == 1 and not (pytester.path / "goldens").exists()
    assert ran(update)[0] == 0 and ran(stale)[0] == 0
    changed = re.findall(r"With `(Disc\(\d+\))` it says", told)[0]
    test.write_text(code.replace("Disc(32)", changed))
    status, printed = ran(stale)
    assert status == 1 and shown in printed
    assert (pytester.path / "hits-failures" / "index.html").is_file()


@pytest.mark.parametrize("guide", GUIDES, ids=name_of)
def test_a_guide_is_short_and_what_it_names_is_there(guide: Path) -> None:
    text = text_of(guide)
    assert len(text.splitlines()) < 300
    for link in re.findall(r"\]\(([^)#\s]+)\)", text):
        assert (guide.parent / link).exists(), link
    for path in re.findall(r"`((?:planes|weapons|tests|fixtures)/[\w/.]*)`", text):
        assert (ROOT / path).exists(), path


def public_members() -> Iterator[tuple[str, Any, list[Any]]]:
    """Each public name, and each method and property of a class; with what documents its parameters."""
    for module, name, thing in api_page.public_names():
        if inspect.isclass(thing):
            yield f"{module}.{name}", thing, list(thing.__mro__)
            for kind in api_page.members(thing):
                for member, value in kind:
                    overridden = [getattr(base, member) for base in thing.__mro__[1:] if hasattr(base, member)]
                    yield f"{module}.{name}.{member}", value, [value, *overridden, *api_page.homes(thing)]
        elif name not in api_page.VALUES:
            yield f"{module}.{name}", thing, [thing]


def test_api_page_is_that_of_the_docstrings() -> None:
    written = text_of(api_page.PAGE)
    assert written == api_page.page(), f"to write weapons/API.md anew: {api_page.COMMAND}"
    assert f"`{api_page.COMMAND}`" in written and (ROOT / api_page.COMMAND.split()[1]).is_file()


def test_api_page_has_every_public_name() -> None:
    headings = re.findall(r"^### `(\w+)`$", text_of(api_page.PAGE), flags=re.MULTILINE)
    assert set(hitplanes.__all__) <= set(headings)
    grouped = [name for group in api_page.GROUPS.values() for name in group]
    assert sorted(grouped) == sorted(hitplanes.__all__), "each name of hitplanes is in one group of the page"


def test_every_public_name_has_a_docstring() -> None:
    without = [where for where, thing, _ in public_members() if not (api_page.doc_of(thing))]
    assert not without


VAGUE = re.compile(r"\b(object|Any|Mapping|Callable|Sequence|Iterable|Ints|Floats|Bools|Reals)\b")
"""Types that do not tell what a parameter is."""


def others_of(homes: list[Any]) -> list[Any]:
    """What a docstring refers to: parameters that are those of another function."""
    names = re.findall(r"those of `(\w+)`", api_page.doc_of(homes[0]))
    return [getattr(place, name) for name in names for place in [*homes[1:], hitplanes] if hasattr(place, name)]


def test_every_parameter_is_told_or_plain_from_its_type() -> None:
    """Told: its name is a word of the docstring."""
    untold = []
    for where, thing, homes in public_members():
        if not callable(thing) or isinstance(thing, api_page.PROPERTIES) or where.split(".")[-1] in api_page.GIVEN:
            continue
        if inspect.isclass(thing) and (inspect.isabstract(thing) or issubclass(thing, Enum)):
            continue
        text = " ".join(api_page.doc_of(home) for home in [*homes, *others_of(homes)])
        for name, parameter in inspect.signature(thing).parameters.items():
            plain = parameter.annotation is not parameter.empty and not VAGUE.search(str(parameter.annotation))
            if name not in ("self", "cls", "_", "__") and not plain and not re.search(rf"\b{name}\b", text):
                untold.append(f"{where}({name})")
    assert not untold


def test_the_guide_of_the_tests_names_every_oracle_and_benchmark() -> None:
    told = text_of(ROOT / "tests" / "README.md")
    tests = ROOT / "tests"
    paths = [*tests.glob("oracle_*.py"), *tests.glob("bench/*.py")]
    assert len(paths) > 20
    missing = [name for name in (path.relative_to(ROOT).as_posix() for path in paths) if f"`{name}`" not in told]
    assert not missing


def test_the_guide_of_the_fixtures_counts_what_is_in_each_scene() -> None:
    fixtures = ROOT / "fixtures"
    told = re.findall(
        r"^\| `(\w+)` \| .* \| (\d+) \| (\d+) \| (\d+) \|$", text_of(fixtures / "README.md"), re.MULTILINE
    )
    assert sorted(row[0] for row in told) == sorted(path.parent.name for path in fixtures.glob("*/scene.json"))
    for name, *counts in told:
        scene = load_scene(fixtures / name)
        assert [len(scene.ids(role)) for role in ("hittable", "occluder", "mover")] == list(map(int, counts)), name


def test_the_guide_of_the_fixtures_names_every_script() -> None:
    fixtures = ROOT / "fixtures"
    told = text_of(fixtures / "README.md")
    for path in [*fixtures.glob("*.py"), *fixtures.glob("study/*.py")]:
        assert f"{path.relative_to(ROOT).as_posix()}`" in told, path
    for name in re.findall(r"`python (fixtures/[\w/]*\.py)", told):
        assert (ROOT / name).is_file(), name


def test_what_a_scene_pays_for_begins_as_its_script_says() -> None:
    script = runpy.run_path(str(ROOT / "fixtures" / "left_out.py"))
    assert text_of(ROOT / "fixtures" / "left_out.md").startswith(script["INTRO"])
