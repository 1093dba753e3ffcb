"""A program on a host with a clock of its own, or one that reads there and writes what it gets to its output.

python another_host.py drift PPM BEGIN_NS ARGUMENTS…   abs-service, on a monotonic clock that runs fast since BEGIN_NS
python another_host.py read ENDPOINT                   each message that is published, as a line
"""

import base64
import json
import runpy
import sys
import time

from tests.system.running import RigListener

monotonic_ns = time.monotonic_ns


def drift(ppm, begin_ns, *arguments):
    """Runs abs-service; a time namespace gives the clock another origin, but nothing in Linux another speed."""
    before_ns, gain = int(begin_ns), float(ppm) * 1e-6

    def fast_ns():
        now_ns = monotonic_ns()
        return now_ns + round((now_ns - before_ns) * gain)

    time.monotonic_ns, time.monotonic = fast_ns, lambda: fast_ns() * 1e-9
    sys.argv = ["abs-service", *arguments]
    runpy.run_module("abs_service", run_name="__main__")


def read(endpoint):
    """Writes until nobody reads any more."""
    with RigListener(endpoint) as listener:
        written = 0
        while True:
            for one in listener.received[written:]:
                written += 1
                binary = [base64.b64encode(data).decode() for data in (one.sample.payload, one.sample.attachment)]
                print(json.dumps([one.t_ns, one.sample.topic, one.sample.message, *binary]), flush=True)
            time.sleep(0.02)


if __name__ == "__main__":
    {"drift": drift, "read": read}[sys.argv[1]](*sys.argv[2:])
