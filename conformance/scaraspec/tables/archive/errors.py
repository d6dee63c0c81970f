"""The error of archives."""


class ArchiveError(Exception):
    """A store, a source or a query is wrong; the message is one sentence."""
