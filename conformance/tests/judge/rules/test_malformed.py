"""Malformed requests that a controller accepts, and malformed chunks that a receiver accepts."""

from collections.abc import Callable

import pytest

from scaraspec.protocol.program_files import Node, NodeType, Program, WaitSeconds, build
from scaraspec.protocol.transfer import FILE_DATA, chunks_of

PROGRAM = build(Program(nodes=(Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(1)),)))
RUN = "> run_program a\n< run_program {first}\n{result}"
DONE = "<90 run_program 11"


def asked(request: str, reply: str) -> str:
    """A request and its first reply."""
    return f"login\n> {request}\n< {request.partition(' ')[0]} {reply}"


def chunked(chunk: str, reply: str = "1", name: str = "1") -> str:
    """An upload with this chunk."""
    return f"login\n> upload_name a\n< upload_name {name}\n> {chunk}\n< upload_chunk {reply}"


def fetched(chunk: str, reply: str) -> str:
    """A download with this chunk."""
    return f"login\n> download_name a\n< download_name 1\n< {chunk}\n> download_chunk {reply}"


def run(content: bytes, first: str, result: str = "") -> str:
    """A file that is uploaded and run."""
    lines = ["login\n> upload_name a\n< upload_name 1"]
    for chunk in chunks_of(content):
        data = "".join(f"\\x{octet:02x}" for octet in FILE_DATA.encode(chunk))
        lines.append(f"> upload_chunk {data}\n< upload_chunk 1")
    return "\n".join([*lines, RUN.format(first=first, result=result)])


GRIPPER, POSITION, MOVE = "set_gripper_center", "set_initial_tool_position", "set_tool_coordinates"

CASES = (
    *(
        (requirement, expected.format(also=also, text="T/5"), asked(request, reply))
        for requirement, also, expected, request, reply in (
            ("4.20/4", "4.20/1", "pass {also}", f"{GRIPPER} 1|2", "0"),
            ("4.20/4", "4.20/1", "fail {also}", f"{GRIPPER} 1|2", "1"),
            ("4.20/4", "4.20/1", "fail {also}", f"{GRIPPER} 1|2|3|4", "1"),
            ("4.20/4", "4.20/1", "fail {also} {text}", f"{GRIPPER} 1|2|x", "1"),
            ("4.20/4", "4.20/1", "none {also} {text}", f"{GRIPPER} +1|2|3", "1"),
            ("4.20/4", "", "none", f"{GRIPPER} 1|2|3", "1"),
            ("4.21/4", "4.21/1", "pass {also}", f"{POSITION} 1|2|3|4|5", "0"),
            ("4.21/4", "4.21/1", "fail {also}", f"{POSITION} 1|2|3|4|5", "1"),
            ("4.24/10", "4.24/1", "pass {also}", f"{MOVE} 1|2|3|4|5|6", "0|05"),
            ("4.24/10", "4.24/1", "fail {also}", f"{MOVE} 1|2|3|4|5|6", "1"),
            ("4.4/5", "4.4/1", "pass {also}", "set_network 999.1.1.1|255.0.0.0|10.0.0.1", "0"),
            ("4.4/5", "4.4/1", "fail {also}", "set_network 999.1.1.1|255.0.0.0|10.0.0.1", "1"),
            ("4.5/5", "4.5/2", "pass {also}", "set_time 20260230101010", "0"),
            ("4.5/5", "4.5/2", "fail {also}", "set_time 20260230101010", "1"),
            ("4.5/5", "4.5/1", "fail {also}", "set_time 2026", "1"),
            ("4.5/5", "4.5/2", "none {also}", "set_time 20261231235960", "1"),
            ("4.28/7", "4.28/2", "pass {also}", "jog 5", "0|05"),
            ("4.28/7", "4.28/2", "fail {also}", "jog 5", "1"),
            ("4.32/5", "", "pass", "set_digital_output 0|1", "0"),
            ("4.32/5", "", "fail", "set_digital_output 0|1", "1"),
            ("4.32/5", "", "fail", "set_digital_output 41|1", "1"),
            ("4.32/5", "", "none", "set_digital_output 17|1", "1"),
        )
    ),
    ("5.2/10", "pass 5.1/6", chunked("chunk 0/100 len=150", "0")),
    ("5.2/10", "fail 5.1/6", chunked("chunk 0/100 len=150")),
    ("5.2/10", "fail 5.1/5 5.4/3", chunked("chunk 0/300 len=201")),
    ("5.2/10", "none", chunked("chunk 0/300")),
    ("5.3/13", "pass 5.1/6", fetched("chunk 0/100 len=150", "0")),
    ("5.3/13", "fail 5.1/6", fetched("chunk 0/100 len=150", "1")),
    ("5.3/13", "none", fetched("chunk 0/300", "1")),
    ("5.2/11", "pass 5.2/4", chunked("chunk 0/300", reply="0", name="0")),
    ("5.2/11", "fail 5.2/4", chunked("chunk 0/300", name="0")),
    ("5.2/11", "fail 5.1/11", "login\n> chunk 0/300\n< upload_chunk 1"),
    ("5.2/11", "none", "< gap 9\nlogin\n> chunk 0/300\n< upload_chunk 1"),
    ("6.5/28", "none", run(PROGRAM, "1", DONE)),
    ("6.5/28", "pass 6.1/1 6.6b/1", run(PROGRAM[:-1] + b"X", "0|06")),
    ("6.5/28", "fail 6.1/1 6.6b/1", run(PROGRAM[:-1] + b"X", "1", DONE)),
    ("6.5/28", "fail", run(b"nothing", "1", DONE)),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_malformed(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """The verdict is the register's, and nothing else fails for it."""
    check_case(requirement, expected, session)
