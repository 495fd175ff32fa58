"""Rows of the columns of a scene: nothing tells which one an object has, and those of what is gone come again."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from test_label_plane import add_one, change
from test_moves import told

from hitplanes import (
    Beam,
    Box,
    Disc,
    History,
    InputError,
    Laser,
    Pistol,
    Point,
    Projectile,
    Scene,
    fire,
    load_scene,
    prepare,
    report_of,
    sees,
)
from hitplanes.planes.scene import items, objects
from hitplanes.planes.scene.render import draw_view

SIZE, DOT = (24, 15), np.ones((3, 3), np.bool_)
AT = np.stack(np.meshgrid(np.arange(-12, 26, 5), np.arange(-6, 24, 4)), axis=-1).reshape(-1, 2)
AREAS = (Point(), "labels"), (Point(), "spans"), (Disc(3), "visible"), (Disc(3), "tiles"), (Box(7, 2), "integers")
RAYS = (
    (Pistol(30), "walk"),
    (Pistol(30), "cast"),
    (Pistol(30), "march"),
    (Laser(30, width=2), "cast"),
    (Laser(30), "walk"),
)
SHELTERED = Disc(9, line_of_sight="all")


def scrambled() -> Scene:
    """A scene that gives out rows in another order than ids."""
    scene = Scene(SIZE, (-6, 2))
    scene.items.table.height, scene.items.table._free = 9, [4, 0, 7, 2, 8, 1, 6, 3, 5]
    return scene


def shots(scene: Scene) -> list[Any]:
    """What is hit, by every way, and all that is told of some of it."""
    found: list[Any] = [fire(scene, weapon, AT, strategy=way) for weapon, way in (*AREAS, *RAYS)]
    found += [fire(scene, weapon, AT) for weapon in (SHELTERED, Beam(20, 3), Projectile(9, radius=1))]
    found += [fire(scene, Disc(3), AT, prefilter="polygon", broadphase=phase) for phase in ("grid", "quadtree", "bvh")]
    area, ray = found[3], found[9]
    whole = [area.shares(), found[11].shares(), ray.passes.to_rows(), found[12].passes.to_rows()]
    whole += [ray.stops_at(shot).to_rows() for shot in range(0, len(AT), 5)]
    more = [[hits.why_not(k), hits.blockers(k)] for hits in (area, ray) for k in range(0, len(AT), 9)]
    owners = [[*hits.by_owner()] for hits in (area, ray, found[12])]
    return [found, whole, more, owners, sees(scene, AT[:9], AT[9:18]).tolist()]


def said(scene: Scene) -> list[Any]:
    """All that a scene says of its objects."""
    ids = scene.ids()
    columns = scene.position, scene.angle, scene.layer, scene.role, scene.owner, scene.categories_of, scene.box
    values = [column(ids).tolist() for column in (*columns, scene.cost, scene.velocity, scene.frame, scene.scale)]
    names = [scene.name_of(item) for item in range(scene.items.count)]
    planes = scene.planes()
    pictures = planes.hittable.tolist(), planes.occluders.tolist(), planes.movers.tolist(), planes.hud.tolist()
    drawn = draw_view(scene.items, (-6, 2, 17, 16)).tolist()
    return [ids.tolist(), values, names, told(scene.items.stack()), pictures, drawn, scene.content_hash(), repr(scene)]


@examples(40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32))
def test_the_row_of_an_object_is_told_nowhere(jit: bool, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Two scenes that change alike, with other rows, answer alike: present and past, copies and what is kept ready."""
    monkeypatch.setattr(items, "ROWS_SLACK", 1024 * (seed % 2))
    scenes = Scene(SIZE, (-6, 2)), scrambled()
    histories = [History(scene, interpolate=True) for scene in scenes]
    ready = [[prepare(scene, weapon) for weapon in (Disc(2), Pistol(20), Laser(20, width=2))] for scene in scenes]
    draws = [np.random.default_rng(seed) for _ in scenes]
    for step in range(7):
        for scene, history, rng in zip(scenes, histories, draws, strict=True):
            for _ in range(4 if step == 0 else 1):
                add_one(scene, rng)
            for _ in range(int(rng.integers(3))):
                change(scene, rng)
            ids = scene.ids()
            scene.move(ids, rng.uniform(-9, 20, (len(ids), 2)))
            scene.set(ids[:2], velocity_xy=rng.uniform(-3, 3, 2), cost=int(rng.integers(3)))
            history.record()
        assert len({str(scene.carve(fire(scene, Disc(2), (9, 9)))) for scene in scenes}) == 1
        first, second = ([weapon.fire((3, 4)) for weapon in own] for own in ready)
        assert first == second == [fire(scenes[0], hits.weapon, (3, 4)) for hits in first]
        if step % 3 == 0:
            assert said(scenes[0]) == said(scenes[1]) and shots(scenes[0]) == shots(scenes[1])
    for tick in (0, 2.5, 3, 5.75):
        past = [history.at(tick) for history in histories]
        assert said(past[0]) == said(past[1]) == said(past[1].copy())
        assert shots(past[0]) == shots(past[1])
    made = [copy.deepcopy(histories[1]), pickle.loads(pickle.dumps(histories[1]))]
    assert said(histories[0].at(2.5)) == said(made[0].at(2.5)) == said(made[1].at(2.5))
    again = [scenes[1].copy(), pickle.loads(pickle.dumps(scenes[1]))]
    for other in again:
        change(other, np.random.default_rng(seed + 1))
    change(scenes[0], np.random.default_rng(seed + 1))
    assert said(scenes[0]) == said(again[0]) == said(again[1])


