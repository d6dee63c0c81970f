"""What a client never says is not waited for in full by every case."""

from contextlib import closing

from scaraspec.cli.prove.client import MemoryClient
from scaraspec.client.faults import faults
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.as_controller.setting import ClientSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement

ONLY = frozenset({"5.1/1", "5.1/2", "5.1/3", "5.1/4"})


def test_an_upload_of_which_nothing_is_said_is_waited_for_in_full_twice() -> None:
    """From then on its silence is taken for what it was before."""
    silent = faults()["waits-behind-the-last-answer"].wrong
    with closing(MemoryClient(silent, DEFAULT)) as access:
        options = Options(only=ONLY, allowed=ALL, examples=1)
        results = Run(ClientSetting(access, Statement(), options)).results()
    said = [case.message for case in results.cases if case.verdict is Verdict.FAIL]
    in_full = [message for message in said if "does not say in 10 s" in message]
    assert len(said) == len(ONLY)
    assert len(in_full) == 2
