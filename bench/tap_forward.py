"""tap_forward PORT TARGET [FOLDER]: the tap of the recorder, whose records are not written.

They are dropped at once; or, where FOLDER is to hold their spool, they are packed into blocks as
ever, and those are dropped. Ends when its standard input closes.
"""

import asyncio
import gc
import sys
from collections.abc import Callable
from pathlib import Path

from scaraspec_recorder.spool.spool import SpoolWriter
from scaraspec_recorder.tap import tap
from scaraspec_recorder.tap.routes import Upstream

CallLater = Callable[[float, Callable[[], None]], object]


def spool_writer(folder: Path, call_later: CallLater) -> SpoolWriter:
    """Return a spool writer that packs records and does not write them."""
    return SpoolWriter(folder, call_later, write=lambda _, block: len(block))


def drop(*_record: object) -> None:
    """Drop a record."""


async def main(port: int, target: int, *folder: str) -> None:
    """Forward until standard input closes."""
    loop = asyncio.get_running_loop()
    append = spool_writer(Path(*folder), loop.call_later).append if folder else drop
    route = Upstream("127.0.0.1", target)
    await tap.Tap(route, append).start(route.listen("127.0.0.1", port))
    gc.freeze()  # like the recorder
    closed = asyncio.Event()
    loop.add_reader(sys.stdin, closed.set)
    await closed.wait()


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=tap.new_event_loop) as runner:
        runner.run(main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:]))
