"""The command line: arguments, help, progress and signals; `scaraspec.api` does the work."""

import signal
import sys
from typing import Final

_INTERRUPTED: Final = 3  # `ExitStatus.INCONCLUSIVE`, which is not imported yet


def main() -> None:
    """Run the command line.

    A signal that arrives before the command is imported ends it, too. The first process of a
    container would otherwise ignore it.
    """
    for name in (
        "SIGTERM",
        "SIGHUP",
        "SIGBREAK",
    ):  # Windows has the last instead of SIGHUP
        number = getattr(signal, name, None)
        if number and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    try:
        from scaraspec.cli.main import main as run  # noqa: PLC0415 - takes a part of a second
    except KeyboardInterrupt:
        sys.stderr.write("scaraspec: interrupted\n")
        sys.exit(_INTERRUPTED)
    run()
