import numba
import pytest

from abs_service.commands.parts import progress


@pytest.mark.parametrize("disable", [True, False])
def test_kernels_are_counted_while_they_are_compiled_and_no_longer(disable, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, for rich
    inner = numba.njit(lambda x: x + 1)
    outer = numba.njit(lambda x: 2 * inner(x))
    with progress.bars(disable) as bars:
        (task,) = bars.tasks
        assert not task.visible
        assert outer(1) == 4
        assert (task.visible, task.completed) == (True, 1)
        outer(2)
        assert task.completed == 1
        outer(0.5)
        assert task.completed == 2
    outer(1j)
    assert task.completed == 2
    assert ("compiling kernels" in capsys.readouterr().err) == (not disable)