def test_saved_scenes_and_reports_are_those_of_other_rows(tmp_path: Path) -> None:
    scenes, made = (Scene(SIZE, (-6, 2)), scrambled()), []
    for number, scene in enumerate(scenes):
        rng = np.random.default_rng(4)
        for _ in range(8):
            add_one(scene, rng)
        scene.remove([1, 4])
        scene.set(5, owner=4)
        add_one(scene, rng)
        scene.save(tmp_path / str(number))
        made.append(report_of(scene, [fire(scene, Disc(6), (4, 5)), fire(scene, Laser(20), (0, 5))]))
    assert made[0] == made[1]
    files = [sorted(path.iterdir()) for path in (tmp_path / "0", tmp_path / "1")]
    assert [path.name for path in files[0]] == [path.name for path in files[1]]
    assert [path.read_bytes() for path in files[0]] == [path.read_bytes() for path in files[1]]
    assert said(load_scene(tmp_path / "1"))[:2] == said(scenes[0])[:2]


# Rows that come again


def test_columns_have_as_many_rows_as_there_were_objects_at_once() -> None:
    scene = Scene()
    for turn in range(500):
        scene.add(DOT, (turn, 0))
        if turn >= 20:
            scene.remove(turn - 20)
    table = scene.items.table
    assert (table.count, table.height, table.living) == (500, 21, 20)
    assert scene.ids().tolist() == list(range(480, 500))
    assert scene.position(scene.ids())[:, 0].tolist() == list(range(480, 500))
    assert max(len(getattr(scene.items, name)) for name in ("id", "sprites", "names", "_box")) <= 32
    assert scene.copy().items.table.height == 20


def test_an_object_in_the_row_of_another_has_its_own_place_in_the_stack() -> None:
    """With the same box, so that nothing but the row tells that the order may be another one."""
    scene = Scene((9, 9))
    back, front = scene.add(DOT, (4, 4)), scene.add(DOT, (4, 4), layer=5)
    assert scene.items.stack().ids.tolist() == [front, back]
    scene.remove(front)
    low = scene.add(DOT, (4, 4), layer=-5)
    assert scene.items.table.row(low) == 1
    assert scene.items.stack().ids.tolist() == [back, low]
    assert fire(scene, Point(), (4, 4)).object.tolist() == [back]
    scene.remove(back)
    last = scene.add(DOT, (4, 4), layer=-5)
    assert scene.items.stack().ids.tolist() == [last, low], "of one layer the later one is in front"


