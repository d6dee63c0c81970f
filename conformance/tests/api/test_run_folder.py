"""The output folder of a certification on a full disk."""

import errno
import os
from pathlib import Path

import pytest

from scaraspec.api.run_folder import RunFolder, RunFolderError, write_results
from scaraspec.judge.verdicts import Conclusion
from scaraspec.report import html
from scaraspec.report.model import Results, Role, Subject, Tool
from scaraspec.suite.engine.ics import Ics

RESULTS = Results(
    tool=Tool("scaraspec", "0"),
    subject=Subject(Role.CONTROLLER),
    role=Role.CONTROLLER,
    verdict=Conclusion.NOTHING_TESTED,
    counts={},
    readings={},
    requirements=(),
    cases=(),
)


def test_other_reports_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence names the report that could not be written; results.json and the others are
    written."""

    def fill(_results: Results, path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), f"{path}")

    monkeypatch.setattr(html, "write", fill)
    folder = tmp_path / "out"
    with RunFolder(folder, Role.CONTROLLER, Ics()) as files:
        assert (folder / ".results.reserve").stat().st_size == 4 * 2**20
        with pytest.raises(RunFolderError) as caught:
            files.finish(RESULTS)
    assert f"{caught.value}" == f"{folder}/report.html cannot be written: No space left on device"
    names = {path.name for path in folder.iterdir()}
    assert {"results.json", "junit.xml", "ctrf.json"} <= names
    assert not names & {"report.html", ".results.reserve"}
    assert Results.read(folder / "results.json") == RESULTS


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    """The file stays as it is."""
    file = tmp_path / "out"
    file.write_text("mine", "utf-8")
    with pytest.raises(RunFolderError, match="is not a folder: name another one"):
        RunFolder(file, Role.CONTROLLER, Ics())
    with pytest.raises(RunFolderError, match="is not a folder: name another one"):
        write_results(RESULTS, file)
    assert file.read_text("utf-8") == "mine"
