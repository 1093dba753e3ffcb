"""A strip's stiffness is found within what is stated, from a sequence long enough."""

import pytest

from evaluation.experiment import Context
from evaluation.method import stiffness


@pytest.mark.slow
def test_the_stiffness_of_two_sequences_is_found() -> None:
    found = stiffness.run(stiffness.Settings((0.02,), 1, 60), Context(1))
    (errors,) = found.values["errors"].values()
    assert all(abs(error) < 3 for error in errors)
    rms = found.goals[-1]
    assert rms.value == pytest.approx(abs(errors[0]))
