"""The catalogue: every requirement as data, in the order of the document."""

from scaraspec.judge.requirements import (
    clause_2,
    clause_3,
    clause_4_01_08,
    clause_4_09_14,
    clause_4_15_20,
    clause_4_21_28,
    clause_4_31_35,
    clause_5,
    clause_6,
    clause_7_8,
)
from scaraspec.judge.requirements.entry import Requirement

CATALOGUE: tuple[Requirement, ...] = (
    *clause_2.ROWS,
    *clause_3.ROWS,
    *clause_4_01_08.ROWS,
    *clause_4_09_14.ROWS,
    *clause_4_15_20.ROWS,
    *clause_4_21_28.ROWS,
    *clause_4_31_35.ROWS,
    *clause_5.ROWS,
    *clause_6.ROWS,
    *clause_7_8.ROWS,
)
"""Every requirement, in the order of the document."""
