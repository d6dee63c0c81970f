"""The pytest plugin: runs the suite with a team's own tests, in the team's pytest.

    pytest -p scaraspec.suite.plugin --pyargs scaraspec.suite.controller.cases --subject tcp://192.168.1.2

The fixtures `subject` and `line` are available to the team's own tests, too. The exit status is
that of the results, as for ``scaraspec certify``.
"""

import os
from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import pytest
from rich.console import Console

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import state_directory
from scaraspec.report import terminal
from scaraspec.report.model import Role
from scaraspec.suite.controller.harness.access import UrlAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.state.recovery import RecoveryError
from scaraspec.suite.engine.case import declare_mark, is_case
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import ControllerBusyError, Journal, JournalError
from scaraspec.suite.engine.plan import Options, hazards
from scaraspec.suite.engine.run import Run
from scaraspec.suite.engine.selection import parse_selection
from scaraspec.transports.connect import resolve_url
from scaraspec.transports.link import LinkError

_TEAM_FAILED: Final = pytest.StashKey[bool]()
_RUN: Final = pytest.StashKey[Run[ControllerUnderTest]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of ``scaraspec certify controller`` that a pytest run needs."""
    group = parser.getgroup("scaraspec", "certify a controller of the UISR4200S protocol")
    group.addoption("--subject", metavar="URL", help="the controller, as tcp://192.168.1.2")
    group.addoption(
        "--subject-password",
        default=os.environ.get("SCARASPEC_PASSWORD", "password"),
        help="its password; default: SCARASPEC_PASSWORD, else 'password'",
    )
    group.addoption("--ics", metavar="FILE", help="its implementation conformance statement, TOML")
    group.addoption("--allow", default="", help="allowed hazards: state,motion,destructive")
    group.addoption("--requirements", default="", help="test only these clauses or requirements")
    group.addoption("--undefined-opcodes", action="store_true", help="send them; never to a robot")
    group.addoption("--patience", type=float, default=10.0, help="seconds that a case may wait")
    group.addoption("--examples", type=int, default=20, help="how many values a case draws")


def pytest_configure(config: pytest.Config) -> None:
    """Connect to the subject if ``--subject`` names one."""
    declare_mark(config)
    url, ics = config.getoption("--subject"), config.getoption("--ics")
    if not url:
        return
    only = config.getoption("--requirements")
    folder = Path(os.environ.get("SCARASPEC_STATE") or state_directory())
    held = ExitStack()
    try:
        selection = parse_selection(only or None, Role.CONTROLLER)
        adapter = ControllerAdapter(
            UrlAccess(url, config.getoption("--patience")),
            Ics.read(Path(ics)) if ics else Ics(),
            config.getoption("--subject-password").encode(),
            Options(
                only=selection.requirements,
                cases=selection.cases,
                allowed=hazards(config.getoption("--allow")),
                undefined=config.getoption("--undefined-opcodes"),
                examples=config.getoption("--examples"),
            ),
            link=url,
            journal=held.enter_context(Journal.of(resolve_url(url), folder)),
        )
    except ControllerBusyError as error:
        pytest.exit(f"{error}", int(ExitStatus.INCONCLUSIVE))
    except (
        JournalError,
        LinkError,
        ValueError,
    ) as error:
        raise pytest.UsageError(str(error)) from None
    config.add_cleanup(held.close)
    run = Run(adapter, verbose=True)
    config.stash[_RUN] = run
    config.pluginmanager.register(run.case_runner)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Write the state of the subject to the journal."""
    if run := session.config.stash.get(_RUN, None):
        try:
            run.begin()
        except RecoveryError as error:
            pytest.exit(f"{error}", int(ExitStatus.INCONCLUSIVE))
        except JournalError as error:
            pytest.exit(f"{error}", int(ExitStatus.USAGE))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Note whether a test of the team has failed, beside the cases of the suite."""
    del call
    report = yield
    if report.failed and not is_case(item):
        item.config.stash[_TEAM_FAILED] = True
    return report


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Restore everything; the results only raise the exit status.

    A failed test of the team, or a failure of the subject, gives 1. Other errors of pytest keep
    their status.
    """
    run = session.config.stash.get(_RUN, None)
    if run is None:
        return
    run.end()
    if not run.case_runner.cases or session.exitstatus not in (
        pytest.ExitCode.OK,
        pytest.ExitCode.TESTS_FAILED,
    ):
        return
    status = run.build_results().verdict.exit_status
    if session.config.stash.get(_TEAM_FAILED, False):
        status = ExitStatus.NONCONFORMANT
    session.exitstatus = int(status)


def pytest_terminal_summary(config: pytest.Config) -> None:
    """Print the results."""
    run = config.stash.get(_RUN, None)
    if run is not None and run.case_runner.cases:
        terminal.show(run.build_results(), Console())
