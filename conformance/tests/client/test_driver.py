"""The reference client's driver, line by line, against the virtual controller."""

import asyncio
import json
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from scaraspec.client.aio import AsyncClient
from scaraspec.client.driver import Driver

Run = Callable[..., list[Mapping[str, Any]]]


@pytest.fixture
def run() -> Run:
    """Return the answers of the driver to these requests, in the order of completion."""

    def talk(*orders: str) -> list[Mapping[str, Any]]:
        async def serve() -> list[Mapping[str, Any]]:
            printed: asyncio.Queue[Mapping[str, Any]] = asyncio.Queue()
            driver = Driver(
                printed.put_nowait, lambda url, password: AsyncClient(url, password=password)
            )
            answers = []
            for order in orders:
                driver.take(order)
                answers.append(await printed.get())
            await driver.end()
            return answers

        return asyncio.run(serve())

    return talk


def test_unknown_operation(run: Run) -> None:
    """The answer is unimplemented, connected or not."""
    assert run('{"id": "a", "do": "levitate"}') == [{"id": "a", "unimplemented": True}]


@pytest.mark.parametrize("line", ["nonsense", "[]", "{}", '{"id": 1}', "null"])
def test_invalid_line(run: Run, line: str) -> None:
    """The answer is an error, and the driver continues."""
    answer, after = run(line, '{"id": 2, "do": "levitate"}')
    assert answer["id"] is None
    assert answer["ok"] is False
    assert after["unimplemented"]


@pytest.mark.parametrize(
    ("order", "receive_frame"),
    [
        ({"do": "get_status"}, "send connect first"),
        ({"do": "connect", "host": "127.0.0.1", "port": 1}, "cannot connect"),
        ({"do": "connect", "port": 1}, "host"),
    ],
)
def test_failed_request(run: Run, order: Mapping[str, Any], receive_frame: str) -> None:
    """The answer is an error of one sentence."""
    (answer,) = run(json.dumps({"id": 1, **order}))
    assert answer["ok"] is False
    assert receive_frame in answer["error"]
