"""Threads of compiled kernels: in whatever parts a batch is worked on, its rows are those of numpy, in one thread."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from test_areas import some_scene, some_shots

from hitplanes import Disc, InputError, Point, Rounds, Spread, Stencil, Weapon, fire, use_jit, use_threads
from hitplanes.planes.common import backend

WEAPONS: list[Weapon] = [
    Point(), Disc(40), Disc(9, pierce=True), Stencil(["#.#", "..#"]), Rounds(Disc(5), 3, (3, 2)),
    Rounds(Spread(Disc(3, pierce=True), 5, 9), 2, (3, 2)),
]  # fmt: skip


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    yield
    use_threads(None)
    use_jit(None)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_rows_hang_on_no_number_of_threads(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor on the room that there is for them at first."""
    pytest.importorskip("numba")
    from hitplanes.planes.jit import areas, bit_rows

    rng = np.random.default_rng(threads)
    monkeypatch.setattr(areas, "COMPILED", areas.COMPILED._replace(thread=1.0))
    monkeypatch.setattr(bit_rows, "ROOM", 0)
    monkeypatch.setattr(bit_rows, "ROOM_LEAST", 1)
    used: set[str] = set()
    inner = bit_rows._filled
    monkeypatch.setattr(bit_rows, "_filled", lambda *work: used.add(threading.current_thread().name) or inner(*work))
    rows = 0
    for _ in range(6):
        scene = some_scene(rng, count=40)
        for weapon in WEAPONS:
            at, how = some_shots(rng, scene, 90)
            use_jit(False)
            truth = fire(scene, weapon, at, strategy="direct", **how)
            use_jit(True)
            use_threads(threads)
            for strategy in ("direct", "built"):
                assert fire(scene, weapon, at, strategy=strategy, **how) == truth, f"{weapon} {strategy} {how}"
            rows += len(truth)
    assert rows > 500 and (len(used) > 1) == (threads > 1)


def test_parts_come_in_order_and_each_is_worth_its_thread() -> None:
    use_threads(4)
    assert backend.in_parts(10, 1, lambda first, last: (first, last)) == [(0, 2), (2, 5), (5, 7), (7, 10)]
    assert backend.in_parts(10, 4, lambda first, last: (first, last)) == [(0, 5), (5, 10)]
    assert backend.in_parts(10, 5.5, lambda first, last: (first, last)) == [(0, 10)]
    assert backend.in_parts(0, 1, lambda first, last: (first, last)) == [(0, 0)]
    use_threads(1)
    assert backend.in_parts(10, 1, lambda first, last: threading.current_thread()) == [threading.current_thread()]


@pytest.mark.parametrize("bad", [0, 1])
def test_an_error_in_a_part_is_that_of_the_call(bad: int) -> None:
    def work(first: int, last: int) -> int:
        if (first > 0) == bad:
            raise ValueError(f"part {bad}")
        return first

    use_threads(2)
    with pytest.raises(ValueError, match=f"part {bad}"):
        backend.in_parts(2, 1, work)
    assert backend.in_parts(2, 1, lambda first, last: first) == [0, 1]


@pytest.mark.parametrize("count", [0, -1, 1.5, True, "2", 10**9])
def test_threads_are_a_number(count: object) -> None:
    with pytest.raises(InputError, match=r"^count: expected"):
        use_threads(count)  # type: ignore[arg-type]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes are forked off")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_forked_process_makes_its_own_threads() -> None:
    use_threads(2)
    assert backend.in_parts(2, 1, lambda first, last: first) == [0, 1]
    child = os.fork()
    if not child:
        os._exit(0 if backend.in_parts(2, 1, lambda first, last: first) == [0, 1] else 1)
    assert os.waitpid(child, 0)[1] == 0
