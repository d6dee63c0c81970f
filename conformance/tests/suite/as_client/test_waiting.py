"""While a case waits on one connection, what comes on another is taken as it comes."""

from scaraspec.cli.prove.controller import PASSWORD, Robot
from scaraspec.controller.brain import Brain
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.as_client.access import MemoryAccess
from scaraspec.suite.as_client.setting import ControllerSetting
from scaraspec.suite.as_client.two_stage.tasks import RUN, start_program
from scaraspec.suite.observer import Observer
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.statement import Statement


def test_what_comes_elsewhere_is_judged_as_it_comes() -> None:
    """It is not left until somebody listens there: the judge is told all in the order of time."""
    statement, access = Statement(), MemoryAccess(Robot(Brain, DEFAULT).network)
    setting = ControllerSetting(access, statement, PASSWORD, Options(allowed=ALL))
    subject = setting.subject(Observer(setting.role, statement))
    line, other = subject.open(), subject.open()
    start_program(subject, other, RUN, seconds=1)
    assert not [seen for seen in other.heard if seen.frame.tagged]
    line.wait(5)
    assert [seen for seen in other.heard if seen.frame.tagged]
