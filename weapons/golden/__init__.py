"""A pytest plugin: the fixture `hits_golden` compares hits with those that were accepted before.

Heavy modules are imported when the fixture is first called, so a run that does not use it stays fast.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ..fire.hits import Hits
    from .check import Collected


WORKER_KEY = "hitplanes"  # key under which a worker of pytest-xdist sends the tests that it collected
REPORT_KEY = "hits_golden"  # attribute of a test report that holds the outcomes of the test's goldens
RECORDS = pytest.StashKey[list[dict[str, Any]]]()  # key of the outcomes in the stash of a test


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options --hits-update and --hits-stale."""
    group = parser.getgroup("hitplanes", "hitplanes: goldens of hits")
    update = "write the goldens of hits_golden that are missing or differ, and list them"
    stale = "list the goldens that no test uses any more, and fail if there are any"
    group.addoption("--hits-update", action="store_true", help=update)
    group.addoption("--hits-stale", action="store_true", help=stale)


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugins that record this run."""
    collected = None
    if config.getoption("hits_stale"):
        from .check import Collected

        # with --lf pytest does not report all tests of a file, so we cannot say that one is gone
        collected = Collected(whole=not config.getoption("lf", False))
        config.pluginmanager.register(collected, "hitplanes-collected")
    config.pluginmanager.register(Run(config, collected), "hitplanes-run")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Attach the outcomes of goldens to the report, which any worker may send."""
    report = yield
    records = item.stash.get(RECORDS, None)
    if records:
        report.__dict__[REPORT_KEY] = records
    return report


@pytest.fixture
def hits_golden(request: pytest.FixtureRequest) -> HitsGolden:
    """Compare hits with the accepted ones: hits_golden(hits). --hits-update accepts the new ones."""
    return HitsGolden(request.node)


class HitsGolden:
    """Type of the fixture `hits_golden`, for annotations."""

    def __init__(self, item: pytest.Item) -> None:
        self._item = item
        self._names: set[str | None] = set()

    def __repr__(self) -> str:
        return f"<hits_golden of {self._item.name}>"

    def __call__(
        self, hits: Hits, *, name: str | None = None, planes: Mapping[str, object] | None = None,
        only: str | None = None, tolerance_pixels: int = 0, tolerance_px: int = 0,
    ) -> None:  # fmt: skip
        """Fail unless the hits, the planes of their scene and their picture equal the accepted ones.

        Parameters
        ----------
        hits : returned by `fire`; the scene must not have changed since
        name : needed if a test has several goldens
        planes : further arrays (h, w) or (h, w, channels) to compare exactly, by name
        only : "hits" keeps and compares nothing but the rows of hits: which objects each shot hit, and which pixels
        tolerance_pixels : of hits alone, most pixels by which the number of hit pixels of an object may differ
        tolerance_px : of hits alone, farthest that the first hit pixel of an object may move, px

        Raises
        ------
        InputError
            If the scene has changed since the shots; then if an argument is wrong, or the test has used the name
            before.
        """
        __tracebackhide__ = True
        from .check import Call, settle
        from .file import check_present, tolerance_of

        check_present(hits)
        tolerance = tolerance_of(only, tolerance_pixels, tolerance_px)
        self._take(name)
        call = Call.of(self._item, name, only, tolerance)
        outcome = settle(call, hits, {} if planes is None else planes)
        record = {"golden": str(call.base), "outcome": outcome.kind, "failure": outcome.failure}
        self._item.stash.setdefault(RECORDS, []).append(record)
        if outcome.message:
            pytest.fail(outcome.message)

    def _take(self, name: str | None) -> None:
        """Remember a name, and refuse one that this test has used before."""
        from hitplanes.planes.common.checks import InputError
        from hitplanes.planes.common.tables import Text

        if name is not None:
            Text().check("name", name)
        if name in self._names:
            again = "a second golden without one" if name is None else f"{name!r} again"
            raise InputError(f"name: expected another for each golden of a test, got {again}")
        self._names.add(name)


class Run:
    """Plugin that gathers the outcomes of goldens, and reports them when the run ends."""

    def __init__(self, config: pytest.Config, collected: Collected | None) -> None:
        self._config, self._collected = config, collected
        self._outcomes: dict[str, dict[str, Any]] = {}
        self._updated: set[Path] = set()
        self._passed: set[str] = set()
        self._unpassed: set[str] = set()
        self._stale: list[Path] = []
        self._page: Path | None = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take the outcomes of a report; if a test runs again, the last run counts."""
        for record in getattr(report, REPORT_KEY, ()):
            self._outcomes[record["golden"]] = record
            if record["outcome"] == "updated":
                self._updated.add(Path(record["golden"]))
        if not report.passed:
            self._unpassed.add(report.nodeid)
        elif report.when == "call":
            self._passed.add(report.nodeid)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Add the tests that a worker collected."""
        sent = getattr(node, "workeroutput", {}).get(WORKER_KEY)
        if sent is not None and self._collected is not None:
            self._collected.add(sent)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Replace the page of failures and find stale goldens; a worker sends the tests that it collected."""
        if hasattr(self._config, "workerinput"):
            if self._collected is not None:
                self._config.workeroutput[WORKER_KEY] = self._collected.to_json()  # type: ignore[attr-defined]
            return
        if self._outcomes:
            from .check import FOLDER, PAGE, replace_page

            records = [record["failure"] for record in self._outcomes.values() if record["outcome"] == "failed"]
            failures = sorted(records, key=lambda failure: (failure["test"], failure["golden"]))
            folder = self._config.rootpath / FOLDER
            if replace_page(folder, failures):
                self._page = folder / PAGE
        if self._collected is not None:
            from .check import stale_goldens

            self._stale = stale_goldens(self._collected, set(self._outcomes), self._passed - self._unpassed)
            if self._stale and session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the updated goldens, the stale ones, and the path of the page of failures."""
        updated, stale = ([self._shown(base) for base in sorted(bases)] for bases in (self._updated, self._stale))
        if not (updated or stale or self._page):
            return
        from ..report.phrases import counted

        terminalreporter.section("hits_golden")
        for bases, what in ((updated, "updated"), (stale, "that no test uses (--hits-stale)")):
            if bases:
                terminalreporter.line(f"{counted(len(bases), 'golden')} {what}:")
            for base in bases:
                terminalreporter.line(f"  {base}.json")
        if self._page is not None:
            failed = sum(record["outcome"] == "failed" for record in self._outcomes.values())
            terminalreporter.line(f"{counted(failed, 'golden')} failed: {self._shown(self._page)}")

    def _shown(self, path: Path) -> str:
        from .check import printed

        return printed(path, self._config.invocation_params.dir)
