"""Expected texts of numbers in a request."""

import pytest

from scaraspec.suite.client.harness.request_checks import to_decimal_text


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (200, "200"),
        (-0.1, "-0.1"),
        (1e6, "1000000"),
        (-1e-7, "-0.0000001"),
        (1.2e-14, "0.000000000000012"),
        (0.1 + 0.2, "0.3"),
    ],
)
def test_expected_numbers_have_no_exponent(number: float, text: str) -> None:
    """A number in an expected request has no exponent."""
    assert to_decimal_text(number) == text
