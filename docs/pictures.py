"""Makes the pictures of the documentation (`make pictures`).

    python docs/pictures.py reports/out/demo

- rerun.png, report.png: the recording of a demo in the viewer, and its report in a browser.
- terminal.svg: commands that read this recording, with their output.
- packages.svg: the dependency order of the packages, from the contract in pyproject.toml.

Needs Chromium, and a software renderer for the viewer (mesa-vulkan-drivers, libgl1-mesa-dri).
"""

import argparse
import html
import os
import pty
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Final

from PIL import Image
from rich.console import Console
from rich.text import Text

HERE: Final = Path(__file__).parent
SCREENSHOT: Final = HERE.parent / "recorder" / "tools" / "screenshot.py"
ELAPSED_S: Final = "3.0"
WIDTHS_PX: Final = {"rerun": 1280, "report": 900}
COLORS: Final = 200
COLUMNS: Final = 118
LINES: Final = 12
"""How many lines of the output of each command are shown."""
COMMANDS: Final = (
    "scaraspec exchanges capture.mcap --no-queries",
    "scaraspec audit capture.mcap",
)
BOX_PX: Final = 44
GAP_PX: Final = 12
ROW_PX: Final = 920


def main() -> None:
    """Make all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, help="folder of a finished scaraspec demo")
    demo = parser.parse_args().demo.resolve()
    (HERE / "packages.svg").write_text("\n".join(packages()) + "\n", "utf-8")
    (HERE / "terminal.svg").write_text(terminal(demo), "utf-8")
    screenshots(demo)


def screenshots(demo: Path) -> None:
    """Take the pictures of viewer and report, and make them small."""
    with tempfile.TemporaryDirectory() as folder:
        taken = {name: Path(folder) / f"{name}.png" for name in WIDTHS_PX}
        viewer = (SCREENSHOT, demo / "capture.rrd", taken["rerun"], "--elapsed", ELAPSED_S)
        browser = (
            *("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"),
            *("--window-size=1200,1500", f"--screenshot={taken['report']}"),
            f"file://{demo / 'report.html'}",
        )
        subprocess.run([sys.executable, *map(str, viewer)], check=True)  # noqa: S603 - ours
        subprocess.run(["chromium", *browser], check=True)  # noqa: S603, S607 - the system's browser
        for name, width_px in WIDTHS_PX.items():
            with Image.open(taken[name]) as picture:
                size = (width_px, picture.height * width_px // picture.width)
                small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
                small.quantize(COLORS).save(HERE / f"{name}.png", optimize=True)


def terminal(demo: Path) -> str:
    """Return an SVG of a terminal in which the commands are run in the folder of the demo."""
    console = Console(record=True, width=COLUMNS, file=StringIO())
    for command in COMMANDS:
        console.print(Text(f"$ {command}", style="bold"))
        lines = Text.from_ansi(output_of(command, demo)).split()
        for line in lines[:LINES]:
            console.print(line, overflow="ellipsis", no_wrap=True)
        if len(lines) > LINES:
            console.print("…")
    svg = console.export_svg(title="scaraspec")
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)  # fonts of another host


def output_of(command: str, folder: Path) -> str:
    """Run a command of scaraspec in a terminal, and return what it prints."""
    master, terminal = pty.openpty()
    arguments = [sys.executable, "-m", *shlex.split(command)]
    environment = os.environ | {"COLUMNS": f"{COLUMNS}"}
    process = subprocess.Popen(arguments, cwd=folder, env=environment, stdout=terminal)  # noqa: S603 - ours
    os.close(terminal)
    printed = b"".join(_read(master))
    process.wait()
    return printed.decode("utf-8").replace("\r", "")


def _read(master: int) -> Iterator[bytes]:
    try:
        while data := os.read(master, 4096):
            yield data
    except OSError:  # the end on Linux
        return
    finally:
        os.close(master)


def packages() -> Iterator[str]:
    """Yield the lines of an SVG with a row for each layer; packages import from lower rows."""
    pyproject = tomllib.loads((HERE.parent / "pyproject.toml").read_text("utf-8"))
    contracts = pyproject["tool"]["importlinter"]["contracts"]
    (layers,) = (each["layers"] for each in contracts if each["name"] == "packages")
    height_px = len(layers) * (BOX_PX + GAP_PX) + GAP_PX
    size = f'width="{ROW_PX + 2 * GAP_PX}" height="{height_px}"'
    yield f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="15">'
    yield '<rect width="100%" height="100%" fill="#ffffff"/>'
    for row, layer in enumerate(layers):
        names = [name.strip().removeprefix("scaraspec.") for name in layer.split("|")]
        width_px = (ROW_PX - GAP_PX * (len(names) - 1)) / len(names)
        top_px = GAP_PX + row * (BOX_PX + GAP_PX)
        for column, name in enumerate(names):
            left_px = GAP_PX + column * (width_px + GAP_PX)
            yield (
                f'<rect x="{left_px:g}" y="{top_px}" width="{width_px:g}" height="{BOX_PX}" rx="5"'
                ' fill="#e8eaf6" stroke="#3f51b5"/>'
            )
            yield (
                f'<text x="{left_px + width_px / 2:g}" y="{top_px + BOX_PX / 2 + 5:g}"'
                f' text-anchor="middle" fill="#1a237e">{html.escape(name)}</text>'
            )
    yield "</svg>"


if __name__ == "__main__":
    main()
