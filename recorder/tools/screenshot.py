# ruff: noqa: INP001 - a script, not a package
"""Takes a picture of a recording in a viewer without a screen, and fails if the viewer complains.

For the pictures in README; no test needs it. It wants a software renderer:
``apt-get install mesa-vulkan-drivers libgl1-mesa-dri``.

    python recorder/tools/screenshot.py capture.rrd picture.png --elapsed 8.5
"""

import argparse
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

import rerun_cli  # type: ignore[import-untyped]  # it holds nothing but the viewer
from rerun.experimental import ViewerClient

_START_S: Final = 20.0
_SETTLE_S: Final = 2.5
"""The viewer tells nobody when it has drawn everything."""


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _connect(url: str) -> ViewerClient:
    deadline = time.monotonic() + _START_S
    while True:
        try:
            client = ViewerClient.connect(url)
            client.get_state()
        except Exception as error:  # noqa: BLE001 - the bindings raise whatever gRPC says
            if time.monotonic() > deadline:
                raise SystemExit(f"the viewer did not start: {error}") from None
            time.sleep(0.2)
        else:
            return client


def main() -> None:
    """Open, wait, look for complaints, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--elapsed", type=float, help="seconds on the timeline of that name")
    arguments = parser.parse_args()
    tool = shutil.which("rerun", path=str(Path(rerun_cli.__file__).parent))
    assert tool, "the rerun package brings its viewer"
    port = _free_port()
    viewer = subprocess.Popen(  # noqa: S603 - the tool that the rerun package brings
        [tool, "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port)],
        stderr=subprocess.DEVNULL,
    )
    try:
        client = _connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.open(str(arguments.recording.resolve()))
        time.sleep(_SETTLE_S)
        if arguments.elapsed is not None:
            client.set_time("elapsed", duration=arguments.elapsed, play_state="paused")
            time.sleep(_SETTLE_S)
        complaints = [f"{v.name}: {r}" for v in client.get_state().views for r in v.reports]
        client.save_screenshot(str(arguments.picture.resolve()))
    finally:
        viewer.terminate()
        viewer.wait()
    if complaints:
        sys.exit("\n".join(complaints))


if __name__ == "__main__":
    main()
