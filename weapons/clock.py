"""A simulation at a fixed rate under pictures at any other: which steps are due now, and what is left of the next."""

from __future__ import annotations

import warnings

from planes.arrays import integer, real

__all__ = ["FixedStep"]

NANOSECONDS = 10**9
"""In a second: time is counted in these, and parts of a step in as many parts of it, both whole."""

ELAPSED_MAX = 10**6
"""Longest time between two calls, s (12 days): in nanoseconds it is whole in float64, with bits to spare."""


class FixedStep:
    """Turn the time between pictures into whole steps of a simulation.

    How many steps there are depends on the sum of the times alone, each rounded to whole nanoseconds, however it is cut
    into pictures: what happens at a tick is the same at 30 pictures a second and at 144.

        clock = FixedStep(240)
        while playing:
            for tick in clock.advance(seconds_since_last_picture):
                simulate(tick)  # 1 / 240 s
            draw(clock.fraction)  # so far from the last step to the next

    Parameters
    ----------
    rate_hz : steps a second, a whole number
    most : steps that one call gives at most; None for all that are due. A simulation that takes longer than the time
        that it simulates owes ever more steps. With a limit it runs slower instead: whole steps beyond it are dropped
        with a RuntimeWarning that says how many, and counted in `dropped`

    Attributes
    ----------
    tick : steps given so far
    dropped : steps dropped so far

    Raises
    ------
    InputError
        Naming the argument.

    References
    ----------
    Fiedler, "Fix your timestep!" (2004).
    """

    def __init__(self, rate_hz: int, *, most: int | None = None) -> None:
        self.rate_hz = integer("rate_hz", rate_hz, 1, NANOSECONDS)
        self.most = None if most is None else integer("most", most, 1, ELAPSED_MAX * NANOSECONDS)
        self.tick = 0
        self.dropped = 0
        self._rest = 0

    def advance(self, elapsed_s: float) -> range:
        """Let time pass and give the ticks of the steps that are due, the first of all being 0.

        Parameters
        ----------
        elapsed_s : since the last call, s

        Raises
        ------
        InputError
            If it is no finite number, or runs backwards, or is longer than 12 days.
        """
        passed = round(real("elapsed_s", elapsed_s, 0, ELAPSED_MAX) * NANOSECONDS)
        due, self._rest = divmod(self._rest + passed * self.rate_hz, NANOSECONDS)
        steps = due if self.most is None else min(due, self.most)
        first = self.tick
        self.tick += steps
        if steps < due:
            self.dropped += due - steps
            message = f"FixedStep: dropped {due - steps} of {due} steps that were due at tick {self.tick}"
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        return range(first, self.tick)

    @property
    def fraction(self) -> float:
        """Part of a step, in [0, 1), that has passed since the last: between its state and the next to draw."""
        return self._rest / NANOSECONDS
