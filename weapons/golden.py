"""A pytest plugin: the fixture `hits_golden` compares hits with those that were accepted before.

What is heavy is imported when the fixture is called: a run that does not use it pays nothing.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from weapons.goldstale import Collected
    from weapons.hits import Hits

__all__ = ["HitsGolden", "hits_golden"]

GOLDENS = "goldens"
"""Folder of goldens, beside the test files."""

SENT, TOLD = "hitplanes", "hits_golden"
"""Under which a worker of pytest-xdist sends what it knows of tests, and a report tells what became of goldens."""

RECORDS = pytest.StashKey[list[dict[str, Any]]]()
"""Of a test: what became of its goldens."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("hitplanes", "hitplanes: goldens of hits")
    update = "write the goldens of hits_golden that are missing or differ, and list them"
    stale = "list the goldens that no test uses any more, and fail if there are some"
    group.addoption("--hits-update", action="store_true", help=update)
    group.addoption("--hits-stale", action="store_true", help=stale)


def pytest_configure(config: pytest.Config) -> None:
    """Begin to record a run."""
    collected = None
    if config.getoption("hits_stale"):
        from weapons.goldstale import Collected

        # with --lf pytest hides tests of a file from us, so that none can be said to be gone
        collected = Collected(GOLDENS, whole=not config.getoption("lf", False))
        config.pluginmanager.register(collected, "hitplanes-collected")
    config.pluginmanager.register(Run(config, collected), "hitplanes-run")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Send what became of goldens along with the report, which comes from any worker."""
    report = yield
    records = item.stash.get(RECORDS, None)
    if records:
        report.__dict__[TOLD] = records
    return report


@pytest.fixture
def hits_golden(request: pytest.FixtureRequest) -> HitsGolden:
    """Compare hits with those accepted before: hits_golden(hits). Accept them with --hits-update."""
    return HitsGolden(request.node)


class HitsGolden:
    """What the fixture `hits_golden` is: annotate it with this."""

    def __init__(self, item: pytest.Item) -> None:
        self._item = item
        self._names: set[str | None] = set()

    def __repr__(self) -> str:
        return f"<hits_golden of {self._item.name}>"

    def __call__(self, hits: Hits, *, name: str | None = None, planes: Mapping[str, object] | None = None) -> None:
        """Fail unless hits are what they were when they were accepted: the hits, whole planes, and the picture.

        Parameters
        ----------
        hits : as `fire` returned them, the scene unchanged since
        name : tells several goldens of a test apart
        planes : arrays (h, w) or (h, w, channels) of your own, by name, which are compared exactly, too

        Raises
        ------
        InputError
            If an argument is not what is expected, or a name comes again.
        """
        __tracebackhide__ = True
        from weapons.goldcheck import Call, safe_name, settle

        self._take(name)
        item, config = self._item, self._item.config
        inside = item.nodeid.partition("::")[2]
        base = item.path.parent / GOLDENS / item.path.stem / safe_name(inside, name)
        here, update = config.invocation_params.dir, bool(config.getoption("hits_update"))
        call = Call(item.nodeid, f"{item.path.name}::{inside}", name, base, config.rootpath, here, update)
        outcome = settle(call, hits, {} if planes is None else planes)
        record = {"golden": str(base), "outcome": outcome.kind, "failure": outcome.failure}
        item.stash.setdefault(RECORDS, []).append(record)
        if outcome.message:
            pytest.fail(outcome.message)

    def _take(self, name: str | None) -> None:
        """Refuse a name that this test has used."""
        from planes.arrays import InputError
        from planes.schema import Text

        if name is not None:
            Text().check("name", name)
        if name in self._names:
            again = "a second golden without one" if name is None else f"{name!r} again"
            raise InputError(f"name: expected another for each golden of a test, got {again}")
        self._names.add(name)


class Run:
    """What a run knows of its goldens, and what it leaves and tells at its end."""

    def __init__(self, config: pytest.Config, collected: Collected | None) -> None:
        self._config, self._collected = config, collected
        self._outcomes: dict[str, dict[str, Any]] = {}
        self._updated: set[Path] = set()
        self._passed: set[str] = set()
        self._unpassed: set[str] = set()
        self._stale: list[Path] = []
        self._page: Path | None = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take what a report tells; of a test that runs again the last counts."""
        for record in getattr(report, TOLD, ()):
            self._outcomes[record["golden"]] = record
            if record["outcome"] == "updated":
                self._updated.add(Path(record["golden"]))
        if self._collected is not None and report.when == "call" and report.passed:
            self._passed.add(report.nodeid)
        elif not report.passed:
            self._unpassed.add(report.nodeid)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Take what a worker knows of the tests there are."""
        sent = getattr(node, "workeroutput", {}).get(SENT)
        if sent is not None and self._collected is not None:
            self._collected.add(sent)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Leave the page, and find what is stale; a worker sends what it knows."""
        if hasattr(self._config, "workerinput"):
            if self._collected is not None:
                self._config.workeroutput[SENT] = self._collected.to_json()  # type: ignore[attr-defined]
            return
        if self._outcomes:
            self._leave_page()
        if self._collected is not None:
            from weapons.goldstale import stale_goldens

            passed = self._passed - self._unpassed
            self._stale = stale_goldens(self._collected, GOLDENS, set(self._outcomes), passed)
            if self._stale and session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Tell what was written, where failures are shown, and what is stale."""
        updated, stale = ([self._shown(base) for base in sorted(bases)] for bases in (self._updated, self._stale))
        if not (updated or stale or self._page):
            return
        terminalreporter.section("hits_golden")
        for bases, what in ((updated, "updated"), (stale, "that no test uses (--hits-stale)")):
            if bases:
                terminalreporter.line(f"{_counted(len(bases))} {what}:")
            for base in bases:
                terminalreporter.line(f"  {base}.json")
        if self._page is not None:
            failed = sum(record["outcome"] == "failed" for record in self._outcomes.values())
            terminalreporter.line(f"{_counted(failed)} failed: {self._shown(self._page)}")

    def _leave_page(self) -> None:
        """Replace what an earlier run left by the failures of this one; without any, take it away."""
        from weapons.goldpage import FOLDER, PAGE, replace_page

        records = [record["failure"] for record in self._outcomes.values() if record["outcome"] == "failed"]
        failures = sorted(records, key=lambda failure: (failure["test"], failure["golden"]))
        folder = self._config.rootpath / FOLDER
        if replace_page(folder, failures):
            self._page = folder / PAGE

    def _shown(self, path: Path) -> str:
        from weapons.goldpage import relative

        return relative(path, self._config.invocation_params.dir)


def _counted(n: int) -> str:
    return f"{n} golden" + ("" if n == 1 else "s")
