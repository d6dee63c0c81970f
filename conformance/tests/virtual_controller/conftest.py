"""Fixtures of the virtual controller tests: a plant at HOME at time 0."""

from datetime import datetime

import pytest

from scaraspec.virtual_controller.plant import Plant


@pytest.fixture
def plant() -> Plant:
    """A robot at power-on, whose clock shows the example of the document (L172)."""
    return Plant(datetime(2014, 12, 22, 14, 30), now_s=0.0)  # noqa: DTZ001 - the document names no zone
