"""`scaraspec demo`: arguments, and the session that is recorded."""

from scaraspec.cli.demo.arguments import command

__all__ = ["command"]
