"""Build hook: writes the commit into the sdist and the wheel, for `scaraspec --version`."""

import subprocess
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_IN_SDIST = "COMMIT"
_IN_WHEEL = "scaraspec/_commit.txt"


class CommitHook(BuildHookInterface):  # type: ignore[type-arg] # generic only for type checkers
    """Adds a file with the commit; a wheel that is built from an sdist takes that of the sdist."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the file, except to an editable installation, which reads its checkout."""
        if version == "editable":
            return
        source = Path(self.root, _IN_SDIST)
        if not source.exists():
            commit = _commit(self.root)
            if not commit:
                return
            with NamedTemporaryFile("w", encoding="ascii", delete=False) as file:
                file.write(f"{commit}\n")
            source = self._temporary = Path(file.name)
        target = _IN_SDIST if self.target_name == "sdist" else _IN_WHEEL
        build_data["force_include"][str(source)] = target

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002 - hatchling's signature
        """Remove the temporary file."""
        if hasattr(self, "_temporary"):
            self._temporary.unlink()


def _commit(folder: str) -> str:
    """Return the commit of a checkout; empty without git."""
    if not Path(folder, ".git").exists():
        return ""
    try:
        done = subprocess.run(  # noqa: S603 - constant arguments
            ["git", "-C", folder, "describe", "--always", "--dirty", "--abbrev=12"],  # noqa: S607 - git of the user
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return ""
    return done.stdout.strip()
