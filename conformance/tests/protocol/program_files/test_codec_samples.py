"""The sample files: their bytes match a C compiler, and their text is as published."""

import json
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from scaraspec.protocol.program_files import (
    LAYOUTS,
    ByteOrder,
    NodeType,
    Operation,
    Opt,
    ProgramError,
    ResultType,
    Severity,
    ValueType,
    build,
    detect,
    lint,
    listing,
    parse,
)

SAMPLES = Path(__file__).parents[4] / "fixtures" / "programs"
FILES: list[dict[str, Any]] = json.loads((SAMPLES / "files.json").read_text())
WHOLE = [row for row in FILES if not row["file"].startswith("damaged/")]
DAMAGED = [row for row in FILES if row not in WHOLE]
EVERY_NODE = [row for row in WHOLE if row["sample"] == "every-node"]

each_whole = pytest.mark.parametrize("row", WHOLE, ids=lambda row: row["file"])
each_damaged = pytest.mark.parametrize("row", DAMAGED, ids=lambda row: row["file"])


def read(row: dict[str, Any]) -> bytes:
    return (SAMPLES / row["file"]).read_bytes()


def test_every_file_is_described() -> None:
    """files.json lists all program files, and each has its text file."""
    present = {str(path.relative_to(SAMPLES)) for path in SAMPLES.rglob("*.rob")}
    assert present == {row["file"] for row in FILES}
    assert {path.stem for path in SAMPLES.glob("*.lst")} == {row["sample"] for row in WHOLE}
    assert {path.stem for path in SAMPLES.rglob("*.lint")} == {row["sample"] for row in DAMAGED}


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that compiles the witness program, once for each set of flags."""
    compiler = shutil.which("gcc")  # only gcc has the attribute scalar_storage_order
    if compiler is None:
        pytest.skip("no gcc here; ctypes checks the same files in test_codec_ctypes.py")
    folder = tmp_path_factory.mktemp("witness")

    @cache
    def witness(*flags: str) -> Path:
        program = folder / f"witness{len(list(folder.iterdir()))}"
        source = SAMPLES / "witness.c"
        subprocess.run([compiler, "-std=gnu11", *flags, "-o", program, source], check=True)
        return program

    return witness


@pytest.mark.parametrize("row", FILES, ids=lambda row: row["file"])
def test_a_c_compiler_places_every_byte_alike(
    row: dict[str, Any], compiled: Callable[..., Path]
) -> None:
    """The file equals the structures of the document as written by C."""
    command = [compiled(*row["flags"]), row["sample"]]
    assert subprocess.run(command, check=True, capture_output=True).stdout == read(row)


@each_whole
def test_a_file_is_rebuilt_unchanged(row: dict[str, Any]) -> None:
    """The layout is detected, and a parsed file is built again unchanged."""
    data = read(row)
    assert detect(data)[0].name == row["layout"]
    assert build(parse(data), LAYOUTS[row["layout"]]) == data


@each_whole
def test_a_file_has_its_listing(row: dict[str, Any]) -> None:
    """A sample has the same listing in every layout."""
    text = (SAMPLES / f"{row['sample']}.lst").read_text(encoding="utf-8")
    assert listing(parse(read(row))) == text


@each_whole
def test_undamaged_files_have_no_errors(row: dict[str, Any]) -> None:
    """Only damaged files have errors."""
    assert not [str(finding) for finding in lint(read(row)) if finding.severity is Severity.ERROR]


@each_damaged
def test_a_damaged_file_has_its_findings(row: dict[str, Any]) -> None:
    """The findings of a damaged file equal its published text; at least one is not INFO."""
    found = "".join(f"{finding}\n" for finding in lint(read(row)))
    assert found == (SAMPLES / row["file"]).with_suffix(".lint").read_text(encoding="utf-8")
    assert any(finding.severity is not Severity.INFO for finding in lint(read(row)))


def test_the_samples_use_all_types() -> None:
    """Every node type, result type and value type, both orders and every packing occur."""
    program = parse(read(EVERY_NODE[0]))
    operations = [node.data for node in program.nodes if isinstance(node.data, Operation)]
    assert {node.type for node in program.nodes} == set(NodeType)
    assert {operation.result_type for operation in operations} == set(ResultType)
    assert {item.value_a_type for item in operations} | {
        item.value_b_type for item in operations
    } == set(ValueType)
    assert Opt.GREATER_OR_EQUAL in {operation.opt for operation in operations}
    layouts = [LAYOUTS[row["layout"]] for row in EVERY_NODE]
    assert {layout.byte_order for layout in layouts} == set(ByteOrder)
    assert {layout.reading for layout in layouts} == {
        *("ilp32", "packed", "pack2", "lp64", "mixed"),
    }


def test_the_demonstration_has_no_findings() -> None:
    """pick-and-place has the default layout, no loop, and no finding."""
    data = (SAMPLES / "pick-and-place.rob").read_bytes()
    assert lint(data) == ()
    assert NodeType.LOOP not in {node.type for node in parse(data).nodes}


def test_the_endless_sample_has_one_finding() -> None:
    """The only finding of the endless sample is that its loop does not end."""
    found = lint((SAMPLES / "endless.rob").read_bytes())
    assert [finding.code for finding in found] == ["P-endless-loop"]


def test_a_truncated_file_is_not_a_program() -> None:
    """A file cut at any position is rejected, so no partial upload can run."""
    data = (SAMPLES / "pick-and-place.rob").read_bytes()
    for length in range(len(data)):
        with pytest.raises(ProgramError):
            parse(data[:length])
