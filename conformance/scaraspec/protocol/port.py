"""The TCP port of a controller."""

from typing import Final

DEFAULT_PORT: Final = 8877
"""服务器端的接口为 8877 (clause 2, L79; A-2-1)."""
