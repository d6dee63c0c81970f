"""A certification within a pytest session.

pytest runs the cases with the other tests, `Run` does everything else. With pytest-xdist the worker
that runs the cases begins and ends the run, and sends its conclusion to the main process.
"""

import json
import signal
import sys
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import pytest
from _pytest.runner import runtestprotocol
from _pytest.terminal import TerminalReporter
from rich.console import Console

from scaraspec.api import certify
from scaraspec.api.certify import IncompleteFilesError, Progress, StartError
from scaraspec.api.run_folder import RunFolder, require_unused
from scaraspec.cli.certify.options import reproduction
from scaraspec.cli.certify.preparation import user_errors
from scaraspec.cli.certify.running import confirm_motion, end_on_signals
from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus, Reason, Verdict
from scaraspec.operating_system import ending_signals
from scaraspec.pytest_plugin.settings import PREFIX, Given, read, usage_errors
from scaraspec.report import terminal
from scaraspec.report.files import write_whole
from scaraspec.report.model import Results, Role
from scaraspec.report.sanitizing import visible, visible_line
from scaraspec.suite.engine.case import MARK, case_of, is_case
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.collection import CASES
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.pytest_session import forget_cases

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
    from scaraspec.suite.engine.run import Run

_GROUP: Final = "scaraspec_group"
_FIXTURE: Final = "scaraspec_subject"
_OUTPUT: Final = "scaraspec"
_FAILED: Final = (Verdict.FAIL, Verdict.ERROR)
_NO_ERROR: Final = (
    pytest.ExitCode.OK,
    pytest.ExitCode.TESTS_FAILED,
    pytest.ExitCode.NO_TESTS_COLLECTED,
)
_SKIPPED: Final = (Verdict.NONE, Verdict.INCONCLUSIVE)


def prepare(config: pytest.Config) -> None:
    """Add the cases to the session.

    Raises:
        pytest.UsageError: An option is wrong, or no controller is named.
    """
    given = read(config)
    if not given.url:
        raise pytest.UsageError(
            f"no controller: name it with {PREFIX}subject, such as tcp://192.168.1.2, or set url "
            "in the ICS file"
        )
    with usage_errors():
        options = given.settings.options()
        if given.settings.out and not hasattr(config, "workerinput"):
            require_unused(given.settings.out)
    folder = CASES[Role.CONTROLLER]
    forget_cases(Role.CONTROLLER)
    config.args += map(str, files_of(folder, options))  # of a folder, `python_files` would select
    collector = CaseCollector(Role.CONTROLLER, options, folder)
    config.pluginmanager.register(collector)
    config.pluginmanager.register(Certification(config, given, options, collector))


def files_of(folder: Path, options: Options) -> list[Path]:
    """Return the files of the cases, or those that name a selected requirement."""
    files = sorted(folder.glob("test_*.py"))
    if options.only is None or options.cases:
        return files
    words = [f'"{requirement}"' for requirement in options.only]
    return [file for file in files if any(w in file.read_text("utf-8") for w in words)]


class Conclusion(NamedTuple):
    """How a run has ended.

    Attributes:
        results: The results as JSON; empty if the run could not begin.
        problem: One sentence if something went wrong.
        exit_status: The exit status of pytest, unless another test has failed.
    """

    results: str
    problem: str
    exit_status: int


