"""Errors of capture files, independent of their format."""


class CaptureError(Exception):
    """The capture cannot be read. The message is one sentence for the user."""


class TornCaptureError(CaptureError):
    """The capture is torn or damaged before its first packet or message."""
