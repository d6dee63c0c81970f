"""The version of this installation, and the commit from which it was built."""

import subprocess
from importlib import metadata
from pathlib import Path
from typing import Final

_PACKAGE: Final = Path(__file__).parent
_BUILT: Final = _PACKAGE / "_commit.txt"  # written by release/build_hook.py
_TIMEOUT_S: Final = 5.0


def version_text() -> str:
    """Return the version and, if it is known, the commit: ``0.3.0 (commit 0123456789ab)``."""
    built_from = commit()
    return metadata.version("scaraspec") + (f" (commit {built_from})" if built_from else "")


def commit() -> str:
    """Return the commit of the build, or of the checkout that contains this package.

    It ends in ``-dirty`` if files were changed, and is empty if no commit is known.
    """
    if _BUILT.exists():
        return _BUILT.read_text("ascii").strip()
    checkout = _PACKAGE.parents[1]
    if not (checkout / ".git").exists():
        return ""
    try:
        done = subprocess.run(  # noqa: S603 - constant arguments
            ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=12"],  # noqa: S607 - git of the user
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):  # no git
        return ""
    return done.stdout.strip()
