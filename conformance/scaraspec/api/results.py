"""Gate, comparison and merge of results; see `scaraspec.results`."""

from scaraspec.results.baseline import Baseline, BaselineError
from scaraspec.results.comparison import Comparison, compare
from scaraspec.results.gate import GateProblem, GateResult, ProblemKind, gate
from scaraspec.results.merge import MergeError, merge
from scaraspec.results.waivers import Waiver, WaiverError, read_waivers

__all__ = [
    "Baseline",
    "BaselineError",
    "Comparison",
    "GateProblem",
    "GateResult",
    "MergeError",
    "ProblemKind",
    "Waiver",
    "WaiverError",
    "compare",
    "gate",
    "merge",
    "read_waivers",
]
