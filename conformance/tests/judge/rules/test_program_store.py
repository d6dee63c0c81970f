"""The program store: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.program_files import Node, NodeType, Program, WaitSeconds, build
from scaraspec.protocol.transfer import FILE_DATA, chunks_of

PROGRAM = build(Program(nodes=(Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(1)),)))
DAMAGED = PROGRAM[:-1]


def session(*lines: str) -> str:
    """A login, then these lines."""
    return "\n".join(("login", *lines))


def listed(*parts: str, fetched: bool = False) -> str:
    """A list in one or several parts, which are pushed or fetched."""
    ask = "> list_programs\n"
    return ask + (ask if fetched else "").join(f"< list_programs {part}\n" for part in parts)


def upload(name: str, content: bytes = PROGRAM) -> str:
    """A file that is uploaded."""
    lines = [f"> upload_name {name}\n< upload_name 1"]
    for chunk in chunks_of(content):
        data = "".join(f"\\x{octet:02x}" for octet in FILE_DATA.encode(chunk))
        lines.append(f"> upload_chunk {data}\n< upload_chunk 1")
    return "\n".join(lines)


def delete(name: str, reply: str = "1") -> str:
    """A file that is deleted."""
    return f"> delete_program {name}\n< delete_program {reply}"


def default(name: str) -> str:
    """The default program."""
    return f"> get_default_program\n< get_default_program {name}"


IDLE = "> get_status\n< get_status 00"


def run(name: str, reply: str, result: str = "") -> str:
    """A program that is run."""
    return f"> run_program {name}\n< run_program {reply}" + (
        result and f"\n<90 run_program {result}"
    )


AT_ONCE = """
    > list_programs
    > list_programs
    < list_programs 1|a.rob
    < list_programs 0|b.rob
    < list_programs 1|a.rob
    < list_programs 0|b.rob
