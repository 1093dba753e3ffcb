"""Switch interval and garbage collection."""

import gc
import sys

import pytest

from abs_service.supervision import gc_tuning


@pytest.fixture
def as_it_was():
    interval_s = sys.getswitchinterval()
    yield
    sys.setswitchinterval(interval_s)
    gc.unfreeze()


@pytest.mark.usefixtures("as_it_was")
def test_threads_take_short_turns():
    sys.setswitchinterval(0.005)
    gc_tuning.shorten_switch_interval()
    assert sys.getswitchinterval() == pytest.approx(gc_tuning.SWITCH_S)


@pytest.mark.usefixtures("as_it_was")
def test_what_is_loaded_is_searched_for_garbage_no_more():
    frozen = gc.get_freeze_count()
    gc_tuning.freeze_loaded_objects()
    assert gc.get_freeze_count() > frozen + 1000
    assert len(gc.get_objects()) < 1000
