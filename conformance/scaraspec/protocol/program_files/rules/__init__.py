"""The lint rules for programs; each rule has a code and cites its requirements.

A rule checks one program and reports problems. It never raises and does not depend on other rules.
"""

from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.rules.configuration import CONFIGURATION_RULES
from scaraspec.protocol.program_files.rules.flow import FLOW_RULES
from scaraspec.protocol.program_files.rules.layouts import LAYOUT_RULES
from scaraspec.protocol.program_files.rules.operations import OPERATION_RULES
from scaraspec.protocol.program_files.rules.ports import PORT_RULES
from scaraspec.protocol.program_files.rules.steps import STEP_RULES
from scaraspec.protocol.program_files.rules.variables import VARIABLE_RULES

__all__ = ["RULES", "LintContext", "LintRule", "Problem", "Severity"]

RULES: tuple[LintRule, ...] = (
    *LAYOUT_RULES,
    *CONFIGURATION_RULES,
    *VARIABLE_RULES,
    *STEP_RULES,
    *FLOW_RULES,
    *PORT_RULES,
    *OPERATION_RULES,
)
"""All static rules for programs."""