"""
RUNNING = "> run_program a.rob\n< run_program 1"

CASES = (
    ("4.10/4", "pass", session(listed("1|a.rob", "0|b.rob"))),
    ("4.10/4", "fail", session(listed("1|a.rob"), "+1", listed("1|a.rob"))),
    ("4.10/4", "fail", session(*3 * (listed("1|a.rob"), "+0.6"))),
    ("4.10/4", "fail", session(listed("1|a", "1|b"), "+1", listed("1|a", "1|b"))),
    # The rest of a list may be pushed after the list was requested again.
    ("4.10/4", "none", session(listed("1|a"), "+0.1", listed("1|a"))),
    ("4.10/4", "none", session(listed("1|a", "1|b"), "+0.1", listed("1|a"))),
    ("4.10/4", "none", session(listed("1|a.rob"))),
    ("4.10/5", "pass", session(listed("1|a.rob", "0|b.rob"))),
    ("4.10/5", "tolerated list_cont=request", session(listed("1|a.rob", "0|b.rob", fetched=True))),
    ("4.10/5", "none", session(listed("0|a.rob"))),
    ("4.10/6", "pass", session(listed("1|a.rob", "0|b.rob"))),
    ("4.10/6", "fail 4.10/11", session(upload("ab.rob"), "+9", listed("1|a", "0|b.rob"))),
    ("4.10/6", "fail", session(run("ab.rob", "1", "11"), listed("1|a", "0|b.rob"))),
    ("4.10/6", "pass", session(run("ab.rob", "0|20"), listed("1|a", "0|b.rob"))),
    ("4.10/7", "pass", session(listed("1|a.rob", "0|b.rob"))),
    ("4.10/7", "fail", session(listed("0|a.rob|a.rob"))),
    ("4.10/7", "fail", session(listed("1|a.rob", "0|b.rob|a.rob"))),
    ("4.10/7", "fail", session(listed("0|a.rob||b.rob"))),
    # Where two lists are requested at the same time, it is unknown which one a part belongs to.
    ("4.10/7", "none", session(AT_ONCE)),
    ("4.10/11", "pass", session(upload("a.rob"), listed("0|a.rob"))),
    ("4.10/11", "none", session(upload("a.rob"), AT_ONCE)),
    ("4.10/11", "fail", session(upload("a.rob"), listed("0|b.rob"))),
    ("4.10/11", "fail", session(upload("a.rob"), listed("0"))),
    ("4.10/11", "pass", session(upload("a.rob"), "+9", listed("1|b", "0|a.rob", fetched=True))),
    ("4.10/11", "none", session(upload("a.rob"), listed("1|b.rob"))),
    ("4.10/11", "fail", session(upload("n" * 30), listed("0|b.rob"))),
    ("4.10/11", "none", session(upload("n" * 31), listed("0|b.rob"))),
    # A file that is no valid program may be missing in the list (A-4.10-5).
    ("4.10/11", "none 6.1/1 6.6b/1", session(upload("a.rob", DAMAGED), listed("0|b.rob"))),
    ("4.10/11", "none", session(upload("a.txt", b"text"), listed("0|b.rob"))),
    ("4.10/11", "pass", session(upload("a.rob"), delete("a.rob"), listed("0|b.rob"))),
    ("4.10/11", "fail 4.11/3", session(delete("a.rob"), listed("0|a.rob"))),
    ("4.11/3", "pass", session(delete("a.rob"), listed("0|b.rob"))),
    ("4.11/3", "fail 4.10/11", session(delete("a.rob"), listed("0|a.rob"))),
    ("4.11/3", "none", session(delete("a.rob", "0"), listed("0|a.rob"))),
    ("4.11/3", "none", session(delete("a.rob"), "> upload_name a.rob", listed("0|a.rob"))),
    ("4.11/3", "pass", session(delete("a.rob"), "> download_name a.rob\n< download_name 0")),
    ("4.11/3", "fail", session(delete("a.rob"), "> download_name a.rob\n< download_name 1")),
    ("4.11/3", "pass", session(delete("a.rob"), run("a.rob", "0|20"))),
    ("4.11/3", "pass", session(delete("a.rob"), run("a.rob", "1", "00|20"))),
    ("4.11/3", "fail", session(delete("a.rob"), run("a.rob", "1", "11"))),
    ("4.11/3", "none", session(delete("a.rob"), run("a.rob", "1"))),
    # The list began again in place of its next part; the store had changed.
    ("4.10/4", "fail", session(listed("1|a|b"), listed("1|a|c"))),
    ("4.10/4", "fail", session(listed("1|a|b"), listed("1|a|c"), listed("1|a|c"))),
    ("4.10/4", "pass", session(listed("1|a|b"), listed("0|c|d"))),
    ("4.10/3", "fail", session(listed(r"0|a.rob\nb.rob"))),
    ("4.10/3", "fail", session(listed(r"0|a.rob\r\nb.rob"))),
    ("4.10/3", "fail 4.10/11", session(upload("a"), upload("b"), listed("0|a,b"))),
    ("4.10/3", "fail", session(listed("0|a.rob,b.rob,c.txt"))),
    ("4.10/3", "pass", session(listed("0|a,b"))),
    ("4.10/3", "pass", session(*map(upload, ("a", "b", "a,b")), listed("0|a|b|a,b"))),
    ("4.10/3", "pass", session(listed("0|my program.rob"))),
    ("4.15/7", "pass", session(listed("0|a.rob"), run("b.rob", "0|20"))),
    ("4.15/7", "pass", session(listed("0|a.rob"), run("b.rob", "1", "00|20"))),
    ("4.15/7", "fail", session(listed("0|a.rob"), run("b.rob", "1", "11"))),
    ("4.15/7", "none", session(listed("0|a.rob"), run("a.txt", "1", "11"))),  # A-0-9
    ("4.15/7", "none", session(listed("0|a.rob"), upload("b.rob"), run("b.rob", "1", "11"))),
    ("4.15/7", "none", session(listed("0|a.rob"), "+61", run("b.rob", "1", "11"))),
    ("4.15/7", "none", session(listed("0|a.rob"), "> gap 9", run("b.rob", "1", "11"))),
    (
        "8/5",
        "fail",
        session(listed("0|a.rob"), run("b.rob", "1", "11").replace("run_", "simulate_")),
    ),
    ("4.11/3", "fail", session(delete("a"), delete("a", "0"), run("a", "1", "11"))),
    ("4.11/2", "pass", session(listed("0|a|b"), delete("a", "0"), listed("0|a|b"))),
    ("4.11/2", "fail", session(listed("0|a|b"), delete("a", "0"), listed("0|b"))),
    ("4.11/2", "pass", session(listed("0|a|b"), delete("a", "0"), "+61", listed("0|b"))),
    ("4.11/2", "pass", session(listed("0|a"), delete("a", "0"), delete("a"), listed("0"))),
    ("4.11/2", "pass", session(listed("0|a|b"), "> gap 9", delete("a", "0"), listed("0|b"))),
    # The file of the upload that was broken off need not exist.
    (
        "4.11/2",
        "pass",
        session(
            listed("0|a|b"),
            delete("a"),
            "> upload_name a\n< upload_name 1",
            delete("a", "0"),
            listed("0|b"),
        ),
    ),
    # The status was 00: a missing program is refused with 20, but a damaged one need not be listed.
    ("4.15/7", "inconclusive", session(listed("0|a"), IDLE, run("b", "0|05"))),
    ("4.15/7", "inconclusive", session(listed("0|a"), IDLE, run("b", "1", "00|05"))),
    ("4.15/7", "pass", session(listed("0|a"), run("b", "0|05"))),
    ("4.15/7", "pass", session(listed("0|a"), IDLE, "+2", run("b", "0|05"))),
    (
        "4.15/7",
        "none 6.1/1 6.6b/1",
        session(upload("b", DAMAGED), listed("0|a"), IDLE, run("b", "0|05")),
    ),
    ("4.12/3", "pass", session(listed("0|a.rob"), default("a.rob"))),
    ("4.12/3", "inconclusive", session(listed("0|a.rob"), default("NULL"))),
    ("4.12/3", "pass", session(listed("0|a.rob"), upload("b.rob"), default("b.rob"))),
    ("4.12/3", "pass", session(listed("0|a.rob"), delete("b.rob", "0"), default("b.rob"))),
    ("4.12/3", "pass", session(listed("0|a.rob"), "+61", default("b.rob"))),
    ("4.11/4", "pass", session(delete("a"), delete("a", "0"))),
    ("4.11/4", "fail", session(delete("a"), delete("a"))),
    ("4.11/4", "fail", session(upload("a"), delete("a"), "+9", delete("a"))),
    ("4.11/4", "none", session(delete("a"), upload("a"), delete("a"))),
    ("4.11/4", "none", session(delete("a"), delete("b"))),
    ("4.11/4", "none", session(delete("a", "0"), delete("a"))),
    ("4.11/4", "none", session(delete("a"), "> gap 9", delete("a"))),
    # A client that is not recorded may have uploaded it.
    ("4.11/4", "none", session(delete("a"), "+61", delete("a"))),
    ("4.11/5", "pass", session(RUNNING, delete("a.rob", "0"))),
    ("4.11/5", "tolerated delete_guard=allow", session(RUNNING, delete("a.rob"))),
    ("4.11/5", "none", session(RUNNING, delete("b.rob"))),
    ("8/5", "pass", session(run("a.rob", "0|20"))),
    ("8/5", "pass", session(run("a.rob", "1", "00|20"))),
    ("8/5", "fail", session(upload("a.rob"), run("a.rob", "0|20"))),
    ("8/5", "tolerated A-4.15-2=20", session(listed("0|a.rob"), run("a.rob", "0|20"))),
    ("8/5", "fail", session("> reset\n< reset 0|20")),
    ("8/5", "fail", session("> jog 1\n< jog 1\n<90 jog 00|20")),
    ("8/5", "none", session(run("a.rob", "0|12"))),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_program_store(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)


def test_a_damaged_program_may_be_taken_for_missing(judged: Callable) -> None:
    """The file exists, but no code means that it is damaged (A-4.15-2)."""
    record = judged(session(upload("a.rob", DAMAGED), run("a.rob", "0|20")))
    (finding,) = [f for f in record.findings if f.requirement == "8/5"]
    assert finding.reading == ("A-4.15-2", "20")


@pytest.mark.parametrize(
    ("uploaded", "between", "listing", "message"),
    [
        (
            r"\xe7\xa8\x8b.rob",
            "",
            r"0|\xb3\xcc.rob",
            "程.rob was uploaded in UTF-8 but is listed in GBK",
        ),
        (
            r"\xb3\xcc.rob",
            "",
            r"0|\xe7\xa8\x8b.rob",
            "程.rob was uploaded in GBK but is listed in UTF-8",
        ),
        ("a.rob", "", "0|A.ROB", "A.ROB was listed: the names differ only in case"),
        ("a.rob", delete("A.ROB"), "0", "A.ROB was deleted: the names differ only in case"),
        ("a.rob", "", "0|b.rob", "a.rob was uploaded but is not listed"),
    ],
)
def test_a_missing_program_and_a_similar_name(
    uploaded: str, between: str, listing: str, message: str, judged: Any
) -> None:
    """The finding names the encodings, or the letters in another case."""
    record = judged(session(upload(uploaded), between, listed(listing)))
    (found,) = [f for f in record.findings if f.requirement == "4.10/11"]
    assert (found.verdict, found.message.endswith(message)) == (Verdict.FAIL, True), found.message
