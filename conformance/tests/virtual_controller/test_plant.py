"""The plant: the arm in motion, its motors, ports, clock and faults."""

import math
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.payloads import JogDirection
from scaraspec.virtual_controller.arm import UPPER, Joints, Pose, inverse
from scaraspec.virtual_controller.motion import jog, move
from scaraspec.virtual_controller.plant import (
    AMBIENT_C,
    FULL_SPEED_RISE_C,
    NoSuchPortError,
    Plant,
    Pwm,
    WallClock,
)

TARGET = inverse(Pose(200, 300, 324, 34.6), near=UPPER)


def start_move(plant: Plant, now_s: float) -> float:
    """Start a move to TARGET and return when it ends."""
    plant.start(move(plant.joints(now_s), TARGET, 100), now_s)
    return plant.motion_ends_s


def test_a_motion_runs_in_the_time_it_was_started_at(plant: Plant) -> None:
    """The arm is at the start before the motion, and at the target after it."""
    before = plant.joints(3.0)
    ends_s = start_move(plant, 3.0)
    assert plant.joints(3.0) == pytest.approx(before)
    assert plant.joints((3.0 + ends_s) / 2) not in (before, TARGET)
    assert plant.joints(ends_s) == plant.joints(ends_s + 1e6) == TARGET


@given(st.floats(0, 1))
def test_a_stop_holds_the_arm_where_it_is(share: float) -> None:
    """The arm stays where it is at the moment of the stop (4.17/7)."""
    plant = Plant(datetime(2014, 12, 22, tzinfo=UTC), now_s=0.0)
    stop_s = share * start_move(plant, 0.0)
    there = plant.joints(stop_s)
    plant.stop(stop_s)
    assert plant.motion_ends_s == stop_s
    assert plant.joints(stop_s) == plant.joints(stop_s + 60) == there


def test_motors_warm_with_motion_and_cool_at_rest(plant: Plant) -> None:
    """A moving motor gets warmer, a resting one cools down to ambient temperature."""
    assert plant.temperatures_c(0.0) == (AMBIENT_C,) * 4
    turned = plant.joints(0.0)._replace(inner_arm_deg=90)
    plant.start(move(plant.joints(0.0), turned, 100), 0.0)
    inner, outer, wrist, rotation = plant.temperatures_c(plant.motion_ends_s)
    assert inner > AMBIENT_C + 1
    assert outer == wrist == rotation == AMBIENT_C
    cooling = [plant.temperatures_c(t_s)[0] for t_s in (10, 40, 80, 600)]
    assert cooling == sorted(cooling, reverse=True)
    assert cooling[-1] == pytest.approx(AMBIENT_C, abs=1e-3)


def test_motor_temperatures_are_bounded(plant: Plant) -> None:
    """Continuous motion approaches a limit and does not exceed it."""
    now_s, home = 0.0, plant.joints(0.0)
    for _ in range(100):
        for target in (TARGET, home):
            plant.start(move(plant.joints(now_s), target, 100), now_s)
            now_s = plant.motion_ends_s
    temperatures_c = plant.temperatures_c(now_s)
    assert min(temperatures_c) > AMBIENT_C
    assert AMBIENT_C + 20 < max(temperatures_c) < AMBIENT_C + FULL_SPEED_RISE_C


def test_temperatures_do_not_change_if_time_does_not_advance(plant: Plant) -> None:
    """Repeated queries, or a query for an earlier time, return the same values."""
    ends_s = start_move(plant, 0.0)
    warm = plant.temperatures_c(ends_s)
    assert plant.temperatures_c(ends_s) == plant.temperatures_c(ends_s - 1) == warm


def test_ports_keep_their_values(plant: Plant) -> None:
    """Eight inputs of each kind, sixteen outputs of each kind, numbered from 1."""
    plant.digital_inputs[8] = True
    plant.digital_outputs[16] = True
    plant.analog_inputs[8] = -1.25
    plant.pwm_outputs[1] = Pwm(50, 1000)
    assert list(plant.digital_inputs) == [False] * 7 + [True]
    assert list(plant.digital_outputs) == [False] * 15 + [True]
    assert plant.analog_inputs[8] == -1.25
    assert plant.pwm_outputs[1] == (50, 1000)


