"""The simulated world as a device: paces its exposures by a clock and hands them to a sink."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

from calib.camera import Camera
from drivers.device import DeviceInfo, DeviceState, Sink, StreamInfo
from drivers.simulated.simulation import Simulation

#: Waits until the event is set or so many seconds have passed; tells whether it is set.
Wait = Callable[[threading.Event, float], bool]


class SimulatedDevice:
    """Delivers exposure after exposure in real time.

    An exposure that is due by more than a period before it can be begun is skipped and counted as `late`; its number is
    skipped, too. Nothing else is ever dropped.

    Args:
        uri: the address that describes the simulation.
        simulation: what is seen.
        clock: CLOCK_MONOTONIC [ns].
        wait: how to pass time; tests pass their own.
    """

    def __init__(
        self, uri: str, simulation: Simulation, clock: Callable[[], int], wait: Wait = threading.Event.wait
    ) -> None:
        self.info = DeviceInfo(uri=uri, model="simulated", serial=f"seed {simulation.seed}")
        self.streams: tuple[StreamInfo, ...] = tuple(s for head in simulation.heads.values() for s in head.streams)
        self.cameras: Mapping[str, Camera] = {name: head.camera for name, head in simulation.heads.items()}
        self._simulation = simulation
        self._clock = clock
        self._wait = wait
        self._counters = {"frames": 0, "late": 0}
        self._epoch = -1
        self._stop = threading.Event()
        self._thread = threading.Thread()

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, and exposures skipped because it was too `late` for them."""
        return dict(self._counters)

    def start(self, sink: Sink) -> None:
        """Begins anew at exposure 0, in a new epoch; a device that is running goes on as it is."""
        if self._thread.is_alive():
            return
        self._epoch += 1
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(sink, self._stop), name="simulated", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends delivery; after it returns the sink is not called again, unless the sink itself called it."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stops; there is nothing else to release."""
        self.stop()

    def _run(self, sink: Sink, stop: threading.Event) -> None:
        try:
            sink.on_state(DeviceState.OPENING, "preparing the simulation")
            self._simulation.frames(0)  # compiles the kernels, which must not make the first exposures late
            sink.on_state(DeviceState.STREAMING, "simulated exposures follow")
            self._stream(sink, stop)
        except Exception as error:
            sink.on_state(DeviceState.FAILED, f"the simulation failed: {error!r}")
            raise
        sink.on_state(DeviceState.CLOSED, "stopped")

    def _stream(self, sink: Sink, stop: threading.Event) -> None:
        first_ns = self._clock()
        period_ns = self._simulation.time_ns(1)
        k = 0
        while True:
            behind = (self._clock() - first_ns - self._simulation.time_ns(k)) // period_ns
            if behind > 0:
                self._counters["late"] += behind
                k += behind
            frames, truths = self._simulation.frames(k), self._simulation.truths(k)
            if self._wait(stop, max(first_ns + self._simulation.time_ns(k) - self._clock(), 0) * 1e-9):
                return
            for truth in truths:
                sink.on_truth(replace(truth, t_host_ns=first_ns + truth.t_host_ns))
            for frame in frames:
                t_host_ns, t_arrival_ns = first_ns + frame.t_host_ns, self._clock()
                sink.on_frame(replace(frame, t_host_ns=t_host_ns, t_arrival_ns=t_arrival_ns, epoch=self._epoch))
                self._counters["frames"] += 1
            k += 1
