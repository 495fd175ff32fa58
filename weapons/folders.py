"""Folders that are written into: new ones, or those that an earlier run of the same word wrote."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from planes.arrays import InputError

__all__ = ["cleared", "empty_folder", "own_folder"]


def empty_folder(folder: Path) -> bool:
    """Make the folder, unless it is there and empty; tells whether it was made."""
    try:
        folder.mkdir()
        return True
    except FileExistsError:
        if not folder.is_dir():
            raise InputError(f"folder: expected a new folder, got the file {folder}") from None
        try:
            held = sorted(path.name for path in folder.iterdir())
        except OSError as error:
            raise InputError(f"folder: cannot read {folder}: {error.strerror}") from error
        if held:
            raise InputError(f"folder: expected a new or empty folder, got {folder} with {held[0]!r} in it") from None
        return False
    except OSError as error:
        raise InputError(f"folder: cannot make {folder}: {error.strerror}") from error


def own_folder(folder: Path, names: Sequence[str]) -> None:
    """Make the folder, or take one that holds nothing but files of these names.

    Raises
    ------
    InputError
        If it cannot be made, or holds something else.
    """
    try:
        folder.mkdir(exist_ok=True)
        held = sorted(path.name for path in folder.iterdir() if path.name not in names)
    except FileExistsError:
        raise InputError(f"--output: expected a folder, got the file {folder}") from None
    except OSError as error:
        raise InputError(f"--output: cannot make {folder}: {error.strerror}") from error
    if held:
        told = f"got {folder} with {held[0]!r} in it"
        raise InputError(f"--output: expected a new folder, or that of an earlier run, {told}")


def cleared(folder: Path, names: Sequence[str]) -> None:
    """Remove files of these names, where there are any.

    Raises
    ------
    InputError
        If one cannot be removed.
    """
    for name in names:
        try:
            (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"--output: cannot remove {folder / name}: {error.strerror}") from error
