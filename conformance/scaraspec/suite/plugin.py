"""The pytest plugin: the suite beside a team's own tests, under a pytest that the team runs.

    pytest -p scaraspec.suite.plugin --pyargs scaraspec.suite.controller --subject tcp://192.168.1.2

The fixtures `subject` and `line` serve a team's own tests too. The exit status is that of the
results, as of ``scaraspec certify``.
"""

from pathlib import Path
from typing import Final

import pytest
from rich.console import Console

from scaraspec.judgement.requirements import UnknownRequirementError, select
from scaraspec.links.link import LinkError
from scaraspec.protocol.readings import ReadingError
from scaraspec.report import terminal
from scaraspec.suite.as_client.access import UrlAccess
from scaraspec.suite.as_client.setting import ControllerSetting
from scaraspec.suite.as_client.subject import Subject
from scaraspec.suite.case import declare_mark
from scaraspec.suite.plan import Options, hazards
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement, StatementError

_RUN: Final = pytest.StashKey[Run[Subject]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of ``scaraspec certify controller`` that a pytest run needs."""
    group = parser.getgroup("scaraspec", "certify a controller of the UISR4200S protocol")
    group.addoption("--subject", metavar="URL", help="the controller, as tcp://192.168.1.2")
    group.addoption("--subject-password", default="password", help="what opens it")
    group.addoption("--ics", metavar="FILE", help="its statement of conformance, TOML")
    group.addoption("--allow", default="", help="hazards beyond reading: state,motion,destructive")
    group.addoption("--requirements", default="", help="only these clauses or requirements")
    group.addoption("--undefined-opcodes", action="store_true", help="send them; never to a robot")
    group.addoption("--patience", type=float, default=10.0, help="seconds that a case may wait")
    group.addoption("--examples", type=int, default=20, help="values that a drawn case tries")


def pytest_configure(config: pytest.Config) -> None:
    """Meet the subject, if there is one."""
    declare_mark(config)
    url, ics = config.getoption("--subject"), config.getoption("--ics")
    if not url:
        return
    only = config.getoption("--requirements")
    try:
        setting = ControllerSetting(
            UrlAccess(url, config.getoption("--patience")),
            Statement.read(Path(ics)) if ics else Statement(),
            config.getoption("--subject-password").encode(),
            Options(
                only=frozenset(r.id for r in select(only)) if only else None,
                allowed=hazards(config.getoption("--allow")),
                undefined=config.getoption("--undefined-opcodes"),
                examples=config.getoption("--examples"),
            ),
            link=url,
        )
    except (LinkError, ReadingError, StatementError, UnknownRequirementError, ValueError) as error:
        raise pytest.UsageError(f"{error}") from None
    run = Run(setting, loud=True)
    config.stash[_RUN] = run
    config.pluginmanager.register(run.bracket)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Write down what the subject is like."""
    if run := session.config.stash.get(_RUN, None):
        run.begin()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Put everything back; the exit status is that of the results."""
    run = session.config.stash.get(_RUN, None)
    if run is None:
        return
    run.end()
    status = run.told().verdict.exit_status
    if run.bracket.cases and session.exitstatus in (
        pytest.ExitCode.OK,
        pytest.ExitCode.TESTS_FAILED,
    ):
        session.exitstatus = int(status)


def pytest_terminal_summary(config: pytest.Config) -> None:
    """Say what the run amounts to."""
    run = config.stash.get(_RUN, None)
    if run is not None and run.bracket.cases:
        terminal.show(run.told(), Console())
