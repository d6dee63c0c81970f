"""Mandatory cases: the dated lists in `spec/mandatory`, one series for each role.

`make spec` makes a list from the collected cases. A list that a package may name is never changed:
a change of the cases gives a new file, with the difference in its history.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

import scaraspec
from scaraspec.report.codec import from_plain, to_plain
from scaraspec.report.model import Role

SCHEMA: Final = "scaraspec.mandatory/1"
_PACKAGE: Final = Path(scaraspec.__file__).parent


@dataclass(frozen=True, slots=True)
class Change:
    """How a list differs from the one before it; cases by id.

    Attributes:
        date: The date of the list that has the difference.
        new: The cases that were added.
        repaired: The cases that were corrected: an earlier verdict of them may be wrong.
        withdrawn: The cases that were removed.
    """

    date: str
    new: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    withdrawn: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MandatoryList:
    """The cases of a certification.

    Attributes:
        id: The role and the date, such as ``controller-2026-11-26``.
        role: The role of the SUT.
        version: The version of scaraspec that has these cases.
        cases: The ids of the mandatory cases, each with the requirements that it judges.
        optional_cases: The same of cases that need not run: they send undefined opcodes.
        optional_hooks: The hooks that the ICS may leave out; the cases that need them are skipped.
        unless_claimed: The requirements that no case can judge if the ICS has one of these claims,
            such as ``readings.pipelining=one``. A claim that the run refutes is a failure.
        history: The differences between this list and the earlier ones, the oldest first.
    """

    id: str
    role: Role
    version: str
    cases: Mapping[str, tuple[str, ...]]
    optional_cases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    optional_hooks: tuple[str, ...] = ()
    unless_claimed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    history: tuple[Change, ...] = ()

    def to_json(self) -> str:
        """Return the text of its file; equal lists give equal bytes.

        Empty members are not written: a later version may add members, and the checksum stays.
        """
        members = {name: value for name, value in to_plain(self).items() if value}
        plain = {"schema": SCHEMA, **members}
        return json.dumps(plain, ensure_ascii=False, indent=1, sort_keys=True) + "\n"

    @property
    def sha256(self) -> str:
        """The SHA-256 checksum of its file."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    @property
    def title(self) -> str:
        """The id with the checksum, as results name the list."""
        return f"{self.id} sha256:{self.sha256}"


def mandatory_lists(role: Role) -> tuple[MandatoryList, ...]:
    """Return all lists of a role that this version contains, the oldest first."""
    return _lists(list_folder(), role)


@cache
def _lists(folder: Path, role: Role) -> tuple[MandatoryList, ...]:
    files = sorted(folder.glob(f"{role.value}-*.json"))
    return tuple(
        from_plain(MandatoryList, json.loads(file.read_text(encoding="utf-8"))) for file in files
    )


def list_folder() -> Path:
    """Return the folder of the lists, in the wheel or in the repository."""
    installed = _PACKAGE / "_mandatory"
    return installed if installed.exists() else _PACKAGE.parents[1] / "spec" / "mandatory"
