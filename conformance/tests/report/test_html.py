"""The page is well-formed, complete in both languages, offline, and safe against hostile text.

Here the tests parse the page; test_browser.py tests it in a browser.
"""

import base64
import hashlib
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.report import html
from scaraspec.report.model import Case, Results, Role
from scaraspec.report.texts import TEXTS
from scaraspec.translation import Language

_VOID = frozenset({"meta", "input", "br"})
_IN_LINE = frozenset({"span", "code", "b", "bdi", "i", "a"})


@dataclass
class Element:
    """A tag, its attributes and its content."""

    tag: str
    attributes: dict[str, str]
    parent: "Element | None" = None
    parts: "list[Element | str]" = field(default_factory=list)

    @property
    def children(self) -> "list[Element]":
        return [part for part in self.parts if isinstance(part, Element)]

    @property
    def text(self) -> str:
        return "".join(part if isinstance(part, str) else part.text for part in self.parts)

    def has_class(self, name: str) -> bool:
        return name in self.attributes.get("class", "").split()


class Page(HTMLParser):
    """The elements of a page; raises an error for tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.all: list[Element] = []
        self._open: list[Element] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"duplicate attribute in {tag}"
        parent = self._open[-1] if self._open else None
        element = Element(tag, {name: value or "" for name, value in attrs}, parent)
        self.all.append(element)
        if parent:
            parent.parts.append(element)
        if tag not in _VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        if self._open:
            self._open[-1].parts.append(data)

    def of(self, tag: str, class_name: str = "") -> list[Element]:
        """Return all elements of a tag and class, in order."""
        return [e for e in self.all if e.tag == tag and (not class_name or e.has_class(class_name))]


def visible_text(element: Element, language: str) -> str:
    """Return the visible text in one language."""
    return " ".join(text_without(element, "zh" if language == "en" else "en").split())


def text_without(element: Element, hidden: str) -> str:
    """Return the text without elements of the class `hidden`; block elements add spaces."""
    if element.has_class(hidden):
        return ""
    parts = (
        part if isinstance(part, str) else text_without(part, hidden) for part in element.parts
    )
    separated = "" if element.tag in _IN_LINE else " "
    return separated + "".join(parts) + separated


@pytest.fixture
def page(full: Results) -> Page:
    """Return the page of the full results."""
    return Page(html.render(full))


def test_every_text_is_in_both_languages(page: Page) -> None:
    """Each English text has its Chinese text next to it."""
    english, chinese = page.of("span", "en"), page.of("span", "zh")
    assert len(english) == len(chinese) > 100
    for one, other in zip(english, chinese, strict=True):
        assert one.parent is other.parent
        assert (one.attributes["lang"], other.attributes["lang"]) == ("en", "zh")
        assert one.text
        assert other.text


@pytest.mark.parametrize("language", Language)
def test_language_option(full: Results, language: Language) -> None:
    """The option sets the first language; the switch has the data of both."""
    page = Page(html.render(full, language))
    (root,) = page.of("html")
    assert root.attributes == {"lang": language.value, "data-language": language.value}
    assert [
        b.attributes["data-switch"] for b in page.of("button") if "data-switch" in b.attributes
    ] == ["en", "zh"]
    changing = [e.attributes for e in page.all if "data-attribute" in e.attributes]
    assert changing
    for attributes in changing:
        assert attributes[attributes["data-attribute"]] == attributes[f"data-{language.value}"]


def test_the_verdict(page: Page) -> None:
    """The text, its meaning, and how much was judged."""
    (verdict,) = page.of("section", "verdict")
    assert verdict.has_class("is-nonconformant")
    assert visible_text(verdict, "en").startswith(
        "Nonconformant Cell 7 控制器 At least one requirement of the document is violated. "
        "3 of 7 requirements in scope were judged. The cases tried 12 values. 1 ✕ fail"
    )
    assert visible_text(verdict, "zh").startswith(
        "不符合 Cell 7 控制器 至少有一项协议文档的要求项被违反。"
    )


@pytest.mark.parametrize("conclusion", Conclusion)
def test_every_conclusion(full: Results, conclusion: Conclusion) -> None:
    """Also a run without cases and without a session."""
    bare = replace(
        full, verdict=conclusion, cases=(), requirements=(), counts={}, readings={}, session=None
    )
    page = Page(html.render(bare))
    (heading,) = page.of("h1")
    assert visible_text(heading, "en") == TEXTS[conclusion.value]
    assert "There are no cases." in page.of("body")[0].text


def test_content_of_a_case(page: Page) -> None:
    """Requirement, original text, clause and lines, both values, bytes, reproduction command."""
    case = page.of("details", "case")[0]
    text = visible_text(case, "en")
    for part in (
        "✕ fail 3/18 run_program ended a second time",
        "To each first reply '1' of a two-stage command there must be one final result",
        "执行结束后将结果返回",
        "L318 · firm · derived: it follows from other parts of the document · Open points: A-3-7",
        "Expected one final result",
        "Observed a second one",
        "controller → client run_program, final result · +566 ms · connection 1, byte 73, 7 bytes",
        "Responsible: the system under test · Hazard: motion · Duration: 1.5 s · Examples: 12",
        "Reproduction command scaraspec certify controller tcp://robot --only 3/18",
    ):
        assert part in text
    chinese = visible_text(case, "zh")
    for part in ("应为 一个最终结果", "责任方: 被测系统", "控制层 → 应用层", "第 73 字节起"):
        assert part in chinese
    assert "open" in case.attributes


def test_a_frame_is_split_at_its_fields(page: Page) -> None:
    """Bytes between fields are separate; every byte is shown once."""
    (frame,) = page.of("div", "frame")
    segments = [" ".join(child.text.split()) for child in frame.children]
    assert segments == ["CC start C2A", "90 30 02", "31 31 flag 11", "AA"]


def test_order_of_cases(page: Page) -> None:
    """Failures, errors, inconclusive, tolerated, passes, not judged."""
    verdicts = [case.attributes["data-verdict"] for case in page.of("details", "case")]
    assert verdicts == ["fail", "error", "inconclusive", "tolerated", "pass", "none"]
    offered = [box.attributes["value"] for box in page.of("input") if "value" in box.attributes]
    assert offered == verdicts


def test_coverage_squares(page: Page, full: Results) -> None:
    """One per requirement, with its verdict and a link to its first case."""
    squares = [e for e in page.all if e.has_class("square") and "title" in e.attributes]
    assert len(squares) == len(full.requirements)
    assert [e.tag for e in squares] == ["a"] * 6 + ["i"]
    assert squares[1].has_class("is-fail")
    assert squares[1].attributes["href"] == "#case-0"
    assert squares[1].attributes["title"].startswith("3/18 · fail · To each first reply")


def test_content_of_the_dialect(page: Page) -> None:
    """Default or not, mixed, claimed; an unknown key is allowed."""
    (table,) = page.of("table", "dialect")
    text = visible_text(table, "en")
    for part in (
        "endian A-5-2 What is the byte order",
        "big the most significant byte first little the least significant byte first mixed: one",
        "Claimed: little · not as claimed",
        "a controller accepts 0x01 to 0x04, too default Claimed: ascii · as claimed",
        "not observed Claimed: counts",
        "no_such_key x",
    ):
        assert part in text


def test_content_of_the_session(page: Page) -> None:
    """Counts, command timing and plot, transfers, runs, connections, gaps."""
    (section,) = (e for e in page.of("section") if e.attributes.get("id") == "session")
    text = visible_text(section, "en")
    for part in (
        "connections 2 frames 18 bytes from the client 1,323 bytes from the controller 72",
        "gaps in the recording 4 invalid bytes 3",
        "run_program Run a program 3 1 15.1 µs 35.7 µs 44 µs 44 µs",
        "0x3E 1 1",
        "a.rob upload +0 µs 305 ms 200 / 1,024 6 failed cut",
        "a.rob run +0 µs – refused 20 program file does not exist",
        "b.rob simulation +0 µs 12.5 ms odd ZZ",
        "1 a:1 → b:8877",
        "mislaid",
        "client → controller 12 unknown lost packets and 3 more",
    ):
        assert part in text
    plots = [svg for svg in page.of("svg") if svg.parent and svg.parent.has_class("plot")]
    assert len(plots) == 3
    assert [child.tag for child in plots[1].children].count("rect") == 2


def test_the_footer(page: Page) -> None:
    """The order of precedence (A-0-10), and the note on safety."""
    (footer,) = page.of("footer")
    english, chinese = visible_text(footer, "en"), visible_text(footer, "zh")
    assert "scaraspec is not a safety function" in english
    assert "the frame rule of clause 3, the prose of a clause" in english
    assert "A-0-10" in english
    assert "scaraspec 不是安全功能" in chinese
    assert "第三章的帧格式、各节正文" in chinese


@pytest.mark.parametrize("name", ["complaint-1", "plant-b-other-dialect", "plant-a-torn"])
def test_the_page_makes_no_network_requests(audited: Callable[[str], Results], name: str) -> None:
    """No address, source or import; the content security policy forbids them, too."""
    text = html.render(audited(name))
    page = Page(text)
    for element in page.all:
        assert not {"src", "srcset", "action", "background", "data"} & element.attributes.keys()
        assert element.attributes.get("href", "#").startswith("#")
        assert element.tag not in ("link", "iframe", "object", "embed", "img", "base", "form")
    assert not re.search(r"url\(|@import|https?:|fetch\(|XMLHttpRequest|import\(", text)
    policies = [e.attributes["content"] for e in page.of("meta") if "http-equiv" in e.attributes]
    assert "default-src 'none'" in policies[0]


def test_only_our_script_may_run(page: Page) -> None:
    """The policy contains the digest of the only script."""
    (script,) = page.of("script")
    digest = base64.b64encode(hashlib.sha256(script.text.encode()).digest()).decode()
    (policy,) = (e.attributes["content"] for e in page.of("meta") if "http-equiv" in e.attributes)
    assert f"script-src 'sha256-{digest}';" in policy


@pytest.mark.parametrize("language", Language)
def test_hostile_text_stays_text(
    hostile: Results, page: Page, language: Language, tmp_path: Path
) -> None:
    """Hostile text creates no element, attribute, control character or direction change."""
    path = tmp_path / "report.html"
    html.write(hostile, path, language)
    text = path.read_text(encoding="utf-8")
    attacked = Page(text)
    assert Counter(e.tag for e in attacked.all)["script"] == 1
    assert {e.tag for e in attacked.all} <= {e.tag for e in page.all} | {"code"}
    assert not [name for e in attacked.all for name in e.attributes if name.startswith("on")]
    assert not [c for c in text if (ord(c) < 32 and c != "\n") or c in "\u202e\ufffe\x7f"]
    shown = [e for e in attacked.all if "</script><script>alert(1)" in e.text and not e.children]
    assert len(shown) > 50
    assert all("⟨U+0000⟩⟨U+001B⟩[31m⟨U+202E⟩txt.exe⟨U+FFFE⟩" in e.text for e in shown)


def test_ids_and_links(page: Page, hostile: Results) -> None:
    """Ids are unique, and every link has a target, whatever the names of the cases."""
    for each in (page, Page(html.render(hostile))):
        ids = [e.attributes["id"] for e in each.all if "id" in e.attributes]
        assert len(ids) == len(set(ids))
        links = {e.attributes["href"] for e in each.all if "href" in e.attributes}
        assert {link[1:] for link in links if link.startswith("#")} <= set(ids)
        assert len({link for link in links if not link.startswith("#")}) == 1  # the recording


def test_link_to_the_recording(full: Results, page: Page) -> None:
    """The command shows the moment; the file is a link if it is next to the page."""
    case = next(case for case in full.cases if case.wire)
    at = f"{case.wire[-1].time_ns / 10**9:.3f}"[:-1]
    (place, *_) = [e for e in page.of("code") if "--at" in e.text]
    assert place.text.startswith(f"scaraspec view run.mcap --at {at}")
    assert any(e.attributes.get("href") == "run.mcap" for e in page.of("a"))
    audit = replace(full, role=Role.CAPTURE)
    assert not any(e.attributes.get("href") == "run.mcap" for e in Page(html.render(audit)).of("a"))


def test_ics_and_error_output(page: Page) -> None:
    """The claims, and the error output of the process."""
    assert any("readings.endian = little" in " ".join(e.text.split()) for e in page.of("code"))
    assert any(e.text == "it is warm in here" for e in page.of("pre"))


def test_right_to_left_names(full: Results) -> None:
    """Names of a SUT are isolated from the text around them."""
    named = replace(full, subject=replace(full.subject, name="שלום.rob"))
    page = Page(html.render(named))
    holders = [e for e in page.all if e.text == "שלום.rob"]
    assert holders
    assert {e.tag for e in holders if not e.children} == {"bdi"}


def test_cases_are_collapsed(full: Results) -> None:
    """Only a failure that is the first case is open."""
    (failing,) = (case for case in full.cases if case.id == "3/18")
    many = replace(full, cases=tuple(replace(failing, id=f"3/18.{n}") for n in range(300)))
    cases = Page(html.render(many)).of("details", "case")
    assert len(cases) == 300
    assert [case for case in cases if "open" in case.attributes] == cases[:1]
    passing = replace(full, cases=full.cases[:1])
    assert "open" not in Page(html.render(passing)).of("details", "case")[0].attributes


def test_the_page_is_deterministic(full: Results) -> None:
    """Equal results give equal pages."""
    assert html.render(full) == html.render(full)


def test_most_important_findings(full: Results) -> None:
    """Next to the verdict, each finding once with a link; nothing if all cases pass."""
    alike = tuple(Case(f"3/1.{n}", ("3/1",), Verdict.FAIL, message="no <frame>") for n in range(3))
    page = html.render(replace(full, cases=alike))
    verdict, _, _ = page.partition("</section>")
    assert '<a href="#case-0">3/1.0</a> <span class="en" lang="en">and 2 more</span>' in verdict
    assert verdict.count("no &lt;frame&gt;") == 1
    passes = (Case("3/1", ("3/1",), Verdict.PASS),)
    assert 'class="first"' not in html.render(replace(full, cases=passes))
