"""What can be wrong with a file that is to be read, whatever its format."""


class CaptureError(Exception):
    """A capture that cannot be read at all; the message is one sentence for the user."""
