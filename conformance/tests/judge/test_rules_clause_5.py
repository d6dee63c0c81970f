"""Clause 5: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.readings import Dialect

UPLOAD = """
    login
    > upload_name a.bin
    < upload_name 1
    > chunk 0/300
    < upload_chunk 1
    > chunk 200/300
    < upload_chunk 1
"""
DOWNLOAD = """
    login
    > download_name a.bin
    < download_name 1
    < chunk 0/300
    > download_chunk 1
    < chunk 200/300
    > download_chunk 1
"""
AGAIN = """
    > upload_name a.bin
    < upload_name {}
"""
DELETE = """
    > delete_program a.bin
    < delete_program {}
"""
FETCH = DOWNLOAD.replace("login", "")
LONG_NAME = "n" * 31


def up(*chunks: str) -> str:
    """An upload of these chunks, each acknowledged."""
    answers = "".join(f"> {chunk}\n< upload_chunk 1\n" for chunk in chunks)
    return f"login\n> upload_name a.bin\n< upload_name 1\n{answers}"


def down(*chunks: str) -> str:
    """A download of these chunks, each acknowledged."""
    answers = "".join(f"< {chunk}\n> download_chunk 1\n" for chunk in chunks)
    return f"login\n> download_name a.bin\n< download_name 1\n{answers}"


UNLISTED = """
    login
    > list_programs
    < list_programs 0|a|c
    {between}
    > download_name {name}
    < download_name 1
    +{pause}
    > get_time
    < get_time 20260101000000
