"""Fills a folder with scaraspec and all packages that it needs, for machines without internet.

    python release/wheelhouse.py dist/scaraspec-*.whl --platform windows --out wheels

On the other machine: ``pip install --no-index --find-links wheels scaraspec``. The versions are
those of requirements.lock, with which scaraspec is tested.
"""

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

_LOCK: Final = Path(__file__).parents[1] / "requirements.lock"

_GLIBC: Final = ("2_34", "2_28", "2_27", "2_26", "2_24", "2_17", "2_12", "2_5")
_PLATFORMS: Final = {
    "linux": (
        "x86_64-manylinux_2_34",
        [*(f"manylinux_{glibc}_x86_64" for glibc in _GLIBC), "manylinux2014_x86_64"],
    ),
    "windows": ("x86_64-pc-windows-msvc", ["win_amd64"]),
}
"""For each platform its name for uv, which resolves, and its tags for pip, which downloads."""


def main() -> None:
    """Read the arguments and fill the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path, help="the wheel of scaraspec, made by `make wheel`")
    parser.add_argument("--platform", choices=_PLATFORMS, required=True)
    parser.add_argument("--python", default="3.12", help="version on the other machine [3.12]")
    parser.add_argument("--extras", default="pcap,serial", help="empty for none [pcap,serial]")
    parser.add_argument("--out", type=Path, default=Path("wheels"), help="the folder [wheels]")
    given = parser.parse_args()
    if next(given.out.glob("*.whl"), None):
        sys.exit(f"{given.out} has wheels already: remove it, or choose another folder")
    platform, tags = _PLATFORMS[given.platform]
    wheel = given.wheel.resolve()
    wanted = f"scaraspec[{given.extras}] @ {wheel.as_uri()}\n"
    lines = _run(
        *("-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate"),
        *("--python-platform", platform, "--python-version", given.python),
        *("--constraint", str(_LOCK), "-"),
        text=wanted,
    ).splitlines()
    packages = [line for line in lines if re.match(r"[\w.-]+==", line)]
    given.out.mkdir(parents=True, exist_ok=True)
    shutil.copy(wheel, given.out)
    _run(
        *("-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"),
        *("--only-binary=:all:", "--python-version", given.python, "--dest", str(given.out)),
        *(word for tag in tags for word in ("--platform", tag)),
        *packages,
    )
    files = list(given.out.glob("*.whl"))
    size_mb = sum(file.stat().st_size for file in files) / 1e6
    sys.stdout.write(f"{len(files)} wheels, {size_mb:.0f} MB, in {given.out}\n")


def _run(*arguments: str, text: str = "") -> str:
    """Run a module of Python and return its output; its errors end this program."""
    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, *arguments], input=text, stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        sys.exit(done.returncode)
    return done.stdout


if __name__ == "__main__":
    main()
