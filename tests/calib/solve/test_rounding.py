"""Numbers in sentences have two digits, and no exponent."""

import pytest

from calib.solve.rounding import rounded


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.1834, "0.18"), (2.0, "2"), (99.6, "100"), (182.0, "180"), (2234567.0, "2200000"), (float("nan"), "nan")],
)
def test_a_number_has_two_digits_and_no_exponent(value: float, said: str) -> None:
    assert rounded(value) == said


def test_a_deviation_may_have_one_digit() -> None:
    assert (rounded(23.0, 1), rounded(0.048, 1)) == ("20", "0.05")
