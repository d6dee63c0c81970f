"""Configuration of recorders: options, TOML files and their error messages."""

from pathlib import Path
from typing import Any

import pytest

from scaraspec_recorder.config import ConfigError, RobotConfig, read_config, read_robot
from scaraspec_recorder.recordings.archive import archive_sink
from scaraspec_recorder.recordings.recovery import sink_after_repair
from scaraspec_recorder.recordings.rotation import parse_rotation
from scaraspec_recorder.tap.routes import Mode
from scaraspec_recorder.units import SECOND_NS

SAMPLE = Path(__file__).parents[2] / "fixtures" / "recorder" / "two-lines.toml"
URL = "tcp://192.0.2.7"


def test_the_sample_file() -> None:
    """The settings of the documented sample are those of its comments."""
    third, fourth = read_config(SAMPLE)
    assert (third.name, third.listen, third.out) == (
        "line-3",
        ("0.0.0.0:8877",),
        Path("captures/line-3"),
    )
    assert third.rotate
    assert third.rotate.limits.duration_ns == 3600 * SECOND_NS
    assert (third.redact, third.min_free_bytes, third.triggers) == (True, 2 * 10**9, ())
    assert fourth.rotate
    assert fourth.rotate.each_connection
    assert fourth.triggers == ("refusal", "finding:fail", "late:500ms")
    assert fourth.keep == third.keep


def test_only_a_url_is_required() -> None:
    """By default everything is recorded into one file."""
    robot = read_robot("r", {"url": URL}, "--")
    assert robot == RobotConfig("r", URL)
    assert robot.mode is Mode.EXPLICIT
    make: Any = robot.sink({}, draw=False, needs_login=True)
    assert make.func is sink_after_repair


@pytest.mark.parametrize(
    "table", [{"rotate": "1h"}, {"keep": "30d"}, {"min-free": "2GB"}, {"archive": "file:///store"}]
)
def test_limits_need_an_archive(table: dict[str, Any]) -> None:
    """Without `rotate` a file ends every hour: a file that never ends could not be removed."""
    given = {"url": URL, "trigger": ["refusal"], **table}
    make: Any = read_robot("r", given, "--").sink({}, draw=False, needs_login=True)
    assert make.func is archive_sink
    archive = make.keywords["archive"]
    assert archive.rotate == parse_rotation("1h")
    assert archive.triggers == ("refusal",)


def test_a_trigger_needs_no_archive() -> None:
    """A trigger also marks a single file."""
    robot = read_robot("r", {"url": URL, "trigger": ["refusal", "signal"]}, "--")
    make: Any = robot.sink({}, draw=False, needs_login=True)
    assert make.func is sink_after_repair
    assert make.keywords["make"].keywords["triggers"] == ("refusal", "signal")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "--url is missing"),
        ({"url": 5}, "--url: 5 is not a string"),
        ({"url": URL, "rotat": "1h"}, "--rotat is not a setting: did you mean rotate?"),
        ({"url": URL, "rotate": "soon"}, "--rotate: 'soon' is neither"),
        ({"url": URL, "keep": "1h,2h"}, "--keep: '1h,2h' has two limits"),
        ({"url": URL, "keep": "30d,"}, "--keep: '' is neither a duration such as 1h nor a size"),
        ({"url": URL, "min-free": "1h"}, "--min-free: '1h' is not a size"),
        ({"url": URL, "trigger": ["bang"]}, "--trigger: 'bang' is not a trigger"),
        ({"url": URL, "trigger": [1]}, "--trigger: 1 is not a string"),
        ({"url": URL, "trigger": "refusal"}, "--trigger: 'refusal' is not a list of strings"),
        (
            {"url": URL, "mode": "magic"},
            "--mode: 'magic' is not a mode: use one of port, redirect, tproxy",
        ),
        ({"url": URL, "redact": "yes"}, "--redact: 'yes' is not true or false"),
        ({"url": URL, "inject": "/nowhere.toml"}, "--inject: /nowhere.toml"),
        ({"url": URL, "i-mean-it": True}, "--i-mean-it has no effect without inject"),
        ({"url": URL, "archive": "nil://x"}, "--archive: nil://x cannot be used: Protocol not"),
        ({"url": URL, "archive-rate": "1MB"}, "--archive-rate has no effect without archive"),
        (
            {"url": URL, "keep-until-archived": True, "keep": "1h"},
            "--keep-until-archived has no effect without archive",
        ),
        (
            {"url": URL, "keep-until-archived": True, "archive": "/store"},
            "--keep-until-archived has no effect without keep or min-free",
        ),
    ],
)
def test_an_invalid_setting(table: dict[str, Any], message: str) -> None:
    """The message is one sentence: the setting, the error, and mostly the valid values."""
    with pytest.raises(ConfigError) as error:
        read_robot("r", table, "--")
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


ONE = '[robots.a]\nurl="tcp://192.0.2.7"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must configure 1 to 256 robots"),
        ("robots = 1", "must configure 1 to 256 robots"),
        ("[robots]\na = 1", "robots.a is not a table"),
        ("out = [", "is not a valid TOML file"),
        ("\ud800", "is not a valid TOML file"),
        ('url = "x"\n' + ONE, "url is not a setting for all robots"),
        (ONE + "kep = 1", "robots.a.kep is not a setting: did you mean keep?"),
        (ONE + f"out{'.a' * 2000}=1", "robots.a.out: {'a': {'a': {'a': {'a': "),
        ("out = " + "[" * 5000 + "\n" + ONE, "is not a valid TOML file: maximum recursion depth"),
        ("out = 5\n" + ONE, "robots.a.out: 5 is not a string"),
        ('[robots."a/b"]\nurl="x"', "'a/b' cannot be used in file names"),
        (ONE + ONE.replace("a]", "b]"), "b and a have the same listen, 127.0.0.1:8877"),
        (
            f'{ONE}out="x"\n{ONE}listen="h:1"\nout="x"'.replace("a]", "b]", 1),
            "a and b have the same out, x",
        ),
    ],
)
def test_an_invalid_file(tmp_path: Path, text: str, message: str) -> None:
    """The message is one sentence with the file and the position."""
    path = tmp_path / "recorders.toml"
    path.write_bytes(text.encode(errors="surrogatepass"))
    with pytest.raises(ConfigError) as error:
        read_config(path)
    assert str(error.value).startswith(str(path))
    assert message in str(error.value)


def test_an_unreadable_file(tmp_path: Path) -> None:
    """The file does not exist, or is too large for a configuration."""
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        read_config(tmp_path / "none.toml")
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(ConfigError, match="is larger than 1 MiB"):
        read_config(large)
