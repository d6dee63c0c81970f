"""4.31: the digital inputs (0x42, L639-651)."""

from hypothesis import example, given
from hypothesis import strategies as st

from scaraspec.suite.as_controller.line import Line
from scaraspec.suite.as_controller.sending import expect_no_value
from scaraspec.suite.as_controller.subject import Subject
from scaraspec.suite.case import client_case

_GET = "get_digital_inputs"
_COUNT = 8


@client_case("4.31/1", "4.31/3", attended=True)
def test_asked(subject: Subject, line: Line) -> None:
    """The inputs are asked for all at once, without data, and port 8 is told leftmost."""
    call = subject.begin(_GET)
    line.serve(call, "10000010", sent=b"")
    subject.gives(call, "10000010", requirement="4.31/3")


@client_case("4.31/3", "4.31/1", name="each")
def test_each_port(subject: Subject, line: Line) -> None:
    """Each of the eight inputs shows at its own place, in every combination."""

    @example("0" * _COUNT)
    @example("1" * _COUNT)
    @given(st.text("01", min_size=_COUNT, max_size=_COUNT))
    def each(bits: str) -> None:
        call = subject.begin(_GET)
        line.serve(call, bits, sent=b"")
        subject.gives(call, bits, requirement="4.31/3")

    for place in range(_COUNT):
        each = example("0" * place + "1" + "0" * (_COUNT - 1 - place))(each)
    each()


@client_case("4.31/1", name="error")
def test_error(subject: Subject, line: Line) -> None:
    """The single 0 is an error and no input; the next request carries no data either."""
    for _ in range(2):
        call = subject.begin(_GET)
        line.serve(call, data=b"0", sent=b"")
        expect_no_value(subject, call)
        call = subject.begin(_GET)
        line.serve(call, "00000000", sent=b"")
        subject.gives(call, "00000000")