"""
REFUSED_FETCH = "\n> download_name a.bin\n< download_name 0"
UNLISTED_CONTENT = "< chunk 0/20\n> download_chunk 1\n"
_POLL = "> get_status\n< get_status 00\n"

CASES = (
    ("5.1/1", "pass", UPLOAD),
    ("5.1/1", "fail 5.2/5", up("upload_chunk 123")),
    ("5.1/1", "fail 5.3/4", down("download_chunk 123")),
    ("5.1/1", "fail 5.2/5", up("52 " + r"\x05\x00\x00\x00\x00\x00\x00\x00\x05\x00\x00\x00hello.")),
    ("5.1/2", "pass", UPLOAD),
    ("5.1/2", "tolerated chunk_trunc=truncated", up("chunk 0/300", "chunk 200/300 cut")),
    ("5.1/3", "pass", UPLOAD),
    ("5.1/3", "fail", up("chunk 0/300", "chunk 200/301")),
    ("5.1/4", "pass", UPLOAD),
    ("5.1/4", "fail 5.1/8", up("chunk 0/500", "chunk 1/500 len=200", "chunk 2/500 len=100")),
    ("5.1/4", "fail 5.1/8", up("chunk 1/300 len=200")),
    ("5.1/4", "fail 5.1/8", down("chunk 200/300 len=100")),
    ("5.1/5", "pass", UPLOAD),
    ("5.1/5", "fail 5.2/10 5.4/3", up("chunk 0/300 len=201")),
    ("5.1/6", "pass", UPLOAD),
    ("5.1/6", "fail 5.2/10", up("chunk 0/300", "chunk 200/300 len=101")),
    ("5.1/7", "pass", UPLOAD),
    ("5.1/7", "none 5.1/8", up("chunk 0/700", "chunk 400/700", "chunk 600/700")),
    ("5.1/8", "pass", DOWNLOAD),
    ("5.1/8", "fail", up("chunk 0/700", "chunk 400/700", "chunk 600/700")),
    ("5.1/8", "fail", up("chunk 0/700", "chunk 0/700", "chunk 200/700")),
    ("5.1/8", "fail", down("chunk 0/700", "chunk 100/700")),
    # The controller was silent: it is the cause, and not the client that tries again or gives up.
    (
        "5.1/8",
        "pass 3/31",
        up("chunk 0/700") + "> chunk 200/700\n+31\n> chunk 200/700\n< upload_chunk 1\n> close",
    ),
    ("3/25", "pass", up("chunk 0/700") + "> chunk 200/700\n+6\n> = AA 52 00 CC"),
    # Bytes that a gap removed are no fault of the sender.
    ("5.1/8", "pass", up("chunk 0/700") + "> gap 216\n> chunk 400/700\n< upload_chunk 1"),
    ("5.1/9", "pass", UPLOAD),
    ("5.1/9", "tolerated endian=big", up("chunk 0/300 big", "chunk 200/300 big")),
    ("5.1/9", "fail", up("chunk 0/300", "chunk 200/300 big")),
    (
        "5.1/9",
        "fail",
        UPLOAD + "> upload_name b.bin\n< upload_name 1\n> chunk 0/300 big\n< upload_chunk 1",
    ),
    ("5.1/10", "pass", UPLOAD + AGAIN.format(0)),
    ("5.1/10", "fail 5.2/3 5.4/2", UPLOAD + AGAIN.format(1)),
    ("5.1/10", "pass", UPLOAD + AGAIN.format(0) + DELETE.format(1) + AGAIN.format(1)),
    # It is unknown whether a refused deletion kept the file.
    ("5.1/10", "none", UPLOAD + DELETE.format(0) + AGAIN.format(1)),
    ("5.1/10", "none", UPLOAD + "> gap 12\n" + AGAIN.format(1)),
    ("5.1/11", "pass", UPLOAD),
    # The reply to the name may come after the first chunk.
    (
        "5.1/11",
        "pass",
        "login\n> upload_name a\n> chunk 0/9\n< upload_name 1\n< upload_chunk 1",
    ),
    ("5.1/11", "fail", "login\n> chunk 0/300\n< upload_chunk 0"),
    ("5.1/11", "fail", "login\n< chunk 0/300\n> download_chunk 0"),
    ("5.1/11", "inconclusive", "> gap\n> chunk 0/300\n< upload_chunk 1"),
    ("5.2/1", "pass", UPLOAD),
    ("5.2/1", "fail", "login\n> upload_name\n< upload_name 0"),
    ("5.2/2", "pass", UPLOAD),
    ("5.2/2", "fail", "login\n> upload_name a\n< upload_name 1|2"),
    ("5.2/3", "pass", UPLOAD + AGAIN.format(0)),
    ("5.2/3", "fail 5.1/10 5.4/2", UPLOAD + AGAIN.format(1)),
    ("5.2/4", "pass", UPLOAD),
    ("5.2/4", "fail", "login" + AGAIN.format(0) + "> chunk 0/300\n< upload_chunk 0"),
    ("5.2/4", "none", "login" + AGAIN.format(0) + "> gap 20\n> chunk 0/300\n< upload_chunk 1"),
    ("5.2/5", "pass", UPLOAD),
    ("5.2/5", "fail 5.1/1", up("upload_chunk 123")),
    ("5.2/6", "pass", UPLOAD),
    ("5.2/6", "fail", up("chunk 0/300").replace("_chunk 1", "_chunk OK")),
    ("5.2/7", "pass", UPLOAD),
    (
        "5.2/7",
        "fail",
        "login" + AGAIN.format(1) + "> chunk 0/300\n> chunk 200/300\n"
        "< upload_chunk 1\n< upload_chunk 1",
    ),
    (
        "5.2/7",
        "fail",
        "login" + AGAIN.format(1) + "> chunk 0/300\n+20\n> chunk 200/300\n< upload_chunk 1",
    ),
    ("5.2/7", "pass", up("chunk 0/300") + "> chunk 200/300 len=0" + UPLOAD.replace("login", "")),
    ("5.2/7", "pass", up("chunk 0/300") + "> chunk 200/300\n> upload_chunk"),
    ("5.2/7", "pass", up("chunk 0/300") + "> upload_chunk" + UPLOAD.replace("login", "")),
    # After a silence the reply belongs to the new upload, although replies to queries came before
    # it.
    (
        "5.2/7",
        "pass",
        up("chunk 0/300")
        + f"> chunk 200/300\n+28\n{_POLL}+3\n"
        + AGAIN.format(1)
        + f"> chunk 0/300\n"
        f"{_POLL}< upload_chunk 1\n> chunk 200/300\n{_POLL}< upload_chunk 1",
    ),
    ("5.2/8", "pass", UPLOAD),
    (
        "5.2/8",
        "tolerated A-5-14=goes on",
        up("chunk 0/300") + "> chunk 200/300\n< upload_chunk 0\n> chunk 200/300\n< upload_chunk 1",
    ),
    (
        "5.2/8",
        "tolerated A-5-14=goes on",
        "login" + AGAIN.format(1) + "> chunk 0/700\n< upload_chunk 0\n> chunk 200/700",
    ),
    ("5.2/12", "pass", UPLOAD + FETCH),
    ("5.2/12", "fail", UPLOAD + FETCH.replace("200/300", "200/300 other")),
    ("5.2/12", "fail 5.1/3", UPLOAD + down("chunk 0/200").removeprefix("login")),
    ("5.1/3", "fail 5.2/12", UPLOAD + down("chunk 0/200").removeprefix("login")),
    ("5.1/3", "fail", UPLOAD + down("chunk 0/400").removeprefix("login")),
    ("5.1/3", "pass 4.11/3", UPLOAD + DELETE.format(1) + down("chunk 0/400").removeprefix("login")),
    ("5.1/3", "pass", UPLOAD + "< gap 9" + down("chunk 0/400").removeprefix("login")),
    ("5.3/3", "fail", UNLISTED.format(name="b", between="", pause=6)),
    ("5.3/3", "fail", UNLISTED.format(name="b", between="", pause=61)),
    ("5.3/3", "fail", UNLISTED.format(name="b", between=AGAIN.format(1), pause=6)),
    ("5.3/3", "none", UNLISTED.format(name="a", between="", pause=6)),
    ("5.3/3", "none", UNLISTED.format(name="b", between="", pause=0)),
    (
        "5.3/3",
        "none",
        UNLISTED.format(name="b", between=AGAIN.format(1).replace("a.bin", "b"), pause=6),
    ),
    ("5.3/3", "none", UNLISTED.format(name="b", between="< gap 9", pause=6)),
    ("5.3/3", "pass", UNLISTED.format(name="b", between="", pause=6).replace("name 1", "name 0")),
    # Another file than a program need not be listed.
    ("5.3/3", "none", UNLISTED.format(name="a.bin", between="", pause=0) + UNLISTED_CONTENT),
    ("5.2/12", "none", UPLOAD + "> gap 30\n" + FETCH.replace("200/300", "200/300 other")),
    (
        "5.2/12",
        "none 4.11/3",
        UPLOAD + DELETE.format(1) + FETCH.replace("200/300", "200/300 other"),
    ),
    ("5.2/13", "pass", UPLOAD),
    ("5.2/13", "fail", UPLOAD + "> chunk 300/300\n< upload_chunk 1"),
    ("5.2/13", "fail", DOWNLOAD + "< chunk 200/300\n> download_chunk 1"),
    ("5.2/13", "fail", UPLOAD + "< upload_chunk 1"),
    # A 0 in place of a chunk, where a reply was awaited, and where it was not.
    ("5.2/13", "fail 5.1/1 5.3/4", DOWNLOAD + "< download_chunk 0"),
    ("5.2/13", "pass", down("chunk 0/300") + "< chunk 200/300\n+28\n> download_chunk 1\n< 56 0"),
    ("5.2/17", "pass", UPLOAD),
    (
        "5.2/17",
        "tolerated empty_file=chunk",
        "login" + AGAIN.format(1) + "> chunk 0/0\n< upload_chunk 1",
    ),
    ("5.2/17", "none", "login" + AGAIN.format(1) + "> chunk 0/300 len=0\n+40\n> close"),
    ("5.2/18", "pass", UPLOAD),
    ("5.2/18", "tolerated name_max=255", f"login\n> upload_name {LONG_NAME}\n< upload_name 1"),
    ("5.3/1", "pass", DOWNLOAD),
    ("5.3/1", "fail", "login\n> download_name\n< download_name 0"),
    ("5.3/2", "pass", DOWNLOAD),
    ("5.3/2", "fail", "login\n> download_name a\n< download_name"),
    ("5.3/4", "pass", DOWNLOAD),
    ("5.3/4", "fail 5.1/1", down("download_chunk 123")),
    (
        "5.3/4",
        "fail",
        "login\n> download_name a\n< chunk 0/200\n< download_name 1\n> download_chunk 1",
    ),
    (
        "5.3/4",
        "fail",
        UPLOAD + "> download_name a.bin\n< download_name 1\n+61\n> get_status\n< get_status 00",
    ),
    # If the file is empty, no chunk follows (A-5-10).
    ("5.3/4", "inconclusive", "login\n> download_name a\n< download_name 1\n+61\n> close"),
    ("5.2/12", "fail", UPLOAD + REFUSED_FETCH),
    ("5.2/12", "none", UPLOAD + DELETE.format(1) + REFUSED_FETCH),
    ("5.2/12", "none", UPLOAD + "+61" + REFUSED_FETCH),
    # An empty file need not be stored (A-5-10).
    ("5.2/12", "none", up("chunk 0/0 len=0") + REFUSED_FETCH),
    ("5.2/12", "none", UPLOAD + "> run_program b\n< run_program 1" + REFUSED_FETCH),
    ("5.3/8", "pass", down("chunk 0/300", "chunk 200/300 len=0").replace("_chunk 1", "_chunk 0")),
    ("5.3/8", "fail", down("chunk 0/300", "chunk 200/300 len=0")),
    ("5.3/8", "fail", down("download_chunk ")),
    ("5.3/8", "none", down("chunk 0/0 len=0")),  # an empty file (A-5-10)
    ("5.3/8", "none", "login\n> download_name a\n< download_name 1\n< chunk 0/300 len=0"),
    ("5.3/5", "pass", DOWNLOAD),
    ("5.3/5", "fail", DOWNLOAD + "> download_chunk 1"),
    ("5.3/5", "fail", DOWNLOAD + "> download_chunk 1\n< download_chunk 0"),  # A-5-16
    ("5.3/5", "fail", DOWNLOAD.replace("_chunk 1", "_chunk yes")),
    # The second of two replies to one chunk may be taken for the reply to the next chunk: no
    # failure of 5.3/6.
    (
        "5.3/5",
        "fail",
        down("chunk 0/600")
        + "> download_chunk 1\n< chunk 200/600\n< chunk 400/600\n"
        + "> download_chunk 1\n> download_chunk 1",
    ),
    ("5.3/5", "inconclusive", DOWNLOAD + "< gap 216\n> download_chunk 1"),
    ("5.3/6", "pass", DOWNLOAD),
    ("5.3/6", "pass", down() + "< chunk 0/300" + FETCH),
    (
        "5.3/6",
        "fail",
        down() + "< chunk 0/300\n< chunk 200/300\n> download_chunk 1\n> download_chunk 1",
    ),
    ("5.3/10", "pass", DOWNLOAD),
    (
        "5.3/10",
        "fail",
        "login\n> download_name a\n< download_name 0\n< chunk 0/9\n> download_chunk 0",
    ),
    (
        "5.3/10",
        "fail 5.1/1 5.3/4",
        "login\n> download_name a\n< download_name 0\n< download_chunk 0",
    ),
    ("5.4/1", "pass", UPLOAD),
    ("5.4/1", "none", "login" + AGAIN.format(0)),
    ("5.4/2", "pass", UPLOAD + AGAIN.format(0)),
    ("5.4/2", "fail 5.1/10 5.2/3", UPLOAD + AGAIN.format(1)),
    ("5.4/3", "pass", UPLOAD),
    ("5.4/3", "fail 5.1/5 5.2/10", up("chunk 0/300 len=201")),
)

PASSES_ONLY = {
    "5.1/7": "who goes on behind the end breaks 5.2/13",
    "5.4/1": "a file may be refused for many reasons",
}


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_clause_5(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)


def test_a_client_that_gives_up_sooner_than_a_reply_is_due(judged: Callable[..., Any]) -> None:
    """With a transfer timeout of 1 s, a chunk of the next upload is not a second outstanding
    one."""
    session = (
        up("chunk 0/300")
        + f"> chunk 200/300\n+1.1\n{AGAIN.format(1)}> chunk 0/300\n< upload_chunk 1\n"
        + "> chunk 200/300\n< upload_chunk 1"
    )
    assert judged(session, Dialect.of(xfer_timeout="1")).failed == set()
    assert "5.2/7" in judged(session).failed