@pytest.mark.parametrize("strategy", ["labels", "visible", "tiles", "spans"])
def test_what_came_and_went_unseen_hides_no_removal(strategy: str) -> None:
    scene = Scene((9, 9))
    seen = scene.add(DOT, (4, 4))
    assert fire(scene, Point(), (4, 4), strategy=strategy).object.tolist() == [seen]
    start = scene.version
    scene.remove(seen)
    scene.remove(scene.add(DOT, (4, 4)))
    assert not fire(scene, Point(), (4, 4), strategy=strategy)
    assert scene.items.decided > start
    scene.remove(scene.add(DOT, (4, 4)))
    assert not scene._items.unmade, "of what was never seen nothing is left"


def test_one_is_moved_before_its_mask_is_made_in_the_row_of_another() -> None:
    scene = Scene((30, 9))
    label = scene.derived.label_plane()
    assert label is not None
    first = scene.add(np.ones((5, 5), np.bool_), (4, 4))
    label.read(scene.items)
    scene.remove(first)
    other = scene.add(DOT, (9, 4))
    scene.move(other, (20, 4))
    scene.move(np.array([other]), np.array([[22.0, 4.0]]))
    assert np.argwhere(label.read(scene.items)).min(axis=0).tolist() == [3, 21]
    assert scene.box(other).tolist() == [21, 3, 23, 5]


@pytest.mark.parametrize("turned", [True, False])
def test_a_scene_that_was_full_once_is_as_small_as_others(turned: bool) -> None:
    """Rows are laid out anew; what followed the changes of items follows them from there."""
    scene, ways = Scene((13000, 9)), ("tiles", "visible", "labels", "integers")
    history = History(scene)
    ids = [scene.add(DOT, (4 * k, 4)) for k in range(3000)]
    phase = scene.derived.index("grid")

    def hit() -> list[list[int]]:
        at = [(4 * k, 4) for k in (2, 1500, 2990, 2999)]
        found = [fire(scene, Point(), at, strategy=way).object.tolist() for way in ways if way != "tiles"]
        phase.read(scene.items).check()
        return [*found, fire(scene, Point(), at, prefilter="box", broadphase="grid").object.tolist()]

    assert hit() == [[2, 1500, 2990, 2999]] * 4
    if turned:
        scene.set(ids[2999], angle=90)
    scene.remove(ids[:2990])
    assert hit() == [[2990, 2999]] * 4
    new = scene.add(DOT, (6000, 4))
    assert hit() == [[new, 2990, 2999]] * 4
    assert (scene.items.table.height, len(scene), list(scene)[-1]) == (11, 11, new)
    history.record()
    assert {len(column) for column in history.at(0).items._snapshot.columns.values()} == {11}
    assert history.at(0).position(ids[2990]).tolist() == [4 * 2990, 4]


def test_angles_between_ticks_are_those_of_the_same_object_in_copies_too() -> None:
    """Equal lists of two moments of a copy may be of other objects."""
    scene = Scene()
    history = History(scene, interpolate=True)
    first, second = scene.add(DOT, angle=10), scene.add(DOT, (20, 0), angle=20)
    history.record(0)
    scene.remove(first)
    scene.set(second, angle=10)
    scene.add(DOT, (40, 0), angle=20)
    history.record(1)
    for each in (history, copy.deepcopy(history), pickle.loads(pickle.dumps(history))):
        assert each.at(0.5).angle(second) == 15


def test_equal_columns_of_moments_are_pickled_once() -> None:
    scene = Scene()
    for k in range(300):
        scene.add(DOT, (k, 0))
    history, sizes = History(scene), []
    for tick in range(40):
        scene.move(5, (tick, 5))
        history.record()
        sizes.append(len(pickle.dumps(history)))
    assert sizes[-1] < 6 * sizes[0]


