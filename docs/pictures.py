"""Makes the README's pictures from a demo: the recording in the viewer, the report in a browser.

    python docs/pictures.py reports/out/demo

Needs Chromium, and a software renderer for the viewer (mesa-vulkan-drivers, libgl1-mesa-dri).
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from PIL import Image

HERE: Final = Path(__file__).parent
SCREENSHOT: Final = HERE.parent / "recorder" / "tools" / "screenshot.py"
ELAPSED_S: Final = "3.0"
WIDTHS_PX: Final = {"rerun": 1280, "report": 900}
COLORS: Final = 200


def main() -> None:
    """Take both pictures and make them small."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, help="folder of a finished scaraspec demo")
    demo = parser.parse_args().demo.resolve()
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


if __name__ == "__main__":
    main()
