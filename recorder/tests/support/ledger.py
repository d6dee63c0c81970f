"""A sink that keeps byte counts and hashes, for streams that are too long to keep.

It is importable in the processes of a recorder, unlike a fixture.
"""

import json

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.byte_accounting import ByteAccounting
from scaraspec_recorder.sinks.sink import OutputFolder


class Ledger:
    def __init__(self, folder: OutputFolder) -> None:
        self._path = folder.new("ledger.json")
        self._accounts = ByteAccounting()
        self._closed: dict[str, dict[str, str]] = {}

    def write(self, event: WireEvent) -> None:
        self._closed |= self._accounts.add(event)

    def tick(self, now_ns: int) -> None:
        pass

    def close(self) -> None:
        self._path.write_text(json.dumps(self._closed | self._accounts.close()))
