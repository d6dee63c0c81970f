"""Two-stage commands: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

_REQUESTS = {
    "run_program": "run_program a.rob",
    "simulate_program": "simulate_program a.rob",
    "emergency_stop": "emergency_stop",
    "reset": "reset",
    "set_tool_coordinates": "set_tool_coordinates 60|1|2|3|4|0|0",
    "release_joints": "release_joints",
    "lock_joints": "lock_joints",
    "jog": "jog 1",
    "shutdown": "shutdown",
}
_OUTCOMES = {
    # command: requirement about its success, requirement about its failure
    "run_program": ("4.15/5", "4.15/6"),
    "simulate_program": ("4.16/3", "4.16/4"),
    "emergency_stop": ("4.17/4", "4.17/5"),
    "reset": ("4.18/4", "4.18/5"),
    "set_tool_coordinates": ("4.24/6", "4.24/7"),
    "release_joints": ("4.25/3", "4.25/4"),
    "lock_joints": ("4.26/3", "4.26/4"),
    "jog": ("4.28/5", "4.28/6"),
}
_REFUSALS = {"4.15/3": "run_program", "4.24/3": "set_tool_coordinates", "4.35/3": "shutdown"}
_ACCEPTANCES = {
    "4.15/4": "run_program",
    "4.18/3": "reset",
    "4.24/5": "set_tool_coordinates",
    "4.35/2": "shutdown",
}


def refused(name: str, reply: str) -> str:
    """A command and its first reply."""
    return f"login\n> {_REQUESTS[name]}\n< {name} {reply}"


def ended(name: str, result: str) -> str:
    """A command that is accepted, and its final result."""
    return f"{refused(name, '1')}\n<90 {name} {result}"


def cases() -> list[tuple[str, str, str]]:
    """The tables above, converted to cases."""
    found = []
    for name, (success, failure) in _OUTCOMES.items():
        found += [
            (success, "pass", ended(name, "11")),
            (success, "fail 4/2", ended(name, "1")),
            (success, "none", ended(name, "00|12")),
            (failure, "pass", ended(name, "00|12")),
            (failure, "fail 4/3 T/1", ended(name, "00")),
            (failure, "none", ended(name, "11")),
        ]
    for requirement, name in _REFUSALS.items():
        found.append((requirement, "pass", refused(name, "0|12")))
        found.append((requirement, "none", refused(name, "1")))
    for requirement, name in _ACCEPTANCES.items():
        found.append((requirement, "pass", refused(name, "1")))
        found.append((requirement, "none", refused(name, "0|12")))
    return found


TRAILING_NUL = r"""
    login
    > run_program a.rob
    < run_program 1\x00
    <90 run_program 11\x00
"""
SLOW = """
    login
    > {query}
    < {answer}
    > run_program a.rob
    +3
    < run_program 1
    <90 run_program 11
"""

SLOW_AGAIN = """
    > run_program a.rob
    +3
    < run_program 1
    <90 run_program 11
"""

_LOST = """
login
> run_program a.rob
< run_program 1
< rst
+2
2> login password
2< login 1
2> run_program a.rob
2< run_program 1
2<90 run_program 11
"""

NO_RESULT = """
    login
    > {name} {data}
    < {name} 1
    {result}
    > get_status
    < get_status 00
    +6
    > get_status
    < get_status 00
    > close
"""
_SILENT = """
    login
    > {name} {data}
    < {name} 1
    +2
    2> login password
    2< login 1
    {then}
    2> {name} {data}
