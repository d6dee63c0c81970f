"""Detached signature of a package, made and verified with `ssh-keygen -Y`."""

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO, Final

from scaraspec.certificate.package import PackageError
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.user_message import UserMessage

NAMESPACE: Final = "scaraspec"
SUFFIX: Final = ".sig"
_MAX_SIGNER_BYTES: Final = 2**20
_KEY_TYPES: Final = ("ssh-", "ecdsa-", "sk-")
_SIGNER: Final = "signer"
_TIMEOUT_S: Final = 60


def signature_problem(file: BinaryIO, signature: Path, signer: Path) -> str:
    """Return why a signature is not that of a signer; empty if it is.

    Args:
        file: The signed file, open.
        signature: The file of the signature.
        signer: A public key (``KEY.pub``), or a file of allowed signers (see ssh-keygen(1)).

    Raises:
        PackageError: The file of the signer cannot be read, or ssh-keygen cannot be run.
    """
    if not signature.is_file():
        return UserMessage("{file} is missing: the package is unsigned", file=signature)
    with TemporaryDirectory(prefix="scaraspec-") as scratch:
        allowed = Path(scratch) / "allowed_signers"
        allowed.write_text(_allowed_signers(signer), encoding="utf-8")
        found = _run("find-principals", "-s", f"{signature}", "-f", f"{allowed}")
        names = found.stdout.decode("utf-8", "replace").splitlines()
        if found.returncode or not names:
            return UserMessage("{file} was not made by {signer}", file=signature, signer=signer)
        known = ("-f", f"{allowed}", "-I", names[0], "-n", NAMESPACE, "-s", f"{signature}")
        os.lseek(file.fileno(), 0, os.SEEK_SET)
        if _run("verify", *known, file=file).returncode:
            return UserMessage("{file} is not a signature of this package", file=signature)
    return ""


def _allowed_signers(signer: Path) -> str:
    """Return the content of a file of allowed signers.

    Raises:
        PackageError: The file cannot be read, or is too large.
    """
    try:
        with signer.open("rb") as file:
            text = file.read(_MAX_SIGNER_BYTES).decode("utf-8", "replace")
    except OSError as error:
        raise PackageError(
            UserMessage("{signer} cannot be read: {reason}", signer=signer, reason=error.strerror),
            ExitStatus.USAGE,
        ) from None
    return f'{_SIGNER} namespaces="{NAMESPACE}" {text}' if text.startswith(_KEY_TYPES) else text


def _run(
    operation: str, *arguments: str, file: BinaryIO | None = None
) -> subprocess.CompletedProcess[bytes]:
    program = shutil.which("ssh-keygen")
    if program is None:
        raise PackageError(
            "the signature cannot be verified: ssh-keygen is not installed", ExitStatus.INCONCLUSIVE
        )
    try:
        return subprocess.run(  # noqa: S603 - no shell; the paths are arguments of options
            [program, "-Y", operation, *arguments],
            stdin=file or subprocess.DEVNULL,
            capture_output=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise PackageError(
            UserMessage("the signature cannot be verified: ssh-keygen: {error}", error=error),
            ExitStatus.INCONCLUSIVE,
        ) from None