class Certification:
    """The pytest plugin object of a session that certifies a controller.

    Args:
        config: The configuration of the session.
        given: What the options say.
        options: What the run tries.
        collector: Collects the cases.
    """

    def __init__(
        self, config: pytest.Config, given: Given, options: Options, collector: CaseCollector
    ) -> None:
        self._config, self._given = config, given
        self._options, self._collector = options, collector
        self._resources = ExitStack()
        self._run: Run[ControllerUnderTest] | None = None
        self._files: RunFolder | None = None
        self._conclusion: Conclusion | None = None
        self._interrupted = self._ran = False
        self._failed_cases = 0
        shared = TemporaryDirectory(prefix="scaraspec-")
        config.add_cleanup(shared.cleanup)
        self._group = Path(shared.name) / "group.json"

    # ------------------------------------------------------------------ collection

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(
        self, session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
    ) -> Generator[None, Any, None]:
        """Add the requirements to the cases, and list the tests that use the controller."""
        for item in items:
            if is_case(item):
                case = case_of(item)
                item.user_properties += [("requirement", each) for each in case.requirements]
        yield
        own = [item for item in items if is_case(item)]
        if own:
            own.append(Restoration.from_parent(session, name="restore", certification=self))
            items.append(own[-1])
        if config.pluginmanager.has_plugin("timeout"):  # cases have their own limits
            for item in own:
                item.add_marker(pytest.mark.timeout(0))
        if group := getattr(config, "workerinput", {}).get(_GROUP):
            using = [item.nodeid for item in (*filter(_uses_fixture, items), *own)]
            write_whole(Path(group), json.dumps(using))

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Name the file in which a worker lists the tests that use the controller."""
        node.workerinput[_GROUP] = f"{self._group}"

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Any) -> Any:
        """Keep the tests that use the controller on one worker."""
        from scaraspec.pytest_plugin.scheduling import scheduler  # noqa: PLC0415 - needs xdist

        return scheduler(config, log, self._group)

    # ------------------------------------------------------------------ the cases

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> bool | None:
        """Run a case and report its outcome, however many attempts it took."""
        if not is_case(item):
            return None
        self._begin()
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        if self._run:
            runner = self._run.case_runner
            runner.pytest_runtest_protocol(item, nextitem)
            reports = reported(runner.outcomes[-1], runner.reports, item)
        else:
            assert self._conclusion
            item.add_marker(pytest.mark.skip(reason=self._conclusion.problem))
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def _begin(self) -> None:
        """Begin the run, at the first case."""
        if self._run or self._conclusion:
            return
        try:
            with user_errors():
                self._start()
        except Problem as problem:
            self._abandon(problem)

    def _start(self) -> None:
        given, settings, interruption = self._given, self._given.settings, Interruption()
        if not settings.yes:
            self._capture.suspend(in_=True)
            try:
                confirm_motion(self._collector.cases, self._options, given.statement)
            finally:  # between two tests only the input is captured
                self._capture.resume()
                self._capture.suspend(in_=False)
        run, self._files = self._resources.enter_context(
            certify.prepared(
                given.url,
                password=settings.password,
                ics=given.statement,
                options=self._options,
                patience_s=settings.patience,
                out=settings.out,
                redact=False,
                state_dir=settings.state_dir,
                lock_timeout_s=settings.wait_for_lock,
                wait_for_s=settings.wait_for,
                reproduction=reproduction(given.context, given.url),
                progress=Progress(say=self._say),
                interruption=interruption,
            )
        )
        self._run = run
        runner = run.case_runner
        runner.cases, runner.items = self._collector.cases, self._collector.items
        self._config.pluginmanager.register(runner)
        self._resources.enter_context(_ended_by_signals(interruption))
        run.begin()

    def _abandon(self, problem: Problem) -> None:
        """End a run that could not begin."""
        run, self._run = self._run, None
        if run:
            run.end()
        self._resources.close()
        wrong = problem.exit_status is ExitStatus.USAGE
        status = pytest.ExitCode.USAGE_ERROR if wrong else problem.exit_status
        self._conclusion = Conclusion("", f"{problem}", int(status))

    @property
    def _capture(self) -> Any:
        """The capture manager of pytest."""
        return self._config.pluginmanager.get_plugin("capturemanager")

    def _say(self, sentence: str) -> None:
        """Show a sentence at once."""
        with self._capture.global_and_fixture_disabled():
            sys.stderr.write(f"\n{visible(sentence)}\n")
            sys.stderr.flush()

    # ------------------------------------------------------------------ the end

    def pytest_keyboard_interrupt(self) -> None:
        """Note that the user has interrupted the session."""
        self._interrupted = True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count the cases that failed: other failures, also of the team's fixtures, are its own."""
        if report.failed and report.when != "teardown" and MARK in report.keywords:
            self._failed_cases += 1

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Note that the session runs tests."""
        self._ran = not self._config.getoption("collectonly")

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """End the run. Its conclusion gives the exit status, unless a test of the team has failed.

        Other errors of pytest keep their status.
        """
        self.end()
        conclusion = self._conclusion
        output: dict[str, Any] | None = getattr(self._config, "workeroutput", None)
        if output is not None:
            output[_OUTPUT] = conclusion and tuple(conclusion)
            return
        if not self._ran or session.exitstatus not in _NO_ERROR:
            return
        if session.testsfailed > self._failed_cases:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        elif conclusion:
            session.exitstatus = conclusion.exit_status
        else:
            session.exitstatus = int(ExitStatus.NOTHING_TESTED)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Take the conclusion of the worker that has run the cases."""
        if conclusion := getattr(node, "workeroutput", {}).get(_OUTPUT):
            self._conclusion = Conclusion(*conclusion)

    def pytest_terminal_summary(self, terminalreporter: TerminalReporter) -> None:
        """Print the results."""
        if not self._conclusion:
            return
        terminalreporter.section("scaraspec")
        if self._conclusion.results:
            terminal.show(Results.from_json(self._conclusion.results), Console())
        if self._conclusion.problem:
            terminalreporter.write_line(visible(self._conclusion.problem), red=True)
        elif out := self._given.settings.out:
            terminalreporter.write_line(f"{out}/report.html")

    def end(self) -> Sequence[str]:
        """End the run if this process has begun it, and write its results.

        Returns:
            What could not be restored.
        """
        run, self._run = self._run, None
        if not run or not self._files:
            return []
        with self._resources:
            run.end(interrupted=self._interrupted)
            results, problem = run.build_results(), ""
            status = results.verdict.exit_status
            try:
                certify.write_results(run, results, self._files)
            except (IncompleteFilesError, StartError) as error:
                problem = f"{error}"
                if status is not ExitStatus.NONCONFORMANT:
                    status = ExitStatus.INCONCLUSIVE
        self._conclusion = Conclusion(results.to_json(), problem, int(status))
        return [each.message for each in results.cases if each.reason is Reason.NOT_RESTORED]


