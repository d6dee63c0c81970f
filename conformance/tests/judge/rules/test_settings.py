"""What was set: each requirement with traffic that meets it and traffic that violates it."""

from collections.abc import Callable

import pytest

SET_GET = """
    login
    > {setter} {value}
    < {setter} {reply}
    {between}
    > {getter}
    < {getter} {answer}
"""
PASSWORD = """
    login
    > set_password {old}|new
    < set_password {reply}
"""
POSITION = "set_initial_tool_position 1|2|3|4|0|0"
GRIPPER = """
    login
    {before}
    > set_initial_tool_position 1|2|3|4|0|0
    < set_initial_tool_position 1
    {between}
    > get_gripper_center
    < get_gripper_center {answer}
"""
READ = "> get_gripper_center\n< get_gripper_center 0|0|5"
SWITCHED_OFF = "< rst\n> open\nlogin"
LEFT = "> close\n> open\nlogin"
PROGRAM = "> run_program a\n< run_program 1\n<90 run_program 11"


def setting(name: str) -> Callable[..., str]:
    """Return a function that makes sessions in which this is set and read."""

    def session(value: str, answer: str, between: str = "", reply: str = "1") -> str:
        return SET_GET.format(
            setter=f"set_{name}",
            getter=f"get_{name}",
            value=value,
            reply=reply,
            answer=answer,
            between=between,
        )

    return session


network, default = setting("network"), setting("default_program")
gripper, position = setting("gripper_center"), setting("initial_tool_position")
HOME, OFFICE = "10.0.0.2|255.0.0.0|10.0.0.1", "10.0.0.3|255.0.0.0|10.0.0.1"


def refused(name: str, was: str, value: str, answer: str, between: str = "") -> str:
    """A session in which a setting is refused between two queries."""
    read = f"> get_{name}\n< get_{name} "
    return f"login\n{read}{was}\n> set_{name} {value}\n< set_{name} 0\n{between}\n{read}{answer}"


TWICE = (
    f"login\n{READ}\n2> open\n2> login password\n2< login 1\n2> set_gripper_center 1|2|3\n2> rst\n"
    "> set_gripper_center 1|2|3\n< set_gripper_center 0\n"
    "> get_gripper_center\n< get_gripper_center 1|2|3"
)
AGAIN = "> set_gripper_center 1|2|3\n< set_gripper_center 1"

DELETED = "> delete_program a.rob\n< delete_program 1"


def changed(*logins: str, first: str = "login", reply: str = "1") -> str:
    """A session in which the password "password" is replaced, and logins on new connections."""
    lines = [f"{first}\n> set_password password|new\n< set_password {reply}"]
    for number, login in enumerate(logins, 2):
        password, answer = login.split()
        lines.append(f"{number}> login {password}\n{number}< login {answer}\n{number}> close")
    return "\n".join(lines)


NO_REPLY = {"4.2/2": "pass", "4.2/5": "none"}
ALONE = "> close\n2> login new\n2< login 0"

