"""A small certification and its package."""

import sys
from pathlib import Path

import pytest
from certification import ICS, Verify, certification_of, certified, list_of_cases

from scaraspec.api import certificates
from scaraspec.api.certificates import write_package
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.cli.main import main
from scaraspec.report.model import Results


@pytest.fixture(scope="session")
def small_list() -> MandatoryList:
    """Return a list of a few cases."""
    return list_of_cases()


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory, small_list: MandatoryList) -> Path:
    """Return the output folder of a conformant certification."""
    folder = tmp_path_factory.mktemp("run")
    certified(folder, small_list)
    return folder


@pytest.fixture(scope="session")
def package(
    run_folder: Path, small_list: MandatoryList, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return the package of a conformant certification."""
    path = tmp_path_factory.mktemp("package") / "cell-7.scaraspec.zip"
    write_package(certification_of(path, small_list), run_folder, ICS)
    return path


@pytest.fixture
def results(run_folder: Path) -> Results:
    """Return the results of the conformant certification."""
    return Results.read(run_folder / "results.json")


@pytest.fixture
def verify(
    small_list: MandatoryList, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Verify:
    """Run the command with the small list; return its exit status and output."""

    def run(
        *arguments: object, lists: tuple[MandatoryList, ...] = (small_list,)
    ) -> tuple[int, str]:
        monkeypatch.setattr(certificates, "mandatory_lists", lambda _: lists)
        monkeypatch.setattr(sys, "argv", ["scaraspec", "verify", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out + shown.err

    return run
