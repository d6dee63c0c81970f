"""Certification of a controller or a client against the protocol document."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scaraspec.api.certificates import Certification, calibrated, write_package
from scaraspec.api.run_folder import RunFolder, RunFolderError, earlier_results
from scaraspec.judge.verdicts import Verdict
from scaraspec.operating_system import state_directory
from scaraspec.report.model import Results, Role
from scaraspec.suite.client.harness.access import DriverAccess
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.client.harness.attended import Attended
from scaraspec.suite.controller.harness.access import UrlAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.earlier_sitting import difference
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.operator import Operator
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import Options
from scaraspec.transports.connect import resolve_url
from scaraspec.user_message import UserMessage, sentence_of

if TYPE_CHECKING:
    from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
    from scaraspec.suite.engine.run import Run


class StartError(Exception):
    """The subject could not be used at the start of the run; one sentence for the user.

    Nothing was tested, and no folder is left.
    """


class IncompleteFilesError(Exception):
    """A run has ended, but its recording, a report or the package could not be written.

    Attributes:
        results: The results of the run.
    """

    def __init__(self, results: Results, problem: str) -> None:
        super().__init__(problem)
        self.results = results


@dataclass(frozen=True, slots=True)
class Progress:
    """Callbacks that show the progress of a run.

    Attributes:
        case_begins: Called with each case before it runs.
        case_ends: Called with each outcome and the number of outcomes so far.
        say: Called with sentences for the user, such as that a user's setting was restored.
        begun: Called before the first case with the measured round trip in seconds.
    """

    case_begins: Callable[[Case], None] = lambda _case: None
    case_ends: Callable[[Outcome, int], None] = lambda _outcome, _count: None
    say: Callable[[str], None] = lambda _sentence: None
    begun: Callable[[float], None] = lambda _round_trip_s: None


_SILENT = Progress()


def plan(options: Options, role: Role = Role.CONTROLLER) -> Sequence[Case]:
    """Return the cases that a run with these options considers; nothing is sent.

    `suite.engine.plan.skip_reason` gives the reason why a case is skipped.

    Raises:
        SuiteError: The suite is defective.
    """
    return collect(options, role)


def controller(  # noqa: PLR0913 - independent options of a run
    url: str,
    *,
    password: str = "password",  # noqa: S107 - the document's example (L109)
    ics: Ics | None = None,
    options: Options | None = None,
    patience_s: float = 10.0,
    out: Path | None = None,
    certification: Certification | None = None,
    state_dir: Path | None = None,
    lock_timeout_s: float = 0.0,
    wait_for_s: float = 0.0,
    reproduction: str = "",
    progress: Progress = _SILENT,
    interruption: Interruption | None = None,
    operator: Operator | None = None,
) -> Results:
    """Certify the controller at a URL: the suite acts as the client.

    Settings and files of the controller are restored at the end, after an interruption, and by the
    next run after a crash. Without `options` only queries are sent.

    Args:
        url: The link, such as ``tcp://192.168.1.2`` or ``serial:///dev/ttyUSB0?baud=115200``.
        password: The password for the login over TCP.
        ics: What the controller claims; None for no claims.
        options: Requirements, hazards, seed and depth.
        patience_s: Longest wait of one case in seconds, for example for the next minute of the
            controller's clock.
        out: Folder for results, reports and recording; None to write nothing.
        certification: Makes the run a certification, with its options; needs `out`. The tester is
            calibrated first, unless `certificates.calibrated` has done it.
        state_dir: Folder of the journals; None for the user's state directory.
        lock_timeout_s: How long to wait for another run against this controller, in seconds.
        wait_for_s: How long to wait until the controller accepts a connection, in seconds.
        reproduction: The command that repeats the run, for the report.
        progress: Callbacks.
        interruption: Ends the run early; its `ask` may be called by a signal handler.
        operator: Replaces hooks that the ICS does not define; None without an operator.

    Raises:
        CalibrationError: The tester is not fit for a certification.
        LinkError: The URL is invalid.
        ControllerBusyError: Another run uses the controller.
        JournalError: The journal cannot be used.
        RecoveryError: Changes of an interrupted run cannot be restored.
        RunFolderError: `out` contains results of an earlier run.
        StartError: The subject could not be used at the start of the run.
        IncompleteFilesError: The recording or a report could not be written.
        SuiteError: The suite is defective.
        OSError: `out` cannot be created.
    """
    certification = calibrated(certification) if certification else None
    with prepared(
        url,
        password=password,
        ics=ics or Ics(),
        options=certification.options if certification else options or Options(),
        patience_s=patience_s,
        out=out,
        redact=certification is not None,
        state_dir=state_dir,
        lock_timeout_s=lock_timeout_s,
        wait_for_s=wait_for_s,
        reproduction=reproduction,
        progress=progress,
        interruption=interruption,
        operator=operator,
    ) as (run, files):
        return write_results(run, run.results(), files, certification)


@contextmanager
def prepared(  # noqa: PLR0913 - independent options of a run
    url: str,
    *,
    password: str,
    ics: Ics,
    options: Options,
    patience_s: float,
    out: Path | None,
    redact: bool,
    state_dir: Path | None,
    lock_timeout_s: float,
    wait_for_s: float,
    reproduction: str,
    progress: Progress,
    interruption: Interruption | None,
    operator: Operator | None = None,
) -> "Iterator[tuple[Run[ControllerUnderTest], RunFolder]]":
    """Prepare a run against the controller at a URL, and its folder; nothing has been sent.

    The journal of the controller is locked until the end of the context. Arguments and exceptions
    are those of `controller`; with `redact` the recording has masked passwords.
    """
    from scaraspec.suite.engine.run import Run  # noqa: PLC0415 - imports pytest and hypothesis

    access = UrlAccess(url, patience_s)
    folder = state_dir or state_directory()
    with (
        Journal.of(resolve_url(url), folder, wait_s=lock_timeout_s) as journal,
        RunFolder(
            out,
            Role.CONTROLLER,
            ics,
            needs_login=access.needs_login,
            redact=redact,
        ) as files,
    ):
        access.wait_until_reachable(wait_for_s)
        adapter = ControllerAdapter(
            access,
            ics,
            password.encode(),
            replace(options, attended=operator is not None),
            link=url,
            capture=files.capture,
            replay=reproduction,
            journal=journal,
            say=progress.say,
            operator=operator,
        )
        run = Run(
            adapter,
            take=files.record,
            report=progress.case_ends,
            announce=progress.case_begins,
            begun=progress.begun,
            interruption=interruption,
        )
        yield run, files


def client(  # noqa: PLR0913 - independent options of a run
    driver: str | Attended,
    *,
    answer_timeout_s: float = 10.0,
    ics: Ics | None = None,
    options: Options | None = None,
    out: Path | None = None,
    certification: Certification | None = None,
    reproduction: str = "",
    progress: Progress = _SILENT,
    interruption: Interruption | None = None,
) -> Results:
    """Certify a client: the suite acts as the controller.

    Args:
        driver: The command line of the client's driver, or `Attended` for a client that an operator
            works with, which is closed at the end.
        answer_timeout_s: How long the driver may take to answer an operation, in seconds.
        ics: What the client claims; None for no claims.
        options: Requirements, seed and depth.
        out: Folder for results, reports and recording; None to write nothing. An attended run
            continues an earlier one in the same folder, with the same ICS and options.
        certification: As for `controller`; needs a driver.
        reproduction: The command that repeats the run, for the report.
        progress: Callbacks.
        interruption: Ends the run early.

    Raises:
        CalibrationError: The tester is not fit for a certification.
        DriverError: The driver cannot be started.
        RunFolderError: `out` contains results of an earlier run that this one cannot continue.
        StartError: The subject could not be used at the start of the run.
        IncompleteFilesError: The recording or a report could not be written.
        ResultsError: The results of an earlier attended run cannot be read.
        SuiteError: The suite is defective.
        OSError: `out` cannot be created.
    """
    from scaraspec.suite.engine.run import Run  # noqa: PLC0415 - imports pytest and hypothesis

    certification = calibrated(certification) if certification else None
    access = DriverAccess(driver, answer_timeout_s) if isinstance(driver, str) else driver
    adapter = ClientAdapter(
        access,
        ics or Ics(),
        certification.options if certification else options or Options(attended=access.attended),
        link=driver if isinstance(driver, str) else f"{access.host}:{access.port}",
        replay=reproduction,
    )
    with ExitStack() as resources:
        resources.enter_context(closing(access))
        earlier = earlier_results(out) if access.attended else None
        if earlier:
            _require_same(earlier, adapter, out)
        files = resources.enter_context(
            RunFolder(
                out, Role.CLIENT, adapter.ics, earlier=earlier, redact=certification is not None
            )
        )
        run = Run(
            replace(adapter, capture=files.capture),
            earlier=earlier,
            take=files.record,
            report=progress.case_ends,
            announce=progress.case_begins,
            interruption=interruption,
        )
        return write_results(run, run.results(), files, certification)


def _require_same(earlier: Results, adapter: ClientAdapter, out: Path | None) -> None:
    """Require that a run can continue an earlier one in its folder.

    Raises:
        RunFolderError: The run tests another build, or has other claims or settings.
    """
    if differs := difference(earlier, adapter):
        raise RunFolderError(
            UserMessage(
                "{folder} contains results of a run with other settings: {difference}; continue "
                "it with the same ICS and options, or name another folder",
                folder=out,
                difference=differs,
            )
        )


def write_results(
    run: "Run[Any]", results: Results, files: RunFolder, certification: Certification | None = None
) -> Results:
    """Write the results of a run that has ended to its folder, and return them.

    A certification also writes its package.

    Raises:
        StartError: The subject could not be used at the start of the run.
        IncompleteFilesError: The recording or a report could not be written.
    """
    if run.start_failure and results.role is Role.CONTROLLER and not results.counts[Verdict.FAIL]:
        files.discard()
        raise StartError(run.start_failure)
    with run.interruption:  # a signal takes effect after the reports are written
        try:
            files.finish(results)
        except RunFolderError as error:
            raise IncompleteFilesError(results, sentence_of(error)) from None
        if certification and files.path:
            try:
                write_package(certification, files.path, run.adapter.ics)
            except OSError as error:
                text = "the package cannot be written: {error}"
                raise IncompleteFilesError(results, UserMessage(text, error=error)) from None
    return results
