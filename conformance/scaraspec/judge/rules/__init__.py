"""The rules, by topic. Importing this package registers all of them.

The clauses of each topic:

- `busy`: 4, 4.8, 4.15, 4.17, 4.18, 4.25, 4.35
- `clause_2`: 2
- `clause_3`: 3, 4.15 to 4.18, 4.24 to 4.26, 4.28 (final results)
- `clause_4_01`: 4.1
- `clause_4_08`: 4.8
- `clause_5`: 5.1, 5.2, 5.3, 5.4
- `clock`: 4.5, 4.6
- `codes`: 8
- `flag`: 4.1, 4.2, 4.4, 4.5, 4.11, 4.13, 4.20, 4.21, 4.32, 5.2, 5.3 (replies of one flag)
- `forms`: 4.2 to 4.7, 4.9 to 4.28, 4.31 to 4.35 (the form of each payload)
- `malformed`: 4.4, 4.5, 4.20, 4.21, 4.24, 4.28, 4.32, 5.2, 5.3, 6.5 (accepted violations)
- `missing_programs`: 4.12, 4.15, 8
- `motion`: 4.24, 4.27, 4.28, 7
- `ports`: 4.32, 4.34
- `program_files`: 6, with the rules in ``protocol.program_files.rules``: search the id there
- `program_store`: 4.10, 4.11
- `replies`: 3
- `running_program`: 4.9
- `settings`: 4.2, 4.4, 4.13, 4.20, 4.21
- `standstill`: 4.13, 4.16, 4.17, 4.20, 4.21, 4.23, 4.26, 4.27
- `stop`: 4.17
- `text`: T (the conventions of text and numbers)
- `two_stage`: 4, 4.15 to 4.18, 4.24 to 4.26, 4.28, 4.35
- `values`: 4.7, 4.12, 4.14

``scaraspec requirements --entry 4.17/3`` prints file and line of each rule of a requirement.
"""

from scaraspec.judge.rules import (
    busy,
    clause_2,
    clause_3,
    clause_4_01,
    clause_4_08,
    clause_5,
    clock,
    codes,
    forms,
    malformed,
    missing_programs,
    motion,
    ports,
    program_files,
    program_store,
    replies,
    running_program,
    settings,
    standstill,
    stop,
    text,
    two_stage,
    values,
)
from scaraspec.judge.rules.rule import RULES

__all__ = [
    "RULES",
    "busy",
    "clause_2",
    "clause_3",
    "clause_4_01",
    "clause_4_08",
    "clause_5",
    "clock",
    "codes",
    "forms",
    "malformed",
    "missing_programs",
    "motion",
    "ports",
    "program_files",
    "program_store",
    "replies",
    "running_program",
    "settings",
    "standstill",
    "stop",
    "text",
    "two_stage",
    "values",
]