@pytest.mark.parametrize("port", [-1, 0, 17, 2**32 - 1])
def test_an_unknown_port_is_an_error(plant: Plant, port: int) -> None:
    """No port number is mapped to another port."""
    for ports in (plant.digital_inputs, plant.analog_inputs, plant.digital_outputs):
        with pytest.raises(NoSuchPortError, match="the ports are 1 to"):
            ports[port]
    with pytest.raises(NoSuchPortError):
        plant.digital_outputs[port] = True


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e7])
def test_an_analog_input_is_a_plain_number(plant: Plant, value: float) -> None:
    """A value that does not fit an int32 of hundredths is refused, and the input keeps its
    value."""
    with pytest.raises(ValueError, match="is not a valid value of analog input 1"):
        plant.analog_inputs[1] = value
    assert plant.analog_inputs[1] == 0.0


def test_the_clock_runs_after_it_was_set() -> None:
    """Days, months and leap years are counted (4.5, 4.6)."""
    clock = WallClock(datetime(2014, 12, 31, 23, 59, 58), now_s=100.0)  # noqa: DTZ001 - no zone
    assert clock.time(103.0) == datetime(2015, 1, 1, 0, 0, 1)  # noqa: DTZ001 - no zone
    clock.set(datetime(2016, 2, 28, 23, 59, 59), now_s=200.0)  # noqa: DTZ001 - no zone
    assert clock.time(201.0) == datetime(2016, 2, 29)  # noqa: DTZ001 - no zone


def test_the_clock_stops_at_the_end_of_year_9999() -> None:
    """After the end of the year 9999 the clock stops without an error."""
    clock = WallClock(datetime(9999, 12, 31, 23, 59, 59), now_s=0.0)  # noqa: DTZ001 - no zone
    assert clock.time(1e9) == clock.time(math.inf) == datetime.max  # noqa: DTZ901 - no zone


@given(st.datetimes(datetime(1971, 1, 1), datetime(2100, 1, 1)), st.floats(0, 1e6))  # noqa: DTZ001 - no zone
def test_seconds_since_1970_of_the_clock(time: datetime, delay_s: float) -> None:
    """The clock is in UTC: a time is reached when the clock shows it (L938)."""
    clock = WallClock(time, now_s=50.0)
    epoch_s = time.replace(tzinfo=UTC).timestamp() + delay_s
    assert clock.when_s(epoch_s) == pytest.approx(50.0 + delay_s, abs=1e-5)


def test_faults_of_motors_add_up(plant: Plant) -> None:
    """Codes 11-1F are a bit mask; motor faults have priority over 05 and 06 (A-8-1, A-4.8-2)."""
    plant.fail("06", 0.0)
    assert plant.fault_code == "06"
    plant.fail("05", 0.0)
    assert plant.fault_code == "05"
    plant.fail("11", 0.0)
    plant.fail("1a", 0.0)
    assert plant.fault_code == "1B"
    plant.clear_faults()
    assert plant.fault_code is None


def test_a_lasting_fault_stays_until_repaired(plant: Plant) -> None:
    """Clearing removes only faults without a remaining cause (A-4.18-2)."""
    plant.fail("12", 0.0, lasting=True)
    plant.fail("14", 0.0)
    plant.clear_faults()
    assert plant.fault_code == "12"
    plant.repair()
    assert plant.fault_code == "12"
    plant.clear_faults()
    assert plant.fault_code is None


def test_a_fault_stops_the_arm(plant: Plant) -> None:
    """The arm does not move with a faulty motor."""
    plant.start(jog(plant.joints(0.0), JogDirection.PLUS_Y), 0.0)
    plant.fail("11", 1.0)
    there = plant.joints(1.0)
    assert plant.motion_ends_s == 1.0
    assert plant.joints(9.0) == there


@pytest.mark.parametrize("code", ["00", "01", "07", "10", "20", "xx"])
def test_only_a_fault_can_be_injected(plant: Plant, code: str) -> None:
    """States, reserved codes and the code of a missing file are not faults."""
    with pytest.raises(ValueError, match="use 05, 06 or 11 to 1F"):
        plant.fail(code, 0.0)
    assert plant.fault_code is None


def test_an_arm_can_be_placed_at_the_start() -> None:
    """A plant may start anywhere within the limits."""
    there = Joints(10, 20, 200, 30)
    assert Plant(datetime(2014, 12, 22, tzinfo=UTC), 5.0, there).joints(5.0) == there
