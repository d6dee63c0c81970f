"""The page in headless Chromium: search, filter, keys, languages, print, hostile text.

Needs Chromium; run by `make test-browser`. The tests control the browser with its debugging
protocol over two pipes.
"""

import base64
import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import axe_core_python  # type: ignore[import-untyped]  # it contains only the rules
import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.report import html
from scaraspec.report.model import Results

pytestmark = pytest.mark.browser

_FLAGS: Final = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe"),
    *("--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--window-size=1200,900"),
)
_MANY: Final = 3000
_AXE: Final = Path(axe_core_python.__file__).with_name("axe.min.js")
_SERIOUS: Final = """
axe.run().then(found => found.violations
  .filter(each => ["serious", "critical"].includes(each.impact))
  .map(each => [each.id, each.nodes.flatMap(node => node.any.map(check => check.message))]))
"""


class Browser:
    """A page in headless Chromium.

    Args:
        profile: An empty folder for the browser's files.
    """

    def __init__(self, profile: Path) -> None:
        here_reads, there_writes = os.pipe()
        there_reads, here_writes = os.pipe()

        def arrange() -> None:
            os.dup2(there_reads, 103)
            os.dup2(there_writes, 104)
            os.dup2(103, 3)
            os.dup2(104, 4)

        found = shutil.which("chromium") or shutil.which("google-chrome")
        assert found, "make test-browser needs Chromium"
        self._process = subprocess.Popen(
            [found, *_FLAGS, f"--user-data-dir={profile}", "about:blank"],
            close_fds=False,
            preexec_fn=arrange,  # noqa: PLW1509 - it needs its pipes as 3 and 4, and no thread runs
            stderr=subprocess.DEVNULL,
        )
        os.close(there_reads)
        os.close(there_writes)
        self._out, self._in = os.fdopen(here_writes, "wb", 0), os.fdopen(here_reads, "rb")
        self._number, self._session = 0, ""
        self.complaints: list[str] = []
        (page, *_) = [t for t in self._targets() if t["type"] == "page"]
        attached = self.do("Target.attachToTarget", targetId=page["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{domain}.enable")

    def _targets(self) -> Any:
        while True:
            infos = self.do("Target.getTargets")["targetInfos"]
            if any(info["type"] == "page" for info in infos):
                return infos

    def do(self, method: str, **params: Any) -> Any:
        """Send a command, and wait for its result."""
        self._number += 1
        order: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if self._session:
            order["sessionId"] = self._session
        self._out.write(json.dumps(order).encode() + b"\0")
        while (answer := self._read_message()).get("id") != self._number:
            pass
        assert "error" not in answer, answer
        return answer["result"]

    def _read_message(self) -> Any:
        reported = bytearray()
        while (byte := self._in.read(1)) not in (b"\0", b""):
            reported += byte
        assert reported, "the browser has ended"
        message = json.loads(reported)
        match message.get("method"):
            case "Runtime.exceptionThrown" | "Log.entryAdded":
                self.complaints.append(json.dumps(message["params"]))
            case "Network.requestWillBeSent":
                url = message["params"]["request"]["url"]
                if not url.startswith("file:"):
                    self.complaints.append(url)
        return message

    def open(self, file: Path) -> None:
        self.do("Page.navigate", url=file.as_uri())
        while self.evaluate("document.readyState") != "complete":
            pass

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page."""
        expected = {"returnByValue": True, "awaitPromise": True}
        answer = self.do("Runtime.evaluate", expression=expression, **expected)
        return answer["result"].get("value")

    def key(self, key: str) -> None:
        """Press a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.do("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.do("Input.dispatchKeyEvent", type="keyUp", key=key)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._out.close()
        self._in.close()


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    """A browser."""
    with closing(Browser(tmp_path / "profile")) as browser:
        yield browser
        assert browser.complaints == []


@pytest.fixture
def page_of(browser: Browser, tmp_path: Path) -> Any:
    """Return a function that opens the page of some results."""

    def show(results: Results) -> Browser:
        html.write(results, tmp_path / "report.html")
        browser.open(tmp_path / "report.html")
        return browser

    return show


SHOWN: Final = "[...document.querySelectorAll('.case')].filter(c => !c.hidden).length"


def test_search_and_filter_with_thousands_of_cases(page_of: Any, full: Results) -> None:
    """`/` focuses the search; only matching cases with selected verdicts are shown."""
    model = next(case for case in full.cases if case.verdict.value == "pass")
    many = tuple(replace(model, id=f"{model.id}.n{i}", message=f"case {i}") for i in range(_MANY))
    page = page_of(replace(full, cases=full.cases + many))
    assert page.evaluate(SHOWN) == len(full.cases) + _MANY
    page.key("/")
    for letter in ".n2999":
        page.key(letter)
    assert page.evaluate("document.activeElement.id") == "search"
    assert page.evaluate(SHOWN) == 1
    assert page.evaluate("document.querySelector('#shown').textContent") == "1"
    page.do(
        "Runtime.evaluate", expression="search.value = ''; search.dispatchEvent(new Event('input'))"
    )
    page.evaluate("document.querySelector('.filters input[value=pass]').click()")
    assert page.evaluate(SHOWN) == sum(case.verdict.value != "pass" for case in full.cases)


def test_keyboard_navigation(page_of: Any, full: Results) -> None:
    """`j` is next, `k` is previous, Enter opens."""
    page = page_of(full)
    page.key("j")
    page.key("j")
    here = "document.activeElement.closest('.case').id"
    assert page.evaluate(here) == "case-1"
    page.key("k")
    assert page.evaluate(here) == "case-0"


def test_language_switch(page_of: Any, full: Results) -> None:
    """One language is visible at a time."""
    page = page_of(full)
    seen = "getComputedStyle(document.querySelector('h1 .{}')).display != 'none'"
    assert (page.evaluate(seen.format("en")), page.evaluate(seen.format("zh"))) == (True, False)
    page.evaluate("document.querySelector('[data-switch=zh]').click()")
    assert (page.evaluate(seen.format("en")), page.evaluate(seen.format("zh"))) == (False, True)


def test_hostile_text_has_no_effect(page_of: Any, hostile: Results) -> None:
    """No script of a SUT runs, no element is created, no network request is made."""
    page = page_of(hostile)
    assert page.evaluate("document.scripts.length") == 1
    assert page.evaluate("document.querySelectorAll('img, iframe, object, svg a').length") == 0


def test_the_language_is_remembered(page_of: Any, full: Results) -> None:
    """The next page opens in the language that the reader has chosen."""
    page = page_of(full)
    assert page.evaluate("document.documentElement.lang") == "en"
    page.evaluate("document.querySelector('[data-switch=zh]').click()")
    assert page_of(full).evaluate("document.documentElement.lang") == "zh"


def test_a_long_report_is_printed_on_few_pages(page_of: Any, full: Results, tmp_path: Path) -> None:
    """Cases that passed or did not run are listed by their ids."""
    passed, skipped = (
        next(case for case in full.cases if case.verdict is verdict)
        for verdict in (Verdict.PASS, Verdict.NONE)
    )
    cases = [
        replace(each, id=f"4.{number}/1")
        for number in range(500)
        for each in ((passed, skipped) if number < 30 else (passed,))
    ]
    long = replace(full, cases=(*full.cases, *cases))
    html.write(long, tmp_path / "long.html")
    assert (tmp_path / "long.html").stat().st_size < 1_000_000
    printed = base64.b64decode(page_of(long).do("Page.printToPDF")["data"])
    assert 1 < len(re.findall(rb"/Type\s*/Page\b", printed)) <= 15


@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 375])
def test_accessibility(page_of: Any, full: Results, width: int, scheme: str, language: str) -> None:
    """axe finds no serious violation, with all cases open."""
    page = page_of(full)
    scheme_feature = {"name": "prefers-color-scheme", "value": scheme}
    page.do("Emulation.setEmulatedMedia", features=[scheme_feature])
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    page.do("Emulation.setDeviceMetricsOverride", **size)
    page.evaluate(f"document.querySelector('[data-switch={language}]').click()")
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
    page.evaluate(_AXE.read_text("utf-8"))
    assert page.evaluate(_SERIOUS) == []
    assert page.evaluate("document.documentElement.lang") == language


def test_page_width_and_print(page_of: Any, full: Results) -> None:
    """No element is wider than the window; the printed document is complete."""
    page = page_of(full)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    printed = base64.b64decode(page.do("Page.printToPDF")["data"])
    assert printed.startswith(b"%PDF")
