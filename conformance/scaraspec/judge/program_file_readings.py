"""Which readings of clause 6 an uploaded program follows."""

from collections.abc import Iterator

from scaraspec.judge.dialect_detector import ReadingObservation
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.program_files import (
    MAX_FILE_BYTES,
    Operation,
    Program,
    ProgramError,
    ResultType,
    Structure,
    ValueType,
    detect,
    lint,
    loop_readings,
    parse,
)
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import Transfer

_BY_CODE = {
    "P-point-pose": ("point_meaning", "pose"),
    "P-wait-unscaled": ("wait_scale", "analog"),
    "P-comparison-result": ("cmp_result", "polarity"),
}
"""Lint findings that show a reading."""


def observed_file_readings(transfer: Transfer) -> Iterator[ReadingObservation]:
    """Yield the readings that an uploaded program shows, each once; the peer is the client.

    A layout is reported if no other one fits, or only a mixed one. A loop's count is reported if it
    distinguishes the readings.
    """
    content = bytes(transfer.content[:MAX_FILE_BYTES])
    uploaded = transfer.upload and transfer.state is TransferState.DONE and transfer.certain
    if not uploaded or len(content) != transfer.received_bytes:
        return
    try:
        program = parse(content)
    except ProgramError:
        return
    fitting = detect(content)
    layouts = [layout for layout in fitting if layout.reading != "mixed"] or fitting
    found = {("endian", str(layout.byte_order)) for layout in layouts}
    packings = {("prog_layout", layout.reading) for layout in layouts}
    readings = {
        *(found if len(found) == 1 else ()),
        *(packings if len(packings) == 1 else ()),
        *(_BY_CODE[finding.code] for finding in lint(program) if finding.code in _BY_CODE),
        *_counts(program),
        *_assignments(program),
    }
    for key, option in sorted(readings):
        yield ReadingObservation(A2C, key, option)


def _counts(program: Program) -> Iterator[tuple[str, str]]:
    """Yield what the counts of the loops include (A-6.5-4)."""
    for modes in loop_readings(program.nodes, Structure.of(program.nodes)).values():
        if len(modes) == 1:
            yield "counts_mode", str(*modes)


def _assignments(program: Program) -> Iterator[tuple[str, str]]:
    """Yield which operator the assignments and port settings contain (A-6.6a-2)."""
    for node in program.nodes:
        operation = node.data
        if not isinstance(operation, Operation):
            continue
        if operation.result_type not in (ResultType.ASSIGNMENT, ResultType.SET_PORT):
            continue
        if operation.value_b_type != ValueType.NONE:
            yield "assign_opt", "expression"
        else:
            yield "assign_opt", "any" if operation.opt else "zero"
