"""A scene that changes: planes, caches and journals follow, and every answer is that of the scene as it is."""

from __future__ import annotations

import copy
import pickle
import random
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import hypothesis.strategies as st
import numpy as np
import oracle_stack
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from some_of import some_of
from test_fire import Placements, expected, some_battle, some_sprite, some_volley, some_weapon, square, told

from hitplanes import ALL, Disc, Hits, InputError, Point, Role, Scene, Spans, Sprite, fire, load_scene
from hitplanes.planes.bits import bit_rows, cells
from hitplanes.planes.bits.bit_rows import WORD
from hitplanes.planes.bits.label_plane import LabelPlane
from hitplanes.planes.scene import items as items_module
from hitplanes.planes.scene import variants as variants_module
from hitplanes.planes.scene.derived import View
from hitplanes.weapons.fire import areas, spans
from hitplanes.weapons.kinds import weapon
from hitplanes.weapons.kinds.placements import filter_of

SPRITES = [
    *(some_sprite(random.Random(seed)) for seed in range(12)),
    Sprite.from_mask(np.zeros((3, 2), bool)),
    Sprite.from_mask([[True]]),
    Sprite.from_image(np.random.default_rng(0).integers(0, 256, (6, 15, 4), np.uint8), grid_wh=(5, 6)),
]
SIZE_WH, ORIGIN_XY = (24, 18), (-5, 7)

sprites = st.sampled_from(SPRITES)
places = st.tuples(st.integers(-9, 21), st.integers(3, 28), st.sampled_from([0, 0.5, -0.5, 1 / 256])).map(
    lambda p: (p[0] + p[2], p[1] - p[2])
)
poses = {
    "angle": st.sampled_from([0.0, 90.0, -180.0, 45.0, 30.0, 271.5]),
    "scale": st.sampled_from([1.0, 0.5, 2.0, 1.25]),
    "flip": st.sampled_from(["none", "x", "y", "xy"]),
    "layer": st.sampled_from([0, 1, -2]),
    "categories": st.sampled_from([0, 1, 2, 3, 6, 2**31 + 1]),
    "role": st.sampled_from([*["hittable"] * 4, *["occluder"] * 2, "mover", "background", "hud"]),
}


@dataclass
class Model:
    """One object as it was last told to be."""

    sprite: Sprite
    position: tuple[float, float]
    pose: dict[str, Any] = field(default_factory=dict)

    def item(self, number: int) -> oracle_stack.Item | None:
        """The object for the oracle; its pixels are those of a scene that never changed."""
        role, pose = self.pose["role"], dict(self.pose)
        if role not in ("hittable", "occluder"):
            return None
        owner = pose.pop("owner")
        mask, (x, y) = (fresh := Scene()).mask(fresh.add(self.sprite, self.position, **pose))
        pixels = frozenset((x + i, y + j) for j, i in np.argwhere(mask).tolist())
        return oracle_stack.Item(number, role == "occluder", pose["layer"], pose["categories"], owner, pixels)


def placed(scene: Scene, number: int) -> set[tuple[int, int]]:
    """World pixels of an object."""
    mask, (x, y) = scene.mask(number)
    return {(x + int(i), y + int(j)) for j, i in np.argwhere(mask)}


def set_pixels(found: dict[int, Spans]) -> dict[int, set[tuple[int, int]]]:
    """Pixels of objects, one by one."""
    return {number: set(map(tuple, spans.pixels().tolist())) for number, spans in found.items()}


def codes_of(items: Sequence[oracle_stack.Item]) -> np.ndarray:
    """The code plane, one pixel at a time: twice the number of the front item, and 1 more if one lies behind it."""
    labels = np.zeros(SIZE_WH[::-1], np.int64)
    order = oracle_stack.front_to_back(items)
    for (y, x), _ in np.ndenumerate(labels):
        here = [item for item in order if (x + ORIGIN_XY[0], y + ORIGIN_XY[1]) in item.pixels]
        labels[y, x] = 2 * (here[0].id + 1) + (len(here) > 1) if here else 0
    return labels


def all_told(hits: Hits) -> list[Any]:
    """Everything that can be asked of an answer."""
    samples = [column.tolist() for column in hits.samples_at()]
    rows = list(hits), hits.verdict_counts(), hits.by_owner(), hits.shares(), hits.margins()
    pixels = {key: spans.pixels().tolist() for key, spans in hits.pixels_at().items()}
    return [*rows, hits.why_not(), hits.blockers(), pixels, samples]


