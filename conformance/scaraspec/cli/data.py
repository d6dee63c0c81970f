"""Paths of data files, in the wheel or in the repository."""

from pathlib import Path

import scaraspec

_PACKAGE = Path(scaraspec.__file__).parent


def sample_program(name: str) -> Path:
    """Return the path of a sample user program."""
    installed = _PACKAGE / "_fixtures" / "programs" / name
    return installed if installed.exists() else _PACKAGE.parents[1] / "fixtures" / "programs" / name
