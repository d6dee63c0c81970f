"""What a right program is, rule by rule; each rule knows its code and the requirements it serves.

A rule looks at one program and reports problems; it never raises and never looks at another rule.
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
"""Every static rule that a program can break."""
