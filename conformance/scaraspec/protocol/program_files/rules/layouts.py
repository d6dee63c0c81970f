"""Rules for the layout of the file (6.1)."""

from collections.abc import Iterator

from scaraspec.protocol.program_files.layout import DEFAULT_LAYOUT
from scaraspec.protocol.program_files.model import Operation, SetOutput, WaitInput
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import Condition, Numbered, PortType, ResultType
from scaraspec.user_message import UserMessage


def _layout(context: LintContext) -> Iterator[Problem]:
    """The layout is the default one (A-6.1-2)."""
    layout = context.layout
    if layout and layout != DEFAULT_LAYOUT:
        yield Problem(
            UserMessage(
                "the file has layout {layout}, {byte_order}-endian; a peer that reads only "
                "{default_layout}, little-endian, rejects it as damaged",
                layout=layout.name,
                byte_order=layout.byte_order,
                default_layout=DEFAULT_LAYOUT.name,
            )
        )


def _layout_mixed(context: LintContext) -> Iterator[Problem]:
    """Header and nodes have the same alignment (A-6.1-2)."""
    if (layout := context.layout) and layout.reading == "mixed":
        yield Problem(
            UserMessage(
                "no single packing gives a header of {header_bytes} bytes and nodes of "
                "{node_bytes} bytes with their data at offset {data_offset}",
                header_bytes=layout.header_bytes,
                node_bytes=layout.node_bytes,
                data_offset=layout.data_offset,
            )
        )


def _table_numbers(context: LintContext) -> Iterator[tuple[int, str, int, type[Numbered]]]:
    """Yield 4-byte numbers that must be in a table: node index, name, number, table."""
    for index, wait in context.data(WaitInput):
        yield index, "condition", wait.condition, Condition
    for index, output in context.data(SetOutput):
        yield index, "output type", output.type, PortType
    for index, operation in context.data(Operation):
        yield index, "result_type", operation.result_type, ResultType


def _byte_order(context: LintContext) -> Iterator[Problem]:
    """Every number has the byte order of the header (A-6.1-4)."""
    for index, name, number, table in _table_numbers(context):
        swapped = int.from_bytes((number & 0xFFFFFFFF).to_bytes(4, "little"), "big")
        if table.has(swapped) and not table.has(number):
            yield Problem(
                UserMessage(
                    "the {name} {number:#x} is valid only in the other byte order, as {swapped}",
                    name=name,
                    number=number,
                    swapped=swapped,
                ),
                node=index,
            )


LAYOUT_RULES = (
    LintRule("P-byte-order", Severity.WARNING, ("6.1/4",), _byte_order),
    LintRule("P-layout-mixed", Severity.WARNING, ("6.1/4",), _layout_mixed),
    LintRule("P-layout", Severity.INFO, ("6.1/4",), _layout),
)
