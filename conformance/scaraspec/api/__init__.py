"""The Python interface: what the command line can do, as documented and typed functions.

    from scaraspec.api import audit, certify, compare, gate, open_capture, prove, record, replay

`certify` is a module with the functions `controller` and `client`; the others are functions. This
package composes all others. Nothing in it prints, reads the command line or handles signals.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scaraspec.api import certify
    from scaraspec.api.archives import archive_report, build_archive, query_archive
    from scaraspec.api.auditing import audit
    from scaraspec.api.captures import open_capture
    from scaraspec.api.certificates import certification, verify_package, write_certificate
    from scaraspec.api.proving import prove, prove_dialects
    from scaraspec.api.recording import record
    from scaraspec.api.replaying import replay
    from scaraspec.api.results import Baseline, compare, gate, merge, read_waivers
    from scaraspec.api.statements import CheckedIcs, check_ics, new_ics
    from scaraspec.judge.requirements import select
    from scaraspec.protocol.hazard import Hazard
    from scaraspec.protocol.readings import Dialect
    from scaraspec.report.model import Results, Role
    from scaraspec.report.operator_request import OperatorAnswer
    from scaraspec.suite.engine.case_sheet import CaseSheet, case_sheets
    from scaraspec.suite.engine.earlier_sitting import cases_to_repeat
    from scaraspec.suite.engine.ics import Ics
    from scaraspec.suite.engine.operator import Operator
    from scaraspec.suite.engine.plan import Options
    from scaraspec_recorder.config import RobotConfig

__all__ = [
    "Baseline",
    "CaseSheet",
    "CheckedIcs",
    "Dialect",
    "Hazard",
    "Ics",
    "Operator",
    "OperatorAnswer",
    "Options",
    "Results",
    "RobotConfig",
    "Role",
    "archive_report",
    "audit",
    "build_archive",
    "case_sheets",
    "cases_to_repeat",
    "certification",
    "certify",
    "check_ics",
    "compare",
    "gate",
    "merge",
    "new_ics",
    "open_capture",
    "prove",
    "prove_dialects",
    "query_archive",
    "read_waivers",
    "record",
    "replay",
    "select",
    "verify_package",
    "write_certificate",
]

_MODULES = {
    "Baseline": "scaraspec.api.results",
    "CaseSheet": "scaraspec.suite.engine.case_sheet",
    "CheckedIcs": "scaraspec.api.statements",
    "Dialect": "scaraspec.protocol.readings",
    "Hazard": "scaraspec.protocol.hazard",
    "Ics": "scaraspec.suite.engine.ics",
    "Operator": "scaraspec.suite.engine.operator",
    "OperatorAnswer": "scaraspec.report.operator_request",
    "Options": "scaraspec.suite.engine.plan",
    "Results": "scaraspec.report.model",
    "RobotConfig": "scaraspec_recorder.config",
    "Role": "scaraspec.report.model",
    "archive_report": "scaraspec.api.archives",
    "audit": "scaraspec.api.auditing",
    "build_archive": "scaraspec.api.archives",
    "case_sheets": "scaraspec.suite.engine.case_sheet",
    "cases_to_repeat": "scaraspec.suite.engine.earlier_sitting",
    "check_ics": "scaraspec.api.statements",
    "certification": "scaraspec.api.certificates",
    "compare": "scaraspec.api.results",
    "gate": "scaraspec.api.results",
    "merge": "scaraspec.api.results",
    "new_ics": "scaraspec.api.statements",
    "open_capture": "scaraspec.api.captures",
    "prove": "scaraspec.api.proving",
    "prove_dialects": "scaraspec.api.proving",
    "query_archive": "scaraspec.api.archives",
    "read_waivers": "scaraspec.api.results",
    "record": "scaraspec.api.recording",
    "replay": "scaraspec.api.replaying",
    "select": "scaraspec.judge.requirements",
    "verify_package": "scaraspec.api.certificates",
    "write_certificate": "scaraspec.api.certificates",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is used first: importing all of them takes a second."""
    if name == "certify":
        return import_module("scaraspec.api.certify")
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
