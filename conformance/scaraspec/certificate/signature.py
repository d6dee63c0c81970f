"""Detached signature of a package, made and verified with `ssh-keygen -Y`."""

import os
import shutil
import subprocess
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Signature:
    """What a signature is.

    Attributes:
        problem: Why it is not that of the signer; empty if it is.
        signatory: The verified name, if the signer has one, and the fingerprint of the key.
    """

    problem: str = ""
    signatory: str = ""


def check(file: BinaryIO, signature: Path, signer: Path) -> Signature:
    """Check whether a signature is that of a signer.

    Args:
        file: The signed file, open.
        signature: The file of the signature.
        signer: A public key (``KEY.pub``), or a file of allowed signers (see ssh-keygen(1)).

    Raises:
        PackageError: The file of the signer cannot be read, or ssh-keygen cannot be run.
    """
    if not signature.is_file():
        return Signature(UserMessage("{file} is missing: the package is unsigned", file=signature))
    with TemporaryDirectory(prefix="scaraspec-") as scratch:
        allowed = Path(scratch) / "allowed_signers"
        allowed.write_text(_allowed_signers(signer), encoding="utf-8")
        found = _run("find-principals", "-s", f"{signature}", "-f", f"{allowed}")
        names = found.stdout.decode("utf-8", "replace").splitlines()
        if found.returncode or not names:
            text = "{file} was not made by {signer}"
            return Signature(UserMessage(text, file=signature, signer=signer))
        known = ("-f", f"{allowed}", "-I", names[0], "-n", NAMESPACE, "-s", f"{signature}")
        os.lseek(file.fileno(), 0, os.SEEK_SET)
        verified = _run("verify", *known, file=file)
        if verified.returncode:
            text = "{file} is not a signature of this package"
            return Signature(UserMessage(text, file=signature))
    key = verified.stdout.decode("utf-8", "replace").strip().rpartition(" with ")[2]
    return Signature(signatory=key if names[0] == _SIGNER else f"{names[0]}, {key}")


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
