"""The ICS: valid keys, and the messages for invalid ones."""

import sys
from pathlib import Path

import pytest

from scaraspec.suite.engine.hooks import HOOKS, CommandHook, HookError
from scaraspec.suite.engine.ics import Ics, IcsError

COMPLETE = """
[subject]
name = "Plant A"
version = "1.2.0"
url = "tcp://192.168.1.2"
lacks = ["shutdown"]
network_applies = "after-restart"
time_scale = 10

[readings]
op_get_default = "0x13"
xfer_timeout = 1

[motion]
step_mm = 2
box_mm = [[200, 300], [-50, 50], [200, 250]]

[hooks]
timeout_s = 5
set_input = "PYTHON -c 'import sys; sys.exit(sys.argv[1:] != [\\"3\\", \\"1\\"])' {port} {value}"
restart = "PYTHON -c 'import time; print(1, flush=True); time.sleep(60)'"
"""


def read(text: str, folder: Path) -> Ics:
    """Read an ICS with this text."""
    file = folder / "ics.toml"
    file.write_text(text.replace("PYTHON", sys.executable), encoding="utf-8")
    return Ics.read(file)


def test_a_complete_ics(tmp_path: Path) -> None:
    """Each key has its effect."""
    ics = read(COMPLETE, tmp_path)
    assert (ics.name, ics.version) == ("Plant A", "1.2.0")
    assert ics.unsupported == {"shutdown"}
    assert ics.claimed == {"op_get_default", "xfer_timeout"}
    assert ics.transfer_s == 1
    assert ics.motion.box_mm == ((200, 300), (-50, 50), (200, 250))


def test_claims_in_a_recording(tmp_path: Path) -> None:
    """The recording contains the claims that the judge needs, and no hooks."""
    ics = read(COMPLETE, tmp_path)
    assert ics.recorded == {
        "readings.op_get_default": "0x13",
        "readings.xfer_timeout": "1",
        "lacks": "shutdown",
        "network_applies": "after-restart",
        "time_scale": "10",
    }
    again = Ics.of_recording(ics.recorded)
    assert again.scope(None) == ics.scope(None)
    assert (again.dialect, again.claimed) == (ics.dialect, ics.claimed)
    assert Ics.of_recording({}) == Ics.of_recording(Ics().recorded) == Ics()


def test_hooks_run_without_a_shell(tmp_path: Path) -> None:
    """Placeholders are replaced; an exit status other than 0 is an error that names the hook."""
    hook = read(COMPLETE, tmp_path).hooks["set_input"]
    hook.run(port=3, value=1)
    with pytest.raises(HookError, match="set_input ended with status 1"):
        hook.run(port=3, value="0; true")


def test_a_hook_program_without_permission(tmp_path: Path) -> None:
    """A file without the execute permission is refused; with it, it is accepted."""
    program = tmp_path / "restart.sh"
    program.write_text("#!/bin/sh\n", encoding="utf-8")
    text = f"[hooks]\nrestart = '{program}'"
    with pytest.raises(IcsError, match="does not exist or is not executable"):
        read(text, tmp_path)
    program.chmod(0o700)
    read(text, tmp_path).hooks["restart"].run()


def test_every_placeholder_can_be_checked() -> None:
    """Each hook has a sample of its placeholders."""
    for name in HOOKS:
        CommandHook(name, sys.executable, 1.0).check()


def test_a_hook_that_hangs_is_ended(tmp_path: Path) -> None:
    """The hook is stopped after its time limit."""
    hook = read(COMPLETE.replace("timeout_s = 5", "timeout_s = 0.2"), tmp_path).hooks["restart"]
    with pytest.raises(HookError, match=r"restart did not end within 0\.2 s"):
        hook.run()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[subject]\nnmae = 'x'", "subject.nmae is not known"),
        ("[subject]\nname = 3", "subject.name must be str"),
        ("[subject]\nlacks = ['fly']", "'fly', which is not a command"),
        ("[subject]\nnetwork_applies = 'never'", "network_applies"),
        ("[subject]\ntime_scale = 0", "time_scale"),
        ("[readings]\nop_get_default = '0x99'", "op_get_default"),
        ("[readings]\nno_such = '1'", "no_such"),
        ("[subject]\nlacks = [[]]", "lacks"),
        ("[motion]\nbox_mm = [[1, 2]]", "three pairs"),
        ("[motion]\nbox_mm = [[1, 2], [3, 4], ['5', 6]]", "three pairs"),
        ("[motion]\nbox_mm = [[2, 1], [3, 4], [5, 6]]", "three pairs"),
        ("[motion]\nbox_mm = [[nan, 1], [3, 4], [5, 6]]", "three pairs"),
        ("[motion]\nstep_mm = nan", "step_mm must be above 0"),
        ("[motion]\nstep_mm = -5", "step_mm must be above 0"),
        ("[motion]\nspeed_percent = 101", "speed_percent must be above 0 and at most 100"),
        ("[motion]\nspeed_percent = 5.5", "speed_percent must be int"),
        ("[motion]\njog_s = -1", "jog_s must be above 0"),
        ("[motion]\nlongest_s = nan", "longest_s must be above 0"),
        ("[hooks]\ntimeout_s = 0", "timeout_s must be above 0"),
        ("[hooks]\nexplode = 'true'", "hooks.explode is not known"),
        ("[hooks]\nrestart = 3", "hooks.restart must be str"),
        ("[hooks]\nrestart = ''", "the hook restart is empty"),
        ('[hooks]\nrestart = "sh -c \'true"', "restart is not a valid command line: No closing"),
        (
            "[hooks]\nset_input = 'PYTHON {prot} {value}'",
            "not a valid command line: 'prot'; its placeholders are: port, value",
        ),
        ("[hooks]\nrestart = 'PYTHON {port}'", "its placeholders are: none"),
        ("[hooks]\nrestart = 'PYTHON {}'", "restart is not a valid command line"),
        (
            "[hooks]\nrestart = '/no/such/program now'",
            "the program /no/such/program of the hook restart does not exist or is not executable",
        ),
        ("[hooks]\nrestart = 'no-such-program-on-the-path'", "does not exist or is not executable"),
        ("readings = 3", "[readings] must be a table"),
        ("[subject\n", "is not valid TOML"),
        ("a = " + "9" * 5000, "is not valid TOML"),
        ("a = " + "[" * 5000, "is not valid TOML"),
        ("[more]\n", "more is not known"),
    ],
)
def test_mistakes(tmp_path: Path, text: str, message: str) -> None:
    """Each mistake has a message of one sentence, which names the file and the key."""
    with pytest.raises(IcsError) as printed:
        read(text, tmp_path)
    assert message in str(printed.value)
    assert str(tmp_path) in str(printed.value)