@pytest.mark.parametrize("kind", [bytes, bytearray])
def test_scenes_of_one_pickle_that_share_its_arrays_change_apart(kind: Any) -> None:
    scene, buffers = Scene((30, 30)), list[Any]()
    for k in range(4):
        scene.add(DOT, (5 * k + 3, 5))
    data = pickle.dumps(scene, 5, buffer_callback=buffers.append)
    raw = [kind(buffer.raw()) for buffer in buffers]
    one, other = (pickle.loads(data, buffers=raw) for _ in range(2))
    one.remove(1)
    one.move(2, (9, 9))
    assert (list(one), list(other), other.position(2).tolist()) == ([0, 2, 3], [0, 1, 2, 3], [13, 5])


# Names and numbers of what is gone


def test_names_outlive_their_objects() -> None:
    scene = Scene()
    names = ["hittable 0", "goblin", "occluder 2", "hittable 7", "hud 4", "occluder  5", "", "mover 7"]
    for name in names:
        scene.add(DOT, role=name.split(" ")[0] if name[-1:] in "024" and name else "hittable", name=name or None)
    names[6] = "hittable 6"
    scene.set(0, role="mover")
    scene.rename(7, "last")
    names[7] = "last"
    history = History(scene)
    history.record()
    scene.remove([0, 1, 2, 3, 4, 5, 6])
    scene.add(DOT, name="new")
    for each in (scene, scene.copy(), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert [each.name_of(item) for item in range(9)] == [*names, "new"]
    assert [history.at(0).name_of(item) for item in range(8)] == names
    assert [history.at(0).copy().name_of(item) for item in range(8)] == names


def test_ids_that_are_left_out_have_no_name() -> None:
    scene = Scene()
    scene.items.table.skip_to(3)
    assert (scene.add(DOT), scene.name_of(2), scene.name_of(3), len(scene)) == (3, "", "hittable 3", 1)
    assert list(scene) == [3] and 2 not in scene
    with pytest.raises(InputError, match=r"ids\[1\]: expected an object in the scene, got 2, which was removed"):
        scene.position([3, 2])


def test_too_many_at_a_time_and_too_many_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "ITEMS_MAX", 3)
    monkeypatch.setattr(objects, "IDS_MAX", 5)
    scene = Scene()
    for _ in range(3):
        scene.add(DOT)
    with pytest.raises(InputError, match="objects: expected at most 3 at a time, got one more"):
        scene.add(DOT)
    scene.remove([0, 2])
    assert [scene.add(DOT), scene.add(DOT)] == [3, 4]
    scene.remove(1)
    before = said(scene)
    with pytest.raises(InputError, match="objects: expected at most 5 in the life of a scene, got one more"):
        scene.add(DOT)
    assert said(scene) == before


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [1, 2, 0, 3], [0, 2, 1, 3]])
def test_rising_ids_in_any_rows_are_placed_at_once(order: list[int], jit: bool) -> None:
    scene = Scene()
    scene.items.table.height, scene.items.table._free = 4, order[::-1]
    ids = [scene.add(DOT) for _ in range(4)]
    assert [scene.items.table.row(item) for item in ids] == order
    xy, start = np.arange(8.0).reshape(4, 2), scene.version
    scene.move(np.array(ids), xy)
    assert scene.position(ids).tolist() == xy.tolist()
    assert scene.box(ids)[:, :2].tolist() == (xy - 1).tolist() == scene.items._box[order][:, :2].tolist()
    assert scene.items.changed_rows(start).tolist() == [0, 1, 2, 3]  # type: ignore[union-attr]
    scene.remove(2)
    with pytest.raises(InputError, match=r"ids\[2\]: expected an object in the scene, got 2, which was removed"):
        scene.move(np.array(ids), xy + 1)
    assert scene.position([0, 1, 3]).tolist() == xy[[0, 1, 3]].tolist()
