"""`scaraspec prove`: its arguments and matrix, and the stands where implementations are tried."""

from scaraspec.cli.prove.arguments import command

__all__ = ["command"]