def default_bits(role: str) -> int:
    """Categories that a role gives to what is given none."""
    return ALL if role == "occluder" else 1


class ChangingScene(RuleBasedStateMachine):
    """Add, remove, move, set, save and load, and fire in between."""

    @initialize(size=st.sampled_from([SIZE_WH, SIZE_WH, SIZE_WH, None]), shared=st.lists(places, max_size=5))
    def begin(self, size: tuple[int, int] | None, shared: list[tuple[float, float]]) -> None:
        self.scene = Scene(size, ORIGIN_XY)
        self.models: dict[int, Model] = {}
        self.old: Hits | None = None
        for place in shared:
            self._add(SPRITES[0], place, {"role": "hittable", "layer": 0, "categories": 1}, None)

    def _add(self, sprite: Sprite, place: tuple[float, float], pose: dict[str, Any], owner: int | None) -> None:
        number = self.scene.add(sprite, place, owner=owner, **pose)
        assert number not in self.models, "an id was used again"
        self.models[number] = Model(sprite, place, {**pose, "owner": number if owner is None else owner})

    def _some(self, data: st.DataObject) -> list[int]:
        return data.draw(st.lists(st.sampled_from(sorted(self.models)), min_size=1, max_size=4, unique=True))

    @rule(sprite=sprites, place=places, pose=st.fixed_dictionaries(poses), data=st.data())
    def add(self, sprite: Sprite, place: tuple[float, float], pose: dict[str, Any], data: st.DataObject) -> None:
        pose = {**pose, "frame": data.draw(st.integers(0, sprite.frame_count - 1))}
        self._add(sprite, place, pose, data.draw(st.sampled_from([None, *self.models])))

    @precondition(lambda self: self.models)
    @rule(data=st.data())
    def remove(self, data: st.DataObject) -> None:
        ids = self._some(data)[:2]
        self.scene.remove(ids)
        for number in ids:
            del self.models[number]

    @precondition(lambda self: self.models)
    @rule(data=st.data(), together=st.booleans())
    def move(self, data: st.DataObject, together: bool) -> None:
        ids = self._some(data)
        targets = [data.draw(places)] * len(ids) if together else [data.draw(places) for _ in ids]
        self.scene.move(ids, targets[0] if together else targets)
        for number, place in zip(ids, targets, strict=True):
            self.models[number].position = place

    @precondition(lambda self: self.models)
    @rule(data=st.data(), names=st.lists(st.sampled_from(sorted(poses)), min_size=1, max_size=3, unique=True))
    def change(self, data: st.DataObject, names: list[str]) -> None:
        ids = self._some(data)
        values: dict[str, Any] = {}
        for name in names:
            one_for_all = name == "role" or data.draw(st.booleans())
            rows = [data.draw(poses[name])] * len(ids) if one_for_all else [data.draw(poses[name]) for _ in ids]
            values[name] = rows[0] if one_for_all else rows
            for number, value in zip(ids, rows, strict=True):
                pose = self.models[number].pose
                if name == "role" and "categories" not in names and pose["categories"] == default_bits(pose["role"]):
                    pose["categories"] = default_bits(value)
                pose[name] = value
        self.scene.set(ids, **values)

    @precondition(lambda self: self.models)
    @rule(data=st.data())
    def change_frame_and_owner(self, data: st.DataObject) -> None:
        ids = self._some(data)
        frames = [data.draw(st.integers(0, self.models[number].sprite.frame_count - 1)) for number in ids]
        owners = [data.draw(st.sampled_from(sorted(self.models))) for _ in ids]
        self.scene.set(np.array(ids), frame=frames, owner=owners)
        for number, frame, owner in zip(ids, frames, owners, strict=True):
            self.models[number].pose |= {"frame": frame, "owner": owner}

    @precondition(lambda self: self.models)
    @rule(data=st.data(), center=places, seed=st.integers(0, 99))
    def carve(self, data: st.DataObject, center: tuple[float, float], seed: int) -> None:
        """Carve what a shot hits, or a square out of some objects; the model takes sprites without cached masks."""
        x, y = map(round, center)
        pixels = {(x + i, y + j) for i in range(-3, 4) for j in range(-3, 4)}
        hits = fire(self.scene, Disc(4, pierce=seed % 2 == 0), center)
        asked = dict.fromkeys(self._some(data), pixels) if seed % 3 else set_pixels(hits.object_pixels())
        before = {number: placed(self.scene, number) for number in self.models}
        lost = self.scene.carve({n: sorted(own) for n, own in asked.items()} if seed % 3 else hits)
        for number, model in self.models.items():
            expected = before[number] - asked.get(number, set())
            assert placed(self.scene, number) == expected
            assert lost.get(number, 0) == len(before[number]) - len(expected)
            if number in lost:
                model.sprite = pickle.loads(pickle.dumps(self.scene.sprite(number)))

    @precondition(lambda self: self.models)
    @rule(data=st.data())
    def a_bad_change_changes_nothing(self, data: st.DataObject) -> None:
        """All at once or not at all: the last row is bad."""
        ids = self._some(data)
        version, content = self.scene.version, self.scene.content_hash()
        with pytest.raises(InputError, match="frame"):
            self.scene.set(ids, layer=7, role="mover", position_xy=(0, 0), frame=[*[0] * (len(ids) - 1), 99])
        with pytest.raises(InputError, match="scale"):
            self.scene.set(ids, categories=1, angle=12, scale=[*[1] * (len(ids) - 1), 1e9])
        assert (self.scene.version, self.scene.content_hash()) == (version, content)

    @rule(seed=st.integers(0, 500))
    def fire(self, seed: int) -> None:
        rng = random.Random(seed)
        where = [(0.0, 9.0), *(model.position for model in self.models.values())]
        volley = some_volley(rng, some_weapon(rng), where, len(self.models))
        self.old = self._compare(self.scene, volley)
        self.told = all_told(copy.copy(self.old))

    def _items(self) -> list[oracle_stack.Item]:
        return [item for n, model in sorted(self.models.items()) if (item := model.item(n)) is not None]

    def _compare(self, scene: Scene, volley: Placements) -> Hits:
        truth = expected(scene, volley, self._items())
        hits = volley.fired(scene, strategy="direct")
        assert told(hits) == truth
        if scene.bounds is not None:
            assert volley.fired(scene, strategy="built") == hits
        for broadphase in ("grid", "quadtree", "bvh"):
            assert volley.fired(scene, strategy="direct", broadphase=broadphase) == hits
            scene.derived.index(broadphase).read(scene.items).check()
        return hits

    @rule()
    def planes_are_up_to_date(self) -> None:
        items = self._items()
        for accept, blocked_by in ((ALL, ALL), (3, 6), (0, 2)):
            plane = self.scene.derived.label_plane(View(False, int(filter_of(accept, blocked_by)), ()))
            assert (plane is None) == (self.scene.bounds is None)
            if plane is None:
                return
            met = [item for item in items if item.categories & (blocked_by if item.occluder else accept)]
            labels, stack = plane.read(self.scene.items), self.scene.items.stack()
            ids = np.zeros(len(stack.rank_by_label), np.int64)
            ids[stack.rows + 1] = stack.ids + 1
            np.testing.assert_array_equal(2 * ids[labels >> 1] + (labels & 1), codes_of(met))
        whole = self.scene.planes()
        np.testing.assert_array_equal(whole.hittable, codes_of([i for i in items if not i.occluder]) >> 1)
        np.testing.assert_array_equal(whole.occluders, codes_of([i for i in items if i.occluder]) >> 1)
        assert not whole.hittable.flags.writeable

    @rule()
    def scene_counts_what_is_there(self) -> None:
        assert len(self.scene) == len(self.models) and self.scene.ids().tolist() == sorted(self.models)
        for role in Role:
            here = [n for n, model in sorted(self.models.items()) if model.pose["role"] == role.value]
            assert self.scene.ids(role).tolist() == here

    @precondition(lambda self: self.old is not None)
    @rule()
    def an_old_answer_stays(self) -> None:
        """Whatever is asked of an answer, and whenever, is told of the scene that was fired at."""
        assert self.old is not None
        hits = copy.copy(self.old)  # what was asked before is not kept
        hits._walked = None
        assert all_told(hits) == self.told

    @rule(seed=st.integers(0, 99), go_on=st.booleans())
    def save_and_load(self, seed: int, go_on: bool) -> None:
        with tempfile.TemporaryDirectory() as folder:
            self.scene.save(folder)
            loaded = load_scene(folder)
        assert loaded.content_hash() == self.scene.content_hash()
        rng = random.Random(seed)
        self._compare(loaded, some_volley(rng, some_weapon(rng), [(0.0, 9.0)], len(self.models)))
        if go_on:
            self.scene, self.old = loaded, None

    def teardown(self) -> None:
        if hasattr(self, "scene"):
            self.fire(1)
            self.planes_are_up_to_date()


