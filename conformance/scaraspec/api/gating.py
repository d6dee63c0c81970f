"""Gate and comparison of results; see `scaraspec.results`."""

from scaraspec.results.baseline import Baseline, BaselineError
from scaraspec.results.gate import GateProblem, GateResult, ProblemKind, gate
from scaraspec.results.waivers import Waiver, WaiverError, read_waivers

__all__ = [
    "Baseline",
    "BaselineError",
    "GateProblem",
    "GateResult",
    "ProblemKind",
    "Waiver",
    "WaiverError",
    "gate",
    "read_waivers",
]
