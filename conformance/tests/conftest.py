"""What every test of the tool shares: how hypothesis behaves, and where the data is."""

from pathlib import Path

import pytest
from hypothesis import settings

# A failure prints the blob that replays it; examples are drawn the same way on every machine.
settings.register_profile("scaraspec", print_blob=True, deadline=None, derandomize=True)
settings.load_profile("scaraspec")


@pytest.fixture(scope="session")
def fixtures_dir() -> Path:
    """The data folder of the repository."""
    return Path(__file__).parents[2] / "fixtures"
