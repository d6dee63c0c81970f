"""The summary on a terminal: the verdict first, short, and safe against hostile text."""

import io
import re
from collections.abc import Callable
from dataclasses import replace

import pytest
from rich.console import Console

from scaraspec.report import terminal
from scaraspec.report.model import Results

WHERE = "connection 1, C2A byte 73, 7 bytes"
REPLAY = "scaraspec certify controller tcp://robot --only 3/18"


def shown(results: Results, *, as_terminal: bool = False, findings: int = 10) -> str:
    """Return the printed text."""
    stream = io.StringIO()
    console = Console(
        file=stream,
        force_terminal=as_terminal,
        width=100,
        color_system="standard" if as_terminal else None,
    )
    terminal.show(results, console, findings=findings)
    return stream.getvalue()


def test_plain_lines_without_a_terminal(full: Results) -> None:
    """Each finding is one line for any console width, so that grep works."""
    counts = "1 fail, 1 error, 1 inconclusive, 1 tolerated, 1 pass, 1 none"
    compared = "(expected one final result; observed a second one)"
    assert shown(full).splitlines() == [
        "nonconformant: Cell 7 控制器",
        f"{counts}; 12 examples; 3 of 7 requirements in scope judged",
        "dialect of the client: no_such_key=x",
        "dialect of the controller: endian=big+little (mixed)",
        f"fail · 3/18 · run_program ended a second time {compared} · {WHERE} · {REPLAY}",
        "error · 9/9 · no such requirement",
        "inconclusive · 5.2/3 · the link was lost",
        "tolerated · 5.1/9 · (observed endian = big)",
        "none · 4.1/2",
    ]


def test_a_terminal_gets_a_table(full: Results) -> None:
    """The same facts, aligned and coloured."""
    text = shown(full, as_terminal=True)
    assert "\x1b[" in text
    for part in ("nonconformant", "Cell 7 控制器", "3/18", "one final result", "endian=big+little"):
        assert part in text
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    assert max(len(line) for line in plain.splitlines()) <= 100


def test_the_number_of_findings_is_limited(full: Results) -> None:
    """The others are counted."""
    lines = shown(full, findings=2).splitlines()
    assert [line.split(" · ")[0] for line in lines[4:]] == [
        "fail",
        "error",
        "and 3 more findings in the report",
    ]


def test_passes_are_not_listed(audited: Callable[[str], Results]) -> None:
    """Of a conforming capture, the summary shows the coverage and what was not judged."""
    conforming = audited("plant-a-morning-shift")
    lines = shown(conforming).splitlines()
    coverage = "no violation found (238 of 318 requirements judged)"
    assert lines[0] == f"{coverage}: plant-a-morning-shift.pcapng"
    assert "80 not judged: no traffic that shows it" in lines
    (unjudged, *_) = (each.id for each in conforming.requirements if not each.decided)
    lines = shown(replace(conforming, undecided={unjudged: 2})).splitlines()
    assert "79 not judged: no traffic that shows it" in lines
    assert "1 not judged: the traffic does not decide it" in lines
    assert not [line for line in lines if line.startswith("pass")]


def test_the_default_dialect_is_shown(audited: Callable[[str], Results]) -> None:
    """No output could mean that nothing was checked."""
    text = shown(audited("complaint-4"))
    assert "dialect of the client: the default, as far as observed" in text


@pytest.mark.parametrize("as_terminal", [False, True])
def test_hostile_text(hostile: Results, *, as_terminal: bool) -> None:
    """Only our own escape sequences, no control characters, no markup of rich."""
    marked = replace(hostile, subject=replace(hostile.subject, name="[red]x[/red]\x1b]0;title\x07"))
    text = shown(marked, as_terminal=as_terminal)
    assert "[red]x[/red]⟨U+001B⟩]0;title⟨U+0007⟩" in text
    assert "\x1b]" not in text
    assert "\u202e" not in text
    assert "\x00" not in text
    assert re.sub(r"\x1b\[[0-9;]*m", "", text).count("\x1b") == 0
    assert as_terminal or "\x1b" not in text


def test_no_command_of_a_ci_system(full: Results) -> None:
    """Text of the subject starts no line of plain output, for one capture and for several."""
    named = replace(full, subject=replace(full.subject, name="cell\n::error::done ##[group]"))
    output = io.StringIO()
    console = Console(file=output, force_terminal=False)
    terminal.show_captures([("cell\n::error::done ##[group]", named, "")], console)
    for text in (shown(named), output.getvalue()):
        assert "cell⟨U+000A⟩::error::done #⟨U+0023⟩[group]" in text


def test_a_long_comparison_is_truncated(full: Results) -> None:
    """The HTML page shows the whole text."""
    (case,) = (case for case in full.cases if case.id == "3/18")
    long = replace(full, cases=(replace(case, observed="x\n" * 500),))
    finding = shown(long).splitlines()[-1]
    assert "observed x x x" in finding
    assert len(finding) < 300
