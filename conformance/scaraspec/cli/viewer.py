"""The Rerun viewer for a recording in progress."""

import socket
import subprocess
import sys
import time
from typing import Final

from scaraspec.api.viewer import has_viewer
from scaraspec.cli.problems import Problem

NO_VIEWER: Final = "the viewer needs the extra view: pip install 'scaraspec[view]'"

_HOST: Final = "127.0.0.1"
_START_S: Final = 20.0
_TRY_S: Final = 0.1
_OPTIONS: Final = ("--hide-welcome-screen",)


def open_viewer() -> str:
    """Open a viewer and return the URL to which a recording can be sent.

    Raises:
        Problem: The viewer is not installed or does not start.
    """
    if not has_viewer():
        raise Problem(NO_VIEWER)
    with socket.create_server((_HOST, 0)) as free:
        port = free.getsockname()[1]
    arguments = ("--bind", _HOST, "--port", str(port), *_OPTIONS)
    viewer = subprocess.Popen(  # noqa: S603 - our own interpreter and arguments
        [sys.executable, "-P", "-m", "rerun", *arguments],  # not a rerun.py in the current folder
        stdout=subprocess.DEVNULL,  # only the recorder writes to stdout
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C ends the recording, not the viewer
    )
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s and viewer.poll() in (None, 0):
        try:
            socket.create_connection((_HOST, port), _TRY_S).close()
        except OSError:
            time.sleep(_TRY_S)
        else:
            return f"rerun+http://{_HOST}:{port}/proxy"
    raise Problem("the Rerun viewer did not start: is there a screen?")
