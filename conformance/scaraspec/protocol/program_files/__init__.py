"""User program files (clause 6): model, binary layouts, codec, lint rules, listing.

The content of a file is an argument; this package opens no files.
"""

from scaraspec.protocol.program_files.codec import build, parse
from scaraspec.protocol.program_files.defects import MAX_FILE_BYTES, ProgramDefect, ProgramError
from scaraspec.protocol.program_files.layout import (
    DEFAULT_LAYOUT,
    LAYOUTS,
    ByteOrder,
    Layout,
    detect,
)
from scaraspec.protocol.program_files.lint import INVALID_PROGRAM_CODES, LintFinding, lint
from scaraspec.protocol.program_files.listing import PointMeaning, listing, listing_lines
from scaraspec.protocol.program_files.model import (
    Node,
    NodeData,
    Operation,
    Point,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.protocol.program_files.rules import RULES, LintRule, Severity
from scaraspec.protocol.program_files.structure import (
    MOVES,
    CountsMode,
    Structure,
    Unbalanced,
    loop_readings,
)
from scaraspec.protocol.program_files.tables import (
    Condition,
    NodeType,
    Opt,
    PortType,
    ResultType,
    ValueType,
)

__all__ = [
    "DEFAULT_LAYOUT",
    "INVALID_PROGRAM_CODES",
    "LAYOUTS",
    "MAX_FILE_BYTES",
    "MOVES",
    "RULES",
    "ByteOrder",
    "Condition",
    "CountsMode",
    "Layout",
    "LintFinding",
    "LintRule",
    "Node",
    "NodeData",
    "NodeType",
    "Operation",
    "Opt",
    "Point",
    "PointMeaning",
    "PortType",
    "Program",
    "ProgramDefect",
    "ProgramError",
    "ResultType",
    "SetOutput",
    "Severity",
    "Structure",
    "Unbalanced",
    "ValueType",
    "Variable",
    "WaitInput",
    "WaitSeconds",
    "WaitTimer",
    "build",
    "detect",
    "lint",
    "listing",
    "listing_lines",
    "loop_readings",
    "parse",
]
