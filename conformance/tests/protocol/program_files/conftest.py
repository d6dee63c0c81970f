"""Hypothesis strategies for programs, nodes and layouts."""

from hypothesis import strategies as st

from scaraspec.protocol.program_files import (
    LAYOUTS,
    Layout,
    Node,
    NodeType,
    Operation,
    Point,
    Program,
    SetOutput,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.protocol.program_files.model import DATA_OF_TYPE

# Numbers in tables of the document are drawn as often as all others together.
_small = st.integers(0, 14)
_uint8, _int8 = _small | st.integers(0, 255), _small | st.integers(-128, 127)
_uint32, _int32 = _small | st.integers(0, 2**32 - 1), _small | st.integers(-(2**31), 2**31 - 1)
_single = st.integers(-400, 400).map(float) | st.floats(width=32, allow_nan=False)


def _name(size: int) -> st.SearchStrategy[bytes]:
    return st.binary(max_size=size).map(lambda name: name.replace(b"\0", b"?"))


_DATA = {
    Point: st.builds(Point, st.tuples(*[_single] * 4)),
    WaitInput: st.builds(WaitInput, _uint32, _uint32, _uint32),
    WaitSeconds: st.builds(WaitSeconds, _uint8),
    SetOutput: st.builds(SetOutput, _uint32, _uint32, _uint32, _uint32),
    WaitTimer: st.builds(WaitTimer, _int32, _int32),
    Operation: st.builds(Operation, *[_int32] * 7),
}


def _nodes(node_type: int) -> st.SearchStrategy[Node]:
    kind = DATA_OF_TYPE.get(node_type)
    data = st.none() if kind is None else _DATA[kind]
    return st.builds(Node, _name(30), st.just(node_type), _int8, _uint8, data)


st.register_type_strategy(Layout, st.sampled_from(list(LAYOUTS.values())))
st.register_type_strategy(Node, (st.sampled_from(NodeType) | _uint8).flatmap(_nodes))
st.register_type_strategy(Variable, st.builds(Variable, _int32, _name(20), _int32))
st.register_type_strategy(
    Program,
    st.builds(
        Program,
        st.tuples(*[_single] * 6),
        st.tuples(*[_single] * 3),
        st.binary(min_size=40, max_size=40).map(tuple),
        st.lists(st.from_type(Variable), max_size=3).map(tuple),
        st.lists(st.from_type(Node), max_size=5).map(tuple),
    ),
)