CASES = (
    ("4.2/4", "pass", changed("new 1")),
    ("4.2/4", "pass", changed("password 0")),
    ("4.2/4", "fail", changed("password 1")),
    ("4.2/4", "fail", changed("new 0", "password 1")),
    ("4.2/4", "fail", changed("new 1", "password 1")),
    ("4.2/4", "fail", changed("password 1", "new 1")),
    ("4.2/4", "inconclusive", changed() + "\n" + ALONE),
    ("4.2/4", "none", changed("new 0")),  # another client is logged in (A-2-2)
    ("4.2/4", "none", changed("password 1", reply="0")),
    ("4.2/4", "none", changed("other 0")),
    *(
        (requirement, expected + also.format(other), session)
        for requirement, other in (("4.2/2", "4.2/5"), ("4.2/5", "4.2/2"))
        for expected, also, session in (
            ("fail", " {}", changed("new 1", reply="0")),
            ("pass", "", changed("password 1", reply="0")),
            (NO_REPLY[requirement], "", changed("new 0", reply="0")),
            (NO_REPLY[requirement], "", changed("new 0", "other 0", reply="0")),
        )
    ),
    ("4.4/2", "pass", refused("network", HOME, OFFICE, HOME)),
    ("4.4/2", "fail", refused("network", HOME, OFFICE, OFFICE)),
    ("4.13/2", "pass", refused("default_program", "a.rob", "b.rob", "a.rob")),
    ("4.13/2", "fail 4.13/5", refused("default_program", "a.rob", "b.rob", "b.rob")),
    ("4.13/5", "pass", refused("default_program", "a.rob", "b.rob", "a.rob")),
    ("4.13/5", "fail 4.13/2", refused("default_program", "a.rob", "b.rob", "b.rob")),
    # Another client may have set it.
    ("4.13/5", "inconclusive", refused("default_program", "a.rob", "b.rob", "")),
    ("4.13/5", "inconclusive", refused("default_program", "a.rob", "b.rob", "0")),
    ("4.13/5", "none", refused("default_program", "a.rob", "b.rob", "", between=DELETED)),
    ("4.13/5", "none", refused("default_program", "a.rob", "b.rob", "", between="+70")),
    ("4.13/5", "none", refused("default_program", "a.rob", "b.rob", "", between="< gap 9")),
    ("4.20/2", "pass", refused("gripper_center", "0|0|0", "1|2|3", "0|0|0")),
    ("4.20/2", "fail", refused("gripper_center", "0|0|0", "1|2|3", "1|2|3")),
    ("4.20/2", "fail", refused("gripper_center", "0|0|0", "1|2|3", "1|0|0")),
    ("4.20/2", "pass", TWICE),
    # A client that was not recorded may have set it, or another setting, a program or a restart may
    # have changed it.
    ("4.20/2", "inconclusive", refused("gripper_center", "0|0|0", "1|2|3", "1|0|9")),
    ("4.20/2", "pass", refused("gripper_center", "0|0|0", "1|2|3", "1|2|3", between=AGAIN)),
    ("4.20/2", "pass", refused("gripper_center", "0|0|0", "1|2|3", "1|2|3", between=PROGRAM)),
    ("4.20/2", "pass", refused("gripper_center", "0|0|0", "1|2|3", "1|2|3", between="+70")),
    ("4.20/2", "pass", refused("gripper_center", "0|0|0", "1|2|3", "1|2|3", between=SWITCHED_OFF)),
    (
        "4.21/2",
        "pass",
        refused("initial_tool_position", "1|2|3|4|5|6", "9|2|3|4|0|0", "1|2|3|4|0|0"),
    ),
    (
        "4.21/2",
        "fail",
        refused("initial_tool_position", "1|2|3|4|0|0", "9|2|3|4|0|0", "9|2|3|4|0|0"),
    ),
    ("4.2/3", "pass", PASSWORD.format(old="wrong", reply="0")),
    ("4.2/3", "fail", PASSWORD.format(old="wrong", reply="1")),
    ("4.2/3", "none", PASSWORD.format(old="password", reply="1")),
    ("4.2/3", "none", PASSWORD.format(old="password", reply="0")),
    (
        "4.2/3",
        "fail",
        PASSWORD.format(old="password", reply="1")
        + PASSWORD[10:].format(old="password", reply="1"),
    ),
    # Two passwords were accepted; which one is right is unknown.
    (
        "4.2/3",
        "none 4.1/3",
        "login\n> login other\n< login 1\n> set_password x|y\n< set_password 1",
    ),
    ("4.2/3", "none", "login\n> set_password x|y\n> set_password x|z\n+6\n< set_password 1"),
    # The password may have been changed in bytes that were not recorded.
    (
        "4.2/3",
        "none",
        "login\n> gap\n+30\n> get_status\n< get_status 00\n> set_password x|y\n< set_password 1",
    ),
    ("4.4/3", "pass", f"login\n> set_network {HOME}\n< set_network 1"),
    ("4.4/3", "tolerated A-4.4-1=no reply", f"login\n> set_network {HOME}\n< rst"),
    ("4.4/3", "none", f"login\n> set_network {HOME}\n> close"),
    ("4.4/4", "pass", network(HOME, HOME)),
    ("4.4/4", "pass", network(HOME, "010.000.000.002|255.0.0.0|10.0.0.1")),
    ("4.4/4", "fail", network(HOME, OFFICE)),
    ("4.4/4", "none", network(HOME, OFFICE, reply="0")),
    ("4.4/4", "none", network(HOME, OFFICE, between=f"> set_network {OFFICE}")),
    ("4.4/4", "none", network(HOME, OFFICE, between="> shutdown\n< shutdown 1")),
    ("4.4/4", "none", network(HOME, OFFICE, between="2> gap\n+30\n> get_status\n< get_status 00")),
    ("4.13/3", "pass", default("a.rob", "a.rob")),
    ("4.13/3", "fail", default("a.rob", "b.rob")),
    ("4.13/3", "fail", default("a.rob", "")),
    ("4.13/3", "none", default("a.rob", "b.rob", reply="0")),
    # 0x0D is answered like an unknown opcode; the controller serves 0x13 instead, or may serve it.
    (
        "4.13/3",
        "tolerated on_unknown=0",
        default("a.rob", "0", between="> 13\n< 13 a.rob"),
    ),
    ("4.13/3", "tolerated on_unknown=0", default("a.rob", "0")),
    # One of the two opcodes is served, and a program was set.
    ("4.13/3", "fail", default("a.rob", "0") + "> 13\n< 13 0"),
    (
        "4.13/3",
        "fail",
        default("a.rob", "0", between="> get_default_program\n< get_default_program a.rob"),
    ),
    ("4.13/3", "none", default("a.rob", "", between="> delete_program a.rob\n< delete_program 1")),
    ("4.20/3", "pass", gripper("1|-2.5|3", "1.0|-2.50|3")),
    ("4.20/3", "pass", gripper("1.234|0|0", "1.2|0|0")),
    ("4.20/3", "fail", gripper("1|-2.5|3", "1|2.5|3")),
    ("4.20/3", "fail", gripper("1|2.5|3", "1|2.6|3")),
    ("4.20/3", "fail", gripper("1.234|0|0", "1.1|0|0")),
    ("4.20/3", "none", gripper("1|2|3", "4|5|6", between=PROGRAM)),
    # After a long time the robot may have been switched off and on again.
    ("4.20/3", "fail", gripper("1|2|3", "0|0|0", between="+500")),
    ("4.20/3", "none", gripper("1|2|3", "0|0|0", between="+700")),
    # The robot may have been restarted if it closed all connections; a new address closes them,
    # too.
    ("4.20/3", "none", gripper("1|2|3", "0|0|0", between=SWITCHED_OFF)),
    ("4.20/3", "fail", gripper("1|2|3", "0|0|0", between=LEFT)),
    ("4.20/3", "fail", gripper("1|2|3", "0|0|0", between=f"2> open\n{SWITCHED_OFF}")),
    ("4.21/3", "none", GRIPPER.format(before=READ, between=SWITCHED_OFF, answer="0|0|0")),
    (
        "4.21/3",
        "none",
        GRIPPER.format(before=f"{READ}\n{SWITCHED_OFF}", between="", answer="0|0|0"),
    ),
    ("4.4/4", "fail", network(HOME, OFFICE, between=SWITCHED_OFF)),
    ("4.21/3", "pass", position("1|2|3|4.5|6|7", "1|2|3|4.5|0|0")),
    ("4.21/3", "fail", position("1|2|3|4.5|0|0", "1|2|3|4|0|0")),
    ("4.21/3", "none", position("1|2|3|4|0|0", "9|2|3|4|0|0", between=PROGRAM)),
    ("4.21/3", "pass", GRIPPER.format(before=READ, between="", answer="0|0|5")),
    ("4.21/3", "fail", GRIPPER.format(before=READ, between="", answer="1|2|3")),
    ("4.21/3", "none", GRIPPER.format(before="", between="", answer="1|2|3")),
    ("4.21/3", "none", GRIPPER.format(before=READ, between=PROGRAM, answer="1|2|3")),
    (
        "4.21/3",
        "none",
        GRIPPER.format(
            before=READ,
            between="> set_gripper_center 1|2|3\n< set_gripper_center 1",
            answer="1|2|3",
        ),
    ),
)


@pytest.mark.parametrize(("requirement", "expected", "session"), CASES)
def test_settings(
    requirement: str, expected: str, session: str, check_case: Callable[[str, str, str], None]
) -> None:
    """Each session gives the expected verdict, and no other requirement fails."""
    check_case(requirement, expected, session)
