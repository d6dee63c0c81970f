"""Whether recordings can be drawn for the Rerun viewer."""

import importlib.util


def has_viewer() -> bool:
    """Return whether the extra ``view`` is installed."""
    return importlib.util.find_spec("rerun") is not None
