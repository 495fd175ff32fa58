"""A scene folder to a Scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from planes.arrays import InputError, within
from planes.scene import Scene
from planes.scenefile import FILE_NAME, FileObject, folder_of, read_scene, scene_folder

__all__ = ["load_scene"]


def load_scene(folder: str | Path) -> Scene:
    """Read a scene folder: scene.json and the PNGs that it names. The path of scene.json will do, too.

    Weapons and shots of the file are kept as plain JSON in `scene.weapons` and `scene.shots`.

    Raises
    ------
    InputError
        Naming the file, the section, the row and the field.
    """
    path = scene_folder(folder_of(folder))
    file = read_scene(path)
    with within(str(path / FILE_NAME)):
        x, y = file.origin_xy
        scene = Scene(file.size_wh, (x, y), categories=file.categories, name=file.name)
        scene.weapons, scene.shots = file.weapons, file.shots
        numbered = [entry.id is not None for entry in file.objects]
        if any(numbered) and not all(numbered):
            raise InputError("objects: expected an id for each object or for none, got some")
        entries = sorted(file.objects, key=lambda entry: entry.id) if any(numbered) else file.objects  # type: ignore[arg-type,return-value]
        for entry in entries:
            _add_entry(scene, entry)
        _set_owners(scene, entries)
        return scene


def _add_entry(scene: Scene, entry: FileObject) -> None:
    with within(entry.place):
        if entry.id is not None:
            if entry.id < scene.items.count:
                raise InputError(f"id: expected each id once, got {entry.id} again")
            scene.items.skip_to(entry.id)
        scene.add(
            entry.sprite,
            entry.position_xy,
            role=entry.role,
            name=entry.name,
            categories=entry.categories,
            **entry.pose,
        )


def _set_owners(scene: Scene, entries: Sequence[FileObject]) -> None:
    for item, entry in zip(scene.ids().tolist(), entries, strict=True):
        if entry.owner is not None:
            with within(f"{entry.place}: owner"):
                owner = scene.find(entry.owner) if isinstance(entry.owner, str) else entry.owner
                if entry.id is not None and owner >= scene.items.count:
                    scene.items.skip_to(owner + 1)  # the owner was removed before the scene was saved
                scene.set(item, owner=owner)
