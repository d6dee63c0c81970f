"""The open points, and dialects."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.readings import (
    DEFAULT,
    READINGS,
    Binds,
    Detectable,
    Dialect,
    Reading,
    ReadingError,
)

# The register's list of dialect keys, default first, typed by hand.
REGISTER = """
prog_ext            A-0-9     any .rob .txt
err_sep             A-0-2     bar space
max_clients         A-2-2     many one newest
on_unknown          A-3-9     ignore 0 close
resync              A-3-10    bytewise framewise flush close
partial_timeout     A-3-11    2 none
pipelining          A-3-14    in-order one any-order
reply_timeout       A-3-15    5
runinfo_binary      A-T-1     ascii binary
text_encoding       A-T-2     bytes ascii utf-8 gb18030
trailing_nul        A-T-3     no yes
num_format          A-T-5     free one-decimal
busy_reply          A-4-2     state silence queue
prelogin            A-4-4     ignore failure close reads all
status_lag          A-4.8-3   0
runinfo_none        A-4.9-2   0 0||
list_prefix_sep     A-4.10-2  0|a 0a
list_cont           A-4.10-3  push request
list_empty          A-4.10-4  0 0| empty
delete_guard        A-4.11-1  refuse allow
op_get_default      A-4.12-1  0x0D 0x13 both
default_none        A-4.12-2  empty 0 silence
op_temp_reply       A-4.14-1  0x0F 0x0E
estop_interrupted   A-4.17-4  first after none
reset_from_error    A-4.18-2  allow idle-only
theta_yz            A-4.21-3  echo zero reject
pose_point          A-4.23-1  screw-end gripper
err_bare0           A-4.24-3  0|code 0
jog_byte            A-4.28-1  ascii binary
port_pad            A-4.32-1  drawn free
port_map            A-4.32-2  per-kind one
endian              A-5-2     little big
chunk_trunc         A-5-3     full truncated
chunk_order         A-5-8     ascending any
empty_file          A-5-10    refused name-only chunk
partial_keep        A-5-12    remove keep
xfer_timeout        A-5-13    30
xfer_concurrency    A-5-17    refuse replace
name_max            A-5-20    30 255
prog_layout         A-6.1-2   ilp32 packed pack2 lp64 mixed
point_meaning       A-6.5-2   joints pose
counts_mode         A-6.5-4   records children with-end
loop_iter           A-6.5-5   endless counts
wait_scale          A-6.5-10  all analog
cmp_result          A-6.6a-1  output polarity
assign_opt          A-6.6a-2  zero any expression
"""
ROWS = [line.split() for line in REGISTER.strip().splitlines()]

DURATIONS = ["partial_timeout", "reply_timeout", "status_lag", "xfer_timeout"]


def choices(reading: Reading) -> st.SearchStrategy[str]:
    """Return a strategy for all valid choices of a reading."""
    names = st.sampled_from([option.name for option in reading.options])
    return names | st.sampled_from(["0.25", "1", "60", "120.5"]) if reading.unit else names


dialects = st.fixed_dictionaries(
    {}, optional={key: choices(reading) for key, reading in READINGS.items()}
).map(Dialect)


def test_readings_match_the_register() -> None:
    """The 46 keys, their entries and options (default first) are those of the register."""
    assert len(ROWS) == 46
    assert [
        [key, reading.entry, *(option.name for option in reading.options)]
        for key, reading in READINGS.items()
    ] == ROWS


@pytest.mark.parametrize("reading", READINGS.values(), ids=READINGS)
def test_questions_and_options(reading: Reading) -> None:
    """A reading has one question; its options differ in name and in meaning."""
    assert reading.question.count("?") == reading.question.endswith("?") == 1
    assert len({option.name for option in reading.options}) == len(reading.options)
    assert len({option.meaning for option in reading.options}) == len(reading.options)
    assert all(option.meaning for option in reading.options)


def test_binds_and_detectable() -> None:
    """A reading states its side and how to detect it; only the port numbering is undetectable."""
    assert READINGS["busy_reply"].binds is Binds.CONTROLLER
    assert READINGS["endian"].binds is Binds.BOTH
    assert Detectable.IN_FILE in READINGS["endian"].detectable
    assert Detectable.BY_PROBE not in READINGS["busy_reply"].detectable
    never = [key for key, reading in READINGS.items() if reading.detectable is Detectable.NOT]
    assert never == ["port_map"]


def test_only_durations_have_a_unit() -> None:
    """Only the timeouts and the lag have a unit, which is seconds."""
    assert {
        key: reading.unit for key, reading in READINGS.items() if reading.unit
    } == dict.fromkeys(DURATIONS, "s")


def test_default_dialect() -> None:
    """The default dialect contains the first option of every reading."""
    assert dict(DEFAULT) == {key: option for key, _, option, *_ in ROWS}
    assert DEFAULT.differences() == {}
    assert repr(DEFAULT) == "Dialect.of()"


def test_choice_changes_only_its_reading() -> None:
    """`of` starts from the defaults, `replace` from the dialect, which does not change."""
    big = Dialect.of(endian="big")
    other = big.replace(jog_byte="binary", err_sep="space")
    assert big.differences() == {"endian": "big"}
    assert other.differences() == {"endian": "big", "jog_byte": "binary", "err_sep": "space"}
    assert other.replace(endian="little", jog_byte="ascii", err_sep="bar") == DEFAULT


def test_dialect_is_immutable() -> None:
    """A dialect is hashable, so it does not support assignment."""
    with pytest.raises(TypeError):
        DEFAULT["endian"] = "big"  # type: ignore[index] # the point of the test
    assert {Dialect.of(): 1}[DEFAULT] == 1


@given(dialects)
def test_dialect_round_trip(dialect: Dialect) -> None:
    """repr, settings and pickle give an equal dialect with the same hash."""
    again = [
        eval(repr(dialect), {"Dialect": Dialect}),
        Dialect.parse(f"{key}={choice}" for key, choice in dialect.items()),
        Dialect.of(**dialect.differences()),
        pickle.loads(pickle.dumps(dialect)),
    ]
    assert [(same, hash(same)) for same in again] == [(dialect, hash(dialect))] * 4


@pytest.mark.parametrize("key", DURATIONS)
@pytest.mark.parametrize(
    ("written", "kept", "seconds"),
    [("3", "3", 3.0), ("0.5", "0.5", 0.5), ("007.250", "7.25", 7.25), ("3600", "3600", 3600.0)],
)
def test_durations(key: str, written: str, kept: str, seconds: float) -> None:
    """Equal durations give the same choice, whatever their notation."""
    dialect = Dialect.of(**{key: written})
    assert dialect[key] == kept
    assert dialect.seconds(key) == seconds


def test_default_durations() -> None:
    """The defaults are 2, 5, 0 and 30 s; the timeout of an unfinished frame can be disabled."""
    assert [DEFAULT.seconds(key) for key in DURATIONS] == [2.0, 5.0, 0.0, 30.0]
    assert Dialect.of(partial_timeout="none").seconds("partial_timeout") is None


@pytest.mark.parametrize("key", ["endian", "name_max", "timeout"])
def test_seconds_of_other_readings(key: str) -> None:
    """`seconds` raises an error for a reading that is not a duration."""
    with pytest.raises(ReadingError):
        DEFAULT.seconds(key)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["endain=big"], "unknown reading 'endain': did you mean endian?"),
        (["endian=middle"], "endian cannot be 'middle': choose little or big"),
        (["endian="], "endian cannot be '': choose little or big"),
        (["endian"], "'endian' is not a setting: write key=option, such as endian=big"),
        (["endian=big", "endian=big"], "endian is set twice: remove one of the settings"),
        (
            ["partial_timeout=0"],
            "partial_timeout cannot be '0': choose 2 or none or any positive number (s)",
        ),
        (
            ["xfer_timeout=none"],
            "xfer_timeout cannot be 'none': choose 30 or any positive number (s)",
        ),
    ],
)
def test_invalid_settings(settings: list[str], message: str) -> None:
    """The message states the error and the valid choices."""
    with pytest.raises(ReadingError) as raised:
        Dialect.parse(settings)
    assert str(raised.value) == message


def test_unknown_key_lists_all_keys() -> None:
    """If no key is similar, the message lists all keys."""
    with pytest.raises(ReadingError, match=r"the readings are prog_ext, err_sep, .*, assign_opt"):
        Dialect.of(qqq="1")


@pytest.mark.parametrize("text", ["-1", "+1", "1e3", "inf", "nan", "1.", ".5", "٣", "1 ", "0.0"])
def test_invalid_durations(text: str) -> None:
    """A duration consists of plain decimal digits."""
    with pytest.raises(ReadingError, match="any positive number"):
        Dialect.of(reply_timeout=text)


@pytest.mark.parametrize(
    "setting", ["e" * 10**6, "e" * 10**6 + "=1", "reply_timeout=" + "9" * 10**6]
)
def test_huge_settings(setting: str) -> None:
    """Search time and message length do not grow with the setting."""
    with pytest.raises(ReadingError) as raised:
        Dialect.parse([setting])
    assert len(str(raised.value)) < 1000
