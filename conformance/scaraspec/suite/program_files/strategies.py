"""Program strategies: programs that hypothesis draws and that mean the same in all readings.

They have variables, calculations, comparisons, branches and outputs, but no waits and no moves.
"""

from typing import Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from scaraspec.suite.program_files.model import (
    CALCULATIONS,
    COMPARISONS,
    Assign,
    Calculate,
    Flip,
    If,
    Put,
    Statement,
)
from scaraspec.suite.program_files.writing import OUTPUTS, Operand, number, variable

KEYS: Final = (1, 3, -2, 70000)
"""The keys of the variables of drawn programs."""

_numbers = st.integers(-40, 40)
_outputs = st.sampled_from(OUTPUTS)
_keys = st.sampled_from(KEYS)
_opts = st.sampled_from(CALCULATIONS)

operands: SearchStrategy[Operand] = _numbers.map(number) | _keys.map(variable)
"""Numbers and variables."""

variables = st.fixed_dictionaries(dict.fromkeys(KEYS, _numbers))
"""Values for all variables."""

_plain: SearchStrategy[Statement] = st.one_of(
    _outputs.map(Flip),
    st.builds(Put, _outputs, st.sampled_from((number(0), number(1)))),
    st.builds(Assign, _keys, operands),
    st.builds(Calculate, _keys, operands, _opts, operands),
)


def _branches(inner: SearchStrategy[Statement]) -> SearchStrategy[Statement]:
    block = st.lists(inner, min_size=1, max_size=2)
    opts = st.sampled_from(COMPARISONS)
    return st.builds(If, operands, opts, operands, block, st.none() | block)


statements = st.recursive(_plain, _branches, max_leaves=4)
"""Single statements and branches of them."""

blocks = st.lists(statements, min_size=1, max_size=6)
"""Programs."""
