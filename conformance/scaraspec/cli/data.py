"""Where the package's data lies: in the wheel, or in the repository that it is run from."""

from pathlib import Path

import scaraspec

_PACKAGE = Path(scaraspec.__file__).parent


def sample_program(name: str) -> Path:
    """The sample user program of this name."""
    installed = _PACKAGE / "_fixtures" / "programs" / name
    return installed if installed.exists() else _PACKAGE.parents[1] / "fixtures" / "programs" / name
