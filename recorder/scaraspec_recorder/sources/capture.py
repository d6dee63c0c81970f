"""Opens a capture file of any format, which its first bytes identify."""

from collections.abc import Callable
from pathlib import Path

from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sources.mcap_reader import McapCapture, read_mcap
from scaraspec_recorder.sources.pcap_reader import PcapCapture, read_pcap

__all__ = ["McapCapture", "PcapCapture", "open_capture"]


def open_capture(
    path: Path, *, port: int | None, wait: Callable[[], bool] | None = None
) -> McapCapture | PcapCapture:
    """Open an MCAP, pcap or pcapng file.

    Args:
        path: The file.
        port: TCP port of the controller in packet captures; see `read_pcap`.
        wait: Called at the end of a recording in progress; returns whether to read on.

    Returns:
        The capture: an iterable of wire events with a summary.

    Raises:
        CaptureError: The file cannot be read, or has another format.
    """
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC))
    except OSError as error:
        raise CaptureError(
            UserMessage(
                "{path} cannot be read: {reason}", path=path, reason=error.strerror or error
            )
        ) from None
    if not head:
        raise CaptureError(UserMessage("{path} is empty: nothing was recorded", path=path))
    return read_mcap(path, wait) if head == MAGIC else read_pcap(path, port=port)
