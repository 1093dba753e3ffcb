"""Switch interval, garbage collection and freed memory."""

import gc
import subprocess
import sys

import pytest

from abs_service.supervision.process_setup import process_tuning


@pytest.fixture
def as_it_was():
    interval_s = sys.getswitchinterval()
    yield
    sys.setswitchinterval(interval_s)
    gc.unfreeze()


@pytest.mark.usefixtures("as_it_was")
def test_threads_take_short_turns():
    sys.setswitchinterval(0.005)
    process_tuning.shorten_switch_interval()
    assert sys.getswitchinterval() == pytest.approx(process_tuning.SWITCH_S)


@pytest.mark.usefixtures("as_it_was")
def test_what_is_loaded_is_searched_for_garbage_no_more():
    frozen = gc.get_freeze_count()
    process_tuning.freeze_loaded_objects()
    assert gc.get_freeze_count() > frozen + 1000
    assert len(gc.get_objects()) < 1000


#: Faults of a process that has ten images of 3 MB and their copies, one after the other, after the first ones.
_FAULTS = """
import resource
from abs_service.supervision.process_setup import process_tuning
{tune}
def faults():
    for _ in range(10):
        images = bytes(3_000_000), bytearray(3_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
print(-faults() + faults())
"""


@pytest.mark.parametrize(
    ("tune", "minimum", "maximum"), [("process_tuning.keep_freed_memory()", 0, 50), ("", 500, 20_000)]
)
def test_the_memory_of_an_image_serves_the_next_one(tune, minimum, maximum):
    program = [sys.executable, "-c", _FAULTS.format(tune=tune)]
    assert minimum <= int(subprocess.run(program, check=True, capture_output=True, text=True).stdout) <= maximum
