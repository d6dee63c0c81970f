"""Settings of hypothesis, and fixtures for all tests of the suite."""

import gc
from pathlib import Path

import pytest
from hypothesis import settings

# A failure prints the blob that reproduces it; examples are the same on every computer.
settings.register_profile("scaraspec", print_blob=True, deadline=None, derandomize=True)
settings.load_profile("scaraspec")


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection, which would examine them each time."""
    gc.freeze()


@pytest.fixture(scope="session")
def fixtures_dir() -> Path:
    """The data folder of the repository."""
    return Path(__file__).parents[2] / "fixtures"


@pytest.fixture(autouse=True)
def _state_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the journals of a test out of the user's state directory and of other tests."""
    monkeypatch.setenv("SCARASPEC_STATE", str(tmp_path / "state"))