class Restoration(pytest.Item):
    """The last test: it ends the run while the fixtures of the session exist, such as a simulator.

    Args:
        certification: The certification.
        arguments: The arguments of `pytest.Item`.
    """

    def __init__(self, certification: Certification, **arguments: Any) -> None:
        super().__init__(nodeid="scaraspec::restore", **arguments)
        self._certification = certification

    def runtest(self) -> None:
        """End the run; something that is left makes it inconclusive."""
        if left := self._certification.end():
            pytest.skip("; ".join(map(visible_line, left)))

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return how pytest names this test."""
        return self.path, None, self.name


def reported(
    outcome: Outcome, reports: Sequence[pytest.TestReport], item: pytest.Item
) -> Sequence[pytest.TestReport]:
    """Return the reports of the last attempt of a case, with the outcome of the case.

    Args:
        outcome: The outcome, which all attempts decide.
        reports: The reports: setup, call if the setup has passed, teardown.
        item: The case.
    """
    decisive = reports[-2]
    if outcome.verdict in _FAILED:
        seen = (("expected", outcome.expected), ("observed", outcome.observed))
        lines = (outcome.message, *(f"{name}: {value}" for name, value in seen if value))
        decisive.outcome, decisive.longrepr = "failed", "\n".join(map(visible_line, lines))
    elif outcome.verdict in _SKIPPED:
        decisive.outcome = "skipped"
        decisive.longrepr = (f"{item.path}", 0, f"Skipped: {visible_line(outcome.message)}")
    else:
        decisive.outcome, decisive.longrepr = "passed", None
    return reports


def _uses_fixture(item: pytest.Item) -> bool:
    return _FIXTURE in getattr(item, "fixturenames", ())


@contextmanager
def _ended_by_signals(interruption: Interruption) -> Iterator[None]:
    """Let signals end the run, not a step of it."""
    before = {number: signal.getsignal(number) for number in ending_signals()}
    end_on_signals(interruption)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
