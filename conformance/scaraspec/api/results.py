"""Gate and comparison of results; see `scaraspec.results`."""

from scaraspec.results.baseline import Baseline, BaselineError
from scaraspec.results.comparison import Comparison, compare
from scaraspec.results.gate import GateProblem, GateResult, ProblemKind, gate
from scaraspec.results.waivers import Waiver, WaiverError, read_waivers

__all__ = [
    "Baseline",
    "BaselineError",
    "Comparison",
    "GateProblem",
    "GateResult",
    "ProblemKind",
    "Waiver",
    "WaiverError",
    "compare",
    "gate",
    "read_waivers",
]
