"""Over a serial line, the end of a connection cannot be detected: cases must not affect others."""

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.virtual_controller.core import ControllerCore


def _results(*only: str) -> Results:
    access = MemoryAccess(
        Robot(ControllerCore, DEFAULT).network, needs_login=False, multiple_connections=False
    )
    options = Options(only=frozenset(only), allowed=ALL, examples=3)
    return Run(ControllerAdapter(access, Ics(), PASSWORD, options)).results()


def test_cases_do_not_affect_each_other() -> None:
    """After incomplete frames, refused chunks and aborted transfers, the next case is served."""
    results = _results("2/5", "3/20", "4.10/7", "5.1/7", "5.1/8", "5.2/10", "5.2/13", "5.3/6")
    found = {verdict for verdict, count in results.counts.items() if count}
    assert found == {Verdict.PASS, Verdict.NONE}
    assert results.counts[Verdict.PASS] > 15


def test_cases_that_disconnect_are_skipped() -> None:
    """Cases about the end of a connection are skipped."""
    results = _results("2/13", "5.4/7")
    reason = "the subject does not notice the end of this link"
    skipped = {case.id for case in results.cases if case.message == reason}
    assert skipped == {"2/13", "2/13.leaving", "5.4/7.closed", "5.4/7.reset"}
