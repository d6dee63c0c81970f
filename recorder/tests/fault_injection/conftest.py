"""Fixture of the tests of fault injection: loads rules from text."""

from collections.abc import Callable
from pathlib import Path

import pytest

from scaraspec_recorder.fault_injection.injection_file import load_injection
from scaraspec_recorder.fault_injection.rules import Injection

Load = Callable[[str], Injection]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write the text to a file and load it."""

    def load_text(text: str) -> Injection:
        path = tmp_path / "faults.toml"
        path.write_text(text)
        return load_injection(path)

    return load_text
