"""Writes docs/licences.md: the licence of each package that scaraspec or an extra installs.

The packages must be installed in this environment, as `make check` installs them.
"""

import re
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_PAGE: Final = Path(__file__).parents[1] / "docs/licences.md"
_TEXT: Final = """\
# Licences

scaraspec is licensed under Apache-2.0 ([LICENSE](../LICENSE)). `python release/licences.py`
writes this page from the metadata of the installed packages, on Linux. On Windows, colorama
(BSD-3-Clause) is installed instead of uvloop.

**scapy is GPL-2.0-only.** Only the extra `pcap`, and the extras that contain it, install it.
Without them no package is under the GPL.

| package | licence | installed by |
|---|---|---|
"""


def main() -> None:
    """Write the page."""
    installed_by: dict[str, list[str]] = {}
    extras = sorted(distribution("scaraspec").metadata.get_all("Provides-Extra") or [])
    everywhere = set(_closure("scaraspec", ""))
    for extra in extras:
        for name in _closure("scaraspec", extra):
            if name not in everywhere:
                installed_by.setdefault(name, []).append(extra)
    rows = dict.fromkeys(everywhere, "every installation") | {
        name: ", ".join(f"`{extra}`" for extra in names) for name, names in installed_by.items()
    }
    lines = [f"| {name} | {_licence(distribution(name))} | {rows[name]} |" for name in sorted(rows)]
    _PAGE.write_text(_TEXT + "\n".join(lines) + "\n", "utf-8")
    sys.stdout.write(f"{len(rows)} packages in {_PAGE}\n")


def _closure(name: str, extra: str) -> Iterator[str]:
    """Yield the packages that a package with an extra needs, on this system."""
    seen: set[tuple[str, str]] = set()
    pending = [(name, extra)]
    while pending:
        package, part = pending.pop()
        for text in distribution(package).requires or ():
            need = Requirement(text)
            if need.marker and not need.marker.evaluate({"extra": part}):
                continue
            own = canonicalize_name(need.name)
            for wanted in ("", *need.extras):
                if (own, wanted) not in seen:
                    seen.add((own, wanted))
                    pending.append((own, wanted))
    yield from sorted(
        {package for package, _ in seen if package != name and _is_installed(package)}
    )


def _is_installed(name: str) -> bool:
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True


def _licence(package: Distribution) -> str:
    """Return the licence: the expression, otherwise the classifiers, otherwise the first line."""
    about = package.metadata
    if about["License-Expression"]:
        return str(about["License-Expression"])
    classified = [
        each.rpartition(" :: ")[2]
        for each in about.get_all("Classifier") or ()
        if each.startswith("License :: OSI Approved ::")
    ]
    stated = str(about["License"] or "").strip().partition("\n")[0]
    return " and ".join(classified) or re.sub(r"\|", "/", stated) or "not stated"


if __name__ == "__main__":
    main()
