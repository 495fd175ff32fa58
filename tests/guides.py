"""The guides: which pages they are, and their sections, examples, headings and links."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
ROOMS = ("planes", "weapons", "tests", "fixtures")
PAGES = [ROOT / "README.md", *sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.md"))]
"""All pages of the repository."""

WRITTEN = {ROOT / "weapons" / "API.md", ROOT / "fixtures" / "left_out.md", *ROOT.glob("fixtures/study/**/*.md")}
"""Pages that scripts write: their tests compare them with what the scripts say."""

GUIDES = [path for path in PAGES if path not in WRITTEN]
README, WORLD, SHOT, RAYS, SPEED, GLOSSARY = (
    ROOT / name
    for name in (
        "README.md", "planes/README.md", "weapons/README.md", "weapons/RAYS.md", "weapons/SPEED.md",
        "weapons/GLOSSARY.md",
    )
)  # fmt: skip

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Example(NamedTuple):
    """A Python block of a guide, its place among them, and what it prints: the text block that follows at once."""

    guide: Path
    number: int
    code: str
    shown: str


def text_of(guide: Path) -> str:
    return guide.read_text(encoding="utf-8")


def name_of(guide: Path) -> str:
    return guide.relative_to(ROOT).as_posix()


def section(guide: Path, heading: str) -> str:
    """What stands under a heading of the second level."""
    return text_of(guide).split(f"\n## {heading}\n")[1].split("\n## ")[0]


def blocks(text: str, language: str) -> list[str]:
    return [code for kind, code in FENCE.findall(text) if kind == language]


def prose(text: str) -> str:
    """A page without its blocks."""
    return FENCE.sub("", text)


def examples(guide: Path) -> list[Example]:
    text, found = text_of(guide), []
    for block in FENCE.finditer(text):
        if block[1] == "python":
            after = FENCE.match(text, len(text) - len(text[block.end() :].lstrip("\n")))
            shown = after[2] if after and after[1] == "text" else ""
            found.append(Example(guide, len(found), block[2], shown))
    return found


def anchors(text: str) -> set[str]:
    """Names by which a link leads to the headings of a page, as GitHub makes them."""
    found: list[str] = []
    for heading in re.findall(r"^#{1,6} +(.*?) *$", prose(text), flags=re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        same = sum(1 for other in found if re.fullmatch(rf"{re.escape(slug)}(-\d+)?", other))
        found.append(f"{slug}-{same}" if same else slug)
    return set(found)


def links(text: str) -> list[str]:
    """Where the links and pictures of a page lead to, but for those to other sites."""
    bare = re.sub(r"`[^`\n]*`", "", prose(text))
    return [link for link in re.findall(r"\]\(([^)\s]+)\)", bare) if not re.match(r"[a-z]+:", link)]


def broken(guide: Path) -> list[str]:
    """Links of a page that lead to no file of the repository, or to no heading of it."""
    wrong = []
    for link in links(text_of(guide)):
        file, _, heading = link.partition("#")
        path = (guide.parent / file).resolve() if file else guide
        if not path.is_relative_to(ROOT) or not path.exists() or (heading and heading not in anchors(text_of(path))):
            wrong.append(link)
    return wrong
