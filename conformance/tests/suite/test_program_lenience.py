"""Controllers that run programs and have ports in ways of their own, which are open.

No case of the suite may fail of them, nor may the judge that watches it.
"""

from typing import Any

from scaraspec.cli.proving_controller import PASSWORD, Robot
from scaraspec.controller.brain import Brain
from scaraspec.controller.plant import OUTPUTS, Plant
from scaraspec.controller.session import Request
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.as_client.access import MemoryAccess
from scaraspec.suite.as_client.setting import ControllerSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement


def alarms(brain: type[Brain], *only: str) -> list[str]:
    """What is said against a controller by the cases of these requirements."""
    access = MemoryAccess(Robot(brain, DEFAULT).network)
    options = Options(only=frozenset(only), allowed=ALL, examples=2)
    results = Run(ControllerSetting(access, Statement(), PASSWORD, options)).results()
    assert results.counts[Verdict.PASS] + results.counts[Verdict.TOLERATED]
    bad = (Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE)
    return [f"{case.id}: {case.message}" for case in results.cases if case.verdict in bad]


class SwitchesOffAtAStop(Brain):
    """An emergency stop switches off every output, of which some are on at first."""

    def __init__(self, plant: Plant, *others: Any) -> None:
        super().__init__(plant, *others)
        self._switch(on=True)

    def _switch(self, *, on: bool) -> None:
        for port in range(1, OUTPUTS + 1):
            self.plant.digital_outputs[port] = on

    def emergency_stop(self, request: Request) -> Acceptance:
        """Switch them off."""
        self._switch(on=False)
        return super().emergency_stop(request)


def test_a_stop_may_switch_outputs_off() -> None:
    """No program has to leave outputs as they were before a stop."""
    assert not alarms(SwitchesOffAtAStop, "6.5/9", "6.5/21")
