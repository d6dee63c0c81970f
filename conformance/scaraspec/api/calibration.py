"""Calibration: before a certification the tester checks itself on this machine.

The reference implementation must be conformant, and a sample of the mutants must be killed. The
seed of the certification chooses the mutants; the runs use the simulated clock.
"""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report.model import Role
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.mutants.kill_matrix import Proof

MUTANTS: Final = 20
"""How many mutants a calibration tries."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """The result of a calibration.

    Attributes:
        role: The role of the reference implementation and of the mutants.
        seed: The seed that chose the mutants.
        reference: The verdict on the reference implementation, judged by the requirements that
            the mutants violate.
        mutants: The cases that killed each mutant, by the id of the mutant.
    """

    role: Role
    seed: int
    reference: Conclusion
    mutants: Mapping[str, tuple[str, ...]]

    @property
    def problem(self) -> str:
        """Why the tester is not fit for a certification; empty if it is."""
        if self.reference is not Conclusion.CONFORMANT:
            text = "the reference implementation is {verdict}, not conformant"
            return UserMessage(text, verdict=UserMessage.word(self.reference.value))
        if survivors := [mutant for mutant, killers in self.mutants.items() if not killers]:
            return UserMessage("no case kills {mutants}", mutants=", ".join(survivors))
        return ""


def chosen_mutants(role: Role, seed: int) -> list[str]:
    """Return the ids of the mutants that a seed chooses; equal on every machine."""
    from scaraspec.api.proving import mutants  # noqa: PLC0415 - imports all mutants

    ids = [mutant.name for mutant in mutants(role)]
    ids.sort(key=lambda name: hashlib.sha256(f"{seed} {name}".encode()).digest())
    return ids[:MUTANTS]


def calibrate(
    role: Role,
    seed: int,
    *,
    jobs: int = 1,
    mutant_ends: "Callable[[Proof], None]" = lambda _proof: None,
) -> Calibration:
    """Run the suite against the reference implementation and the mutants that a seed chooses.

    Args:
        role: Controller or client.
        seed: The seed of the certification. The runs themselves have the seed 0, like the
            published kill matrix.
        jobs: Number of processes.
        mutant_ends: Called with the result of each mutant.

    Raises:
        KeyboardInterrupt: The user interrupted the calibration.
    """
    from scaraspec.api.proving import EVERYTHING, prove  # noqa: PLC0415 - imports all mutants

    ids = chosen_mutants(role, seed)
    matrix = prove(role, EVERYTHING, ids=ids, quick=True, jobs=jobs, mutant_ends=mutant_ends)
    killers = {proof.fault: proof.killers for proof in matrix.proofs}
    return Calibration(role, seed, matrix.unmodified, killers)
