"""Settings of hypothesis, and fixtures for all tests of the suite."""

import gc
import os
from collections.abc import Callable
from itertools import count
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import settings

from scaraspec.translation import VARIABLE

# A failure prints the blob that reproduces it; examples are the same on every computer.
settings.register_profile("scaraspec", print_blob=True, deadline=None, derandomize=True)
settings.load_profile("scaraspec")
os.environ[VARIABLE] = "en"  # tests read messages, whatever the locale of the developer

_numbers = count()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mix the modules, so that the workers do not all wait for processes at the same time.

    Each worker begins with a contiguous part of the tests.
    """
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: crc32(item.nodeid.partition("::")[0].encode()))


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection, which would examine them each time."""
    gc.freeze()


def _run_with_stack(
    run: Callable[..., bool], item: pytest.Item, nextitem: pytest.Item | None
) -> bool:
    return run(item, nextitem=nextitem)


# For a call that does not fit in the current part of its stack, Python maps a new part, and unmaps
# it on the return. A frame that needs a large part leaves room for all deeper calls.
_run_with_stack.__code__ = _run_with_stack.__code__.replace(co_stacksize=100_000)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test with enough stack, which can save a quarter of its time."""
    return _run_with_stack(
        item.config.pluginmanager.getplugin("runner").pytest_runtest_protocol, item, nextitem
    )


@pytest.fixture(scope="session")
def fixtures_dir() -> Path:
    """The data folder of the repository."""
    return Path(__file__).parents[2] / "fixtures"


@pytest.fixture(autouse=True)
def _state_directory(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Keep the journals of a test out of the user's state directory and of other tests.

    Most tests need no folder; pytest makes one more slowly the more there are.
    """
    if "tmp_path" in request.fixturenames:
        folder: Path = request.getfixturevalue("tmp_path")
    else:
        folder = tmp_path_factory.getbasetemp() / f"{next(_numbers)}"
    monkeypatch.setenv("SCARASPEC_STATE", str(folder / "state"))