"""
_STILL_THERE = "> get_status\n< get_status 04"
_TARGET = "9|1|2|3|4|0|0"

CASES = (
    *cases(),
    ("4/1", "pass", refused("run_program", "1")),
    ("4/1", "pass", refused("reset", "0|04")),
    ("4/1", "pass", TRAILING_NUL),
    ("4/1", "fail 4.26/2", refused("lock_joints", "yes")),
    ("4/1", "fail 4.15/4", refused("run_program", "1|go")),
    ("4/1", "fail 4.25/2", refused("release_joints", "0")),
    ("4/1", "tolerated err_bare0=0", refused("set_tool_coordinates", "0")),
    ("4/1", "pass", refused("emergency_stop", "0")),
    ("4.15/3", "fail 4/1", refused("run_program", "0")),
    ("4.15/3", "fail T/7 8/2", refused("run_program", "0|99")),
    ("4.24/3", "fail T/7 8/2", refused("set_tool_coordinates", "0|99")),
    ("4.24/3", "tolerated err_bare0=0", refused("set_tool_coordinates", "0")),
    ("4.35/3", "fail", refused("shutdown", "0")),
    ("4.15/4", "fail 4/1", refused("run_program", "1|11")),
    ("4.18/3", "fail 4/1", refused("reset", "11")),
    ("4.24/5", "fail 4/1", refused("set_tool_coordinates", "1|")),
    ("4.35/2", "fail", refused("shutdown", "1|")),
    ("4.15/2", "pass", refused("run_program", "0|20")),
    ("4.15/2", "tolerated A-4.15-1=00|20", ended("run_program", "00|20")),
    ("4/2", "pass", ended("jog", "11")),
    ("4/2", "pass", TRAILING_NUL),
    ("4/2", "fail 4.18/4", ended("reset", "1|11")),
    ("4/3", "pass", ended("reset", "00|11")),
    ("4/3", "fail 4.18/5 T/7 8/2", ended("reset", "00|99")),
    ("4/3", "fail 4.18/5 T/1", ended("reset", "00")),
    ("4/4", "pass", refused("reset", "0|05")),
    ("4/4", "tolerated A-0-7=00", refused("reset", "0|00")),
    ("4/5", "pass", ended("reset", "00|12")),
    ("4/5", "pass", ended("run_program", "00|20")),
    ("4/5", "tolerated A-8-5=03", ended("reset", "00|03")),
    # The final result of a stopped command names no motor (A-4.17-4).
    (
        "4/5",
        "pass",
        """
        login
        > reset
        < reset 1
        > emergency_stop
        < emergency_stop 1
        <90 reset 00|00
        <90 emergency_stop 11
        """,
    ),
    ("4/14", "pass", ended("run_program", "11")),
    ("4/14", "fail", SLOW.format(query="get_status", answer="get_status 00") + SLOW_AGAIN),
    # If it happens only once, a packet may have been lost.
    ("4/14", "inconclusive", SLOW.format(query="get_status", answer="get_status 00")),
    (
        "4/14",
        "inconclusive",
        SLOW.format(query="get_status", answer="get_status 00")
        + "> run_program a.rob\n< run_program 1\n+3\n<90 run_program 11"
        + SLOW_AGAIN,
    ),
    # A command that lasts longer may also start later.
    (
        "4/14",
        "pass",
        SLOW.format(query="get_status", answer="get_status 00").replace("<90", "+2\n<90")
        + SLOW_AGAIN * 2,
    ),
    # A program without nodes, over a slow link.
    ("4/14", "none", SLOW.format(query="get_status\n+2", answer="get_status 00")),
    # Joints are locked at once: if the reply is late, the final result comes with it.
    (
        "4/14",
        "none",
        SLOW.format(query="get_status", answer="get_status 00")
        .replace("run_program a.rob", "lock_joints")
        .replace("run_program", "lock_joints"),
    ),
    # A busy robot may have ignored the first request (A-4-2).
    (
        "4/14",
        "none",
        SLOW.format(query="get_status", answer="get_status 00").replace(
            "+3", "+3\n    > run_program a.rob"
        ),
    ),
    ("4/16", "pass", ended("jog", "11")),
    (
        "4/16",
        "tolerated A-4-2=asked again",
        "login\n> reset\n< reset 1\n> reset\n< reset 0|03\n<90 reset 11",
    ),
    # The link was lost before the final result: the client or its user may have repeated the
    # request.
    ("4/16", "inconclusive", _LOST),
    ("4/16", "inconclusive", _LOST.replace("< run_program 1\n< rst", "< close")),
    ("4/16", "inconclusive", _LOST.replace("< rst", "+9\n> close")),
    ("4/16", "pass", _LOST.replace("2> run_program a.rob", "2> run_program b.rob")),
    ("4/16", "pass", _LOST.replace("+2", "+100")),
    ("4/16", "pass", _LOST.replace("< rst", "<90 run_program 11\n< rst")),
    ("4/16", "pass", _LOST.replace("< rst", "< gap\n< rst")),
    *(
        (requirement, f"fail {others}", NO_RESULT.format(name=name, data=data, result=result))
        for requirement, name, data, form in (
            ("4.15/5", "run_program", "a", ""),
            ("4.16/3", "simulate_program", "a", "4.16/2"),
            ("4.18/4", "reset", "", ""),
            ("4.24/6", "set_tool_coordinates", "9|1|2|3|4|0|0", ""),
            ("4.28/5", "jog", "1", "4.28/4"),
        )
        for others, result in (("3/18", "+2"), (f"3/12 {form}", f"+2\n< {name} 11"))
    ),
    *(
        (requirement, f"fail 3/12 {form}", f"login\n> {name}\n< {name} 1\n< {name} 11")
        for requirement, name, form in (
            ("4.17/4", "emergency_stop", ""),
            ("4.25/3", "release_joints", "4.25/2"),
            ("4.26/3", "lock_joints", "4.26/2"),
        )
    ),
    *(
        (requirement, "fail 3/18", NO_RESULT.format(name=name, data="", result="+2"))
        for requirement, name in (("4.17/4", "emergency_stop"), ("4.26/3", "lock_joints"))
    ),
    # The first connection is silent, but its end is not in the capture.
    ("4/16", "inconclusive", _SILENT.format(name="run_program", data="a.rob", then="")),
    ("4/16", "inconclusive", _SILENT.format(name="set_tool_coordinates", data=_TARGET, then="")),
    ("4/16", "tolerated A-4-2=asked again", _SILENT.format(name="jog", data=1, then=_STILL_THERE)),
    ("4.28/2", "pass", "login\n> jog 4"),
    ("4.28/2", "fail", "login\n> jog 5"),
    ("4.28/2", "fail", r"login" + "\n" + r"> jog \x00"),
    ("4.28/2", "tolerated jog_byte=binary", "login\n> jog \\x04"),
    # The controller closes without a reply: it shut down, or the link failed.
    ("4.35/2", "inconclusive", "login\n> shutdown\n< close"),
    ("4.35/2", "inconclusive", "login\n> shutdown\n+1\n< rst"),
    ("4.35/2", "none", "login\n> shutdown\n> close"),
    ("4.35/2", "pass", "login\n> shutdown\n< shutdown 1\n< close"),
    ("4.35/5", "pass", "login\n> shutdown\n< shutdown 1\n< close"),
    ("4.35/5", "fail", "login\n> shutdown\n< shutdown 1\n<90 60 11\n< close"),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_two_stage(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
