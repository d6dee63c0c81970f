"""A small certification, and the package of it."""

from pathlib import Path

import pytest
from certification import ICS, certification_of, certified, list_of_cases

from scaraspec.api.certificates import write_package
from scaraspec.certificate.mandatory import MandatoryList


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
