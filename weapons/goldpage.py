"""The folder of failed goldens: whose it is, what lies in it, and the page that shows it all."""

from __future__ import annotations

import html
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote

__all__ = ["FOLDER", "PAGE", "claimed", "note_files", "relative", "replace_page"]

FOLDER, PAGE, LIST, IGNORE = "hits-failures", "index.html", "files.txt", ".gitignore"

MARK = "hitplanes-failures/1: the files listed here are ours, and go with the next run that uses hits_golden"

STYLE = """
body { margin: 2rem auto; max-width: 110rem; padding: 0 1.5rem; font: 16px/1.5 system-ui, sans-serif;
  background: #18191d; color: #eef0f4; }
h1, h2 { font-weight: 600; } h2 { margin: 3rem 0 .25rem; overflow-wrap: anywhere; }
a { color: #8ec5ff; } .where, figcaption { color: #9ea4ae; font-size: .9rem; }
pre { background: #23262c; padding: 1rem; overflow-x: auto; border-left: 4px solid #ff2828; white-space: pre-wrap; }
.row { display: flex; flex-wrap: wrap; gap: 1rem; } figure { margin: 1rem 0; flex: 1 1 24rem; min-width: 0; }
img { max-width: 100%; image-rendering: pixelated; background: #000; }
"""


def claimed(folder: Path) -> bool:
    """Make the folder, with our mark in it; False if it is there and is not ours, or cannot be made.

    The mark comes with the folder, in one step: of several processes one makes it, and the others see it whole.
    """
    if _is_ours(folder):
        return True
    aside = folder.with_name(f"{folder.name}.{os.getpid()}.part")
    with suppress(OSError):
        aside.mkdir()
        (aside / LIST).write_text(MARK + "\n", encoding="utf-8")
        (aside / IGNORE).write_text("*\n", encoding="utf-8")
        with suppress(OSError):
            folder.rmdir()  # an empty one is nobody's
        aside.rename(folder)
        note_files(folder, [IGNORE])
    for name in (LIST, IGNORE):
        with suppress(OSError):
            (aside / name).unlink()
    with suppress(OSError):
        aside.rmdir()
    return _is_ours(folder)


def note_files(folder: Path, names: Iterable[str]) -> None:
    """List files as ours, before they are written."""
    with (folder / LIST).open("a", encoding="utf-8", newline="\n") as file:
        file.write("".join(f"{name}\n" for name in names))


def replace_page(folder: Path, failures: Sequence[dict[str, Any]]) -> bool:
    """Leave the page of this run's failures and their files; what an earlier run left is deleted.

    Without failures the folder goes, unless somebody else has put something there.

    Parameters
    ----------
    failures : "test", "golden", "lines", "folder", "texts" (files) and "rows" of (caption, file) of each

    Returns
    -------
    whether there is a page
    """
    if not _is_ours(folder):
        return False
    ours = [PAGE] if failures else []
    for failure in failures:
        files = [*failure["texts"], *(file for row in failure["rows"] for _, file in row)]
        ours += [f"{failure['folder']}/{file}" for file in files]
    _delete(folder, [name for name in _listed(folder) if name not in ours and name != IGNORE])
    if failures:
        (folder / PAGE).write_text(_page(failures), encoding="utf-8", newline="\n")
        (folder / LIST).write_text("\n".join([MARK, IGNORE, *ours]) + "\n", encoding="utf-8", newline="\n")
        return True
    _delete(folder, [IGNORE, LIST])
    with suppress(OSError):
        folder.rmdir()
    return False


def relative(path: Path, start: Path) -> str:
    """A path from a place, with slashes; whole where there is none between them, as from drive to drive."""
    try:
        return os.path.relpath(path, start).replace(os.sep, "/")
    except ValueError:
        return path.as_posix()


def _delete(folder: Path, names: Iterable[str]) -> None:
    """Delete files of the folder, and the folders in it that are empty then."""
    for name in names:
        path = folder / name
        if path.parent.is_symlink():
            continue
        with suppress(OSError):
            path.unlink()
        if path.parent != folder:
            with suppress(OSError):
                path.parent.rmdir()


def _page(failures: Sequence[dict[str, Any]]) -> str:
    """One static page, which needs nothing but the files beside it."""
    count = f"{len(failures)} golden" + ("" if len(failures) == 1 else "s") + " failed"
    parts = [f"<h1>{count}</h1>"]
    if len(failures) > 1:
        links = (f'<li><a href="#{i}">{html.escape(f["test"])}</a></li>' for i, f in enumerate(failures))
        parts.append(f"<ol>{''.join(links)}</ol>")
    parts += [_section(i, failure) for i, failure in enumerate(failures)]
    head = f'<meta charset="utf-8"><title>{count}</title><style>{STYLE}</style>'
    body = "\n".join(parts)
    return f'<!doctype html>\n<html lang="en">\n<head>{head}</head>\n<body>\n{body}\n</body>\n</html>\n'


def _section(number: int, failure: dict[str, Any]) -> str:
    """One failure: words first, then pictures side by side."""
    folder = quote(failure["folder"])
    texts = ", ".join(f'<a href="{folder}/{quote(name)}">{html.escape(name)}</a>' for name in failure["texts"])
    rows = "".join(f'<div class="row">{"".join(_figure(folder, *one) for one in row)}</div>' for row in failure["rows"])
    return (
        f'<h2 id="{number}">{html.escape(failure["test"])}</h2>\n'
        f'<p class="where">{html.escape(failure["golden"])} ({texts})</p>\n'
        f"<pre>{html.escape(chr(10).join(failure['lines']))}</pre>\n{rows}"
    )


def _figure(folder: str, caption: str, name: str) -> str:
    path, told = f"{folder}/{quote(name)}", html.escape(caption)
    image = f'<a href="{path}"><img src="{path}" alt="{told}"></a>'
    return f"<figure><figcaption>{told}</figcaption>{image}</figure>"


def _is_ours(folder: Path) -> bool:
    try:
        with (folder / LIST).open(encoding="utf-8") as file:
            return file.readline().startswith("hitplanes-failures/")
    except (OSError, ValueError):
        return False


def _listed(folder: Path) -> list[str]:
    """Files that are ours: in the folder, or one folder deeper."""
    names = (folder / LIST).read_text(encoding="utf-8").splitlines()[1:]
    paths = [(name, PurePosixPath(name)) for name in dict.fromkeys(names)]
    return [
        name
        for name, path in paths
        if 0 < len(path.parts) <= 2 and ".." not in path.parts and not path.is_absolute() and "\\" not in name
    ]
