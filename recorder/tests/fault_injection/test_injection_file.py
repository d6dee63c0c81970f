"""Files of injection rules and their error messages."""

from collections.abc import Callable
from pathlib import Path

import pytest

from scaraspec.protocol.commands import COMMANDS
from scaraspec_recorder.fault_injection import injection_file
from scaraspec_recorder.fault_injection.injection_file import InjectionError, load_injection
from scaraspec_recorder.fault_injection.rules import Injection

SAMPLES = sorted((Path(__file__).parents[3] / "fixtures" / "injection").glob("*.toml"))

Load = Callable[[str], Injection]
DELAY = '[[rule]]\nfault = "delay"\n'
DROP = '[[rule]]\nfault = "drop"\n'


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_the_samples_are_valid(path: Path) -> None:
    """Each has rules, and the README names it."""
    assert load_injection(path).rules
    assert f"`{path.name}`" in (path.parent / "README.md").read_text()


def test_the_samples_show_every_fault() -> None:
    """The samples use each kind of fault."""
    shown = {type(rule.fault) for path in SAMPLES for rule in load_injection(path).rules}
    assert shown == set(injection_file._FAULTS.values())


def test_the_documented_file_is_valid(load: Load) -> None:
    """The example in the docstring of the module is valid; its name is in the capture."""
    assert injection_file.__doc__
    lines = injection_file.__doc__.partition("    seed = 7")[2].partition("\nOnly")[0].splitlines()
    injection = load("seed = 7" + "\n".join(line.removeprefix("    ") for line in lines))
    assert [r.label for r in injection.rules] == ["rule 1 (slow status)"]
    assert injection.seed == 7


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "it has no rule: start each rule with a line [[rule]]"),
        ("rule = 3", "it has no rule"),
        ("rule = [3]", "it has no rule"),
        ("seeds = 3", "seeds is not a key of this file: use seed and [[rule]]"),
        ("seed = -1", "seed must be a whole number from 0 to 1000000000, not -1"),
        ("[[rule", "it is not a valid TOML file: "),
        ("x = '" + "x" * (1 << 20) + "'", "it is larger than 1 MiB"),
        ("[[rule]]\n" * 300, "it has 300 rules, but at most 256 are allowed"),
        ("[[rule]]", "rule 1: fault is missing: it must be one of delay, jitter, fragment,"),
        ('[[rule]]\nfault = "slow"\n', "rule 1: fault must be one of delay, jitter"),
        ("[[rule]]\nfault = []", "rule 1: fault must be one of delay"),
        (DELAY, "rule 1: delay_ms is missing: delay needs a number above 0, 3.6e+06 at most"),
        (DELAY + "delay_ms = 0", "rule 1: delay_ms must be a number above 0, 3.6e+06 at most, not"),
        (DELAY + "delay_ms = nan", "not nan"),
        (DELAY + "delay_ms = true", "not True"),
        (DELAY + "delay_ms = '5'", "not '5'"),
        (
            DELAY + "delay = 5",
            "rule 1: delay is not a key of the fault delay: use delay_ms, fault, name,",
        ),
        (DELAY + "xor = 5", "rule 1: xor is not a key of the fault delay: use delay_ms"),
        (DROP + DROP + "nth = 0", "rule 2: nth must be a whole number from 1 to"),
        (DROP + "nth = 1\nfirst = 2", "rule 1: nth and first exclude each other"),
        (DROP + "probability = 2", "probability must be a number above 0, 1 at most, not 2"),
        (DROP + "command = 'status'", "command must be a command's name such as get_status"),
        (DROP + "command = 256", "or an opcode from 0x00 to 0xFF, not 256"),
        (DROP + "command = [1]", "or an opcode from 0x00 to 0xFF, not [1]"),
        (DROP + "part = 'answer'", "part must be one of request, reply, result, not"),
        (DROP + "direction = 'up'", "direction must be one of A2C, C2A, not 'up'"),
        (DROP + "name = 'a\\nb'\nname = 'b'", "it is not a valid TOML file"),
        (DROP + 'name = "a\\nb"', "name must be a text of at most 60 characters, on one"),
        (
            DROP + "command = 'get_time'\npart = 'result'",
            "rule 1 matches no frame: get_time has no final result",
        ),
        (
            DROP + "command = 'download_chunk'\npart = 'request'\ndirection = 'A2C'",
            "rule 1 matches no frame: the request of download_chunk goes C2A",
        ),
        (
            (
                '[[rule]]\nfault = "hold-back"\nat_most_ms = 1\n'
                "until_command = 'get_time'\nuntil_part = 'result'"
            ),
            "rule 1 matches no frame: get_time has no final result",
        ),
    ],
)
def test_an_invalid_file(load: Load, text: str, sentence: str) -> None:
    """One sentence: the file, the rule, the key, and the valid values."""
    with pytest.raises(InjectionError) as caught:
        load(text)
    message = str(caught.value)
    assert f"faults.toml: {sentence}" in message or sentence in message.partition("rule 1: ")[2]
    assert "\n" not in message
    assert len(message) < 500


def test_an_unreadable_file(tmp_path: Path) -> None:
    """A missing file, a folder, or a file that is not text."""
    with pytest.raises(InjectionError, match="nowhere: it cannot be read: No such file"):
        load_injection(tmp_path / "nowhere")
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    with pytest.raises(InjectionError, match="binary: it is not a valid TOML file"):
        load_injection(tmp_path / "binary")


def test_every_part_of_every_command_can_be_selected(load: Load) -> None:
    """Each command and direction can be selected by a condition that is possible."""
    for command in COMMANDS:
        parts = ("request", "reply", "result") if command.two_stage else ("request", "reply")
        for part in parts:
            load(DROP + f'command = "{command.name}"\npart = "{part}"')