QUIET: dict[str, Any] = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}


def test_a_changing_scene() -> None:
    """Fails at once, with the steps as they came; the long run takes minutes to make them few."""
    phases = [Phase.explicit, Phase.reuse, Phase.generate]
    few = settings(max_examples=20, stateful_step_count=25, phases=phases, **QUIET)
    run_state_machine_as_test(ChangingScene, settings=few)


@pytest.mark.long
def test_a_scene_that_changes_for_long() -> None:
    run_state_machine_as_test(ChangingScene, settings=settings(max_examples=320, stateful_step_count=60, **QUIET))


def crowd(count: int = 12) -> tuple[Scene, random.Random]:
    rng = random.Random(count)
    scene = Scene((40, 30))
    for number in range(count):
        role = "occluder" if number % 4 == 3 else "hittable"
        scene.add(some_sprite(rng), (rng.randint(0, 39), rng.randint(0, 29)), role=role, layer=number % 3)
    return scene, rng


def redrawn(scene: Scene) -> np.ndarray:
    """Codes of a plane that was never read before."""
    assert scene.bounds is not None
    return np.array(LabelPlane(scene.bounds).read(scene.items))


@pytest.mark.parametrize("rows", [0, 1, 3, 7])
def test_a_plane_that_lags_behind_what_the_journal_remembers(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(items_module, "JOURNAL_ROWS", rows)
    scene, rng = crowd()
    plane = scene.derived.label_plane()
    assert plane is not None
    whole = plane.read(scene.items).size
    forgotten = caught_up = 0
    for _ in range(60):
        changes = rng.randint(1, 5)
        for _ in range(changes):
            scene.move(rng.randrange(12), (rng.randint(0, 39), rng.randint(0, 29)))
        labels = plane.read(scene.items)
        np.testing.assert_array_equal(labels, redrawn(scene))
        forgotten += changes > rows and plane.redrawn == whole
        caught_up += plane.redrawn < whole
        assert changes <= rows or plane.redrawn == whole
    assert forgotten > 0 or rows == 7
    assert caught_up > 0 or rows == 0


def test_one_change_of_more_than_the_journal_remembers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(items_module, "JOURNAL_ROWS", 3)
    scene, _ = crowd()
    plane = scene.derived.label_plane()
    assert plane is not None
    plane.read(scene.items)
    scene.move(range(12), (5, 5))
    np.testing.assert_array_equal(plane.read(scene.items), redrawn(scene))
    scene.move(0, (9, 9))
    np.testing.assert_array_equal(plane.read(scene.items), redrawn(scene))
    assert plane.redrawn < redrawn(scene).size


def test_only_what_changed_is_drawn_anew() -> None:
    scene = Scene((100, 100))
    ids = [scene.add(square(5), (10 * i, 10 * i)) for i in range(9)]
    plane = scene.derived.label_plane()
    assert plane is not None
    plane.read(scene.items)
    assert plane.redrawn == 100 * 100
    plane.read(scene.items)
    assert plane.redrawn == 0
    scene.move(ids[4], (44, 40))
    assert plane.cost(scene.items) == 2 * 25
    plane.read(scene.items)
    assert plane.redrawn == 2 * 25
    for role in ("mover", "background", "hud"):
        scene.add(square(50), role=role)
    plane.read(scene.items)
    assert plane.redrawn == 0
    np.testing.assert_array_equal(plane.read(scene.items), redrawn(scene))


def test_masks_no_longer_in_use_are_thrown_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows stay right over many compactions of the atlas, and a stack that was handed out keeps its masks."""
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    scene, rng = crowd()
    atlases, largest = {id(scene.items.atlas): scene.items.atlas}, 0
    for _ in range(40):
        before = scene.items.stack()
        masks = [before.mask(place).copy() for place in range(len(before))]
        scene.set(rng.sample(range(12), 3), angle=[rng.uniform(0, 360) for _ in range(3)], scale=rng.choice([1, 1.5]))
        volley = some_volley(rng, Disc(5), [(20, 15)], 12)
        assert told(volley.fired(scene, strategy=rng.choice(["direct", "built"]))) == expected(scene, volley)
        for place, mask in enumerate(masks):
            np.testing.assert_array_equal(before.mask(place), mask)
        atlas = scene.items.atlas
        atlases[id(atlas)] = atlas
        in_use = {variant.uid: variant.mask.size for variant in scene.items.variants}
        assert atlas.live == sum(in_use.values())
        assert atlas.used <= 2 * atlas.live
        largest = max(largest, atlas.used)
    assert len(atlases) > 5 and largest > 0


def test_a_removed_mask_that_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variants_module, "ATLAS_SLACK_BYTES", 0)
    scene = Scene((9, 9))
    for _ in range(20):
        a, b = scene.add(SPRITES[-2], (4, 4)), scene.add(square(4), (3, 3))
        assert fire(scene, Point(), (4, 4)).object.tolist() == [b]
        scene.remove(b)
        assert fire(scene, Point(), (4, 4)).object.tolist() == [a]
        scene.remove([a])
        assert not fire(scene, Disc(9), (4, 4), strategy="built")
    assert scene.items.atlas.live == 0 and scene.items.atlas.used <= 17


@pytest.fixture(scope="module")
def in_whole_parts() -> list[tuple[Placements, Scene, str, Hits]]:
    """Volleys, what they are fired at, how, and what they hit."""
    battles = [(battle.volley, battle.scene()) for battle in map(some_battle, range(0, 240, 8))]
    ways = [(v, s, how) for v, s in battles for how in ("direct", "built", "spans")]
    return [(volley, scene, how, volley.fired(scene, strategy=how)) for volley, scene, how in ways]


@pytest.mark.parametrize("samples, pairs", some_of([(1, 1), (7, 10), (40, 3), (2**18, 1), (3, 2**21)], 2))
def test_the_size_of_the_parts_changes_no_row(
    in_whole_parts: list[tuple[Placements, Scene, str, Hits]], samples: int, pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(areas, "CHUNK_PAIRS", pairs)
    monkeypatch.setattr(spans, "CHUNK_PAIRS", pairs)
    monkeypatch.setattr(areas, "PLACEMENTS_AT_ONCE", samples)
    monkeypatch.setattr(bit_rows, "WORDS_AT_ONCE", max(samples, WORD))
    monkeypatch.setattr(cells, "PAIRS_AT_ONCE", pairs)
    monkeypatch.setattr(weapon, "PATTERNS_BYTES_MOST", 10 * samples)
    monkeypatch.setattr(spans, "CHUNK_SAMPLES", samples)
    for number, (volley, scene, how, whole) in enumerate(in_whole_parts):
        assert volley.fired(scene, strategy=how) == whole, f"{number=} {how}"
    assert sum(len(whole) for *_, whole in in_whole_parts) > 100


def removed_owner() -> Scene:
    scene = Scene((9, 9))
    a, b = scene.add(square(1), (1, 1)), scene.add(square(1), (2, 1))
    scene.set(a, owner=b)
    scene.remove(b)
    return scene


def one_object(sprite: object, categories: Sequence[str] = (), bits: int = 1) -> Scene:
    scene = Scene((9, 9), categories=categories)
    scene.add(sprite, (4, 4), categories=bits)
    return scene


FAINT = np.full((3, 3, 4), 100, np.uint8)
SAVED = {
    "an owner that was removed": removed_owner,
    "a threshold of alpha": lambda: one_object(Sprite.from_image(FAINT, alpha_threshold=50)),
    "a category named like a bit": lambda: one_object(square(1), ["bit 2"], 4),
}


@pytest.mark.parametrize("what", SAVED)
def test_saved_and_loaded(what: str) -> None:
    scene = SAVED[what]()
    with tempfile.TemporaryDirectory() as folder:
        scene.save(folder)
        assert load_scene(folder).content_hash() == scene.content_hash()


def test_a_wrong_number_of_flips() -> None:
    scene, _ = crowd(3)
    with pytest.raises(InputError, match="flip"):
        scene.set([0, 1, 2], flip=["x", "y"])
