"""What the tests of injection share: a file of rules, read."""

from collections.abc import Callable
from pathlib import Path

import pytest

from scaraspec_recorder.fault_injection.injection_file import load_injection
from scaraspec_recorder.fault_injection.rules import Injection

Load = Callable[[str], Injection]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Reads a file of this text."""

    def load_text(text: str) -> Injection:
        path = tmp_path / "faults.toml"
        path.write_text(text)
        return load_injection(path)

    return load_text
