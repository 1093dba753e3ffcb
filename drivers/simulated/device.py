"""Real-time simulated device: paces the exposures of a simulation by a clock."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.device import DeviceInfo, DeviceState, Sink, Truth
from drivers.contract.frame import Frame, Kind
from drivers.contract.frame_gate import FrameGate
from drivers.simulated.faults import Fault, FaultSchedule, corrupted
from drivers.simulated.sensors.exposure import NOMINAL_S
from drivers.simulated.simulation import Simulation

#: Waits until the event is set or the timeout [s] has passed; returns True if it is set.
Wait = Callable[[threading.Event, float], bool]

#: Number of overdue exposures that are still delivered.
BUFFERED = 3

#: Exposure time of the colour heads; nothing is blurred by motion.
EXPOSURE = ControlInfo("exposure_s", ControlKind.NUMBER, "s", 0.0005, 0.03)

#: A device without a fault.
NO_FAULT = FaultSchedule()


class SimulatedDevice:
    """Delivers exposure after exposure in real time.

    Up to `BUFFERED` overdue exposures are delivered late, as from the buffers of a real camera. If more are overdue,
    all of them are skipped, with their sequence numbers, and counted as `late`. Nothing else is dropped, except by an
    injected fault.

    Args:
        uri: the address that describes the simulation.
        simulation: scene and heads.
        clock: CLOCK_MONOTONIC [ns].
        wait: waiting function, replaced in tests.
        fault_schedule: injected fault.
    """

    def __init__(
        self,
        uri: str,
        simulation: Simulation,
        clock: Callable[[], int],
        wait: Wait = threading.Event.wait,
        fault_schedule: FaultSchedule = NO_FAULT,
    ) -> None:
        self.info = DeviceInfo(uri=uri, model="simulated", serial=f"seed {simulation.seed}")
        streams = (stream for head in simulation.heads.values() for stream in head.streams)
        shown = tuple(replace(stream, noisy=simulation.noisy) for stream in streams)
        self._color_s = NOMINAL_S
        self.controls = Controls(self._controls(shown))
        self.capabilities = Capabilities(shown, self.controls.infos)
        self.cameras: Mapping[str, Camera] = {name: head.camera for name, head in simulation.heads.items()}
        self._simulation = simulation
        self._clock = clock
        self._wait = wait
        self._fault_schedule = fault_schedule
        self._gate = FrameGate(self.capabilities.streams, causes=["late", "lost"])
        self._thread = threading.Thread()

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, overdue exposures skipped (`late`), and frames `lost` by an injected fault."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Empty: the clock is the host's."""
        return {}

    def start(self, sink: Sink) -> None:
        """Restarts at exposure 0, in a new epoch; no effect while it is running.

        Raises:
            DeviceError: the device was closed.
        """
        if stop := self._gate.begin(sink, "preparing the simulation"):
            self._thread = threading.Thread(
                target=self._gate.guard, args=(self._run, stop), name="simulated", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        """Stops delivery; the sink is not called after it returns."""
        self._gate.end("stopped")
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stops; there are no resources to release."""
        self._gate.release()
        self.stop()

    def _controls(self, streams: Iterable[StreamInfo]) -> Iterator[Control]:
        """The exposure time of the colour heads, if there are some."""

        def write(value: Value) -> None:
            self._color_s = float(value)

        if any(stream.kind in (Kind.COLOR, Kind.BAYER) for stream in streams):
            yield Control(EXPOSURE, lambda: self._color_s, write)

    def _run(self, stop: threading.Event) -> None:
        self._simulation.frames(0)  # compiles the kernels, which would delay the first exposures
        self._gate.report_state(DeviceState.STREAMING, "simulated exposures follow")
        self._stream(stop, self._gate.epoch)

    def _stream(self, stop: threading.Event, epoch: int) -> None:
        first_ns = self._clock()
        period_ns = self._simulation.time_ns(1)
        k = 0
        while True:
            behind = (self._clock() - first_ns - self._simulation.time_ns(k)) // period_ns
            if behind > BUFFERED:
                self._gate.drop("late", behind)
                k += behind
            frames, truths = self._frames(k), self._simulation.truths(k)
            if self._wait(stop, max(first_ns + self._simulation.time_ns(k) - self._clock(), 0) * 1e-9):
                return
            match fault := self._fault_schedule.at(k):
                case Fault.STALL:
                    stop.wait()
                    return
                case Fault.UNPLUG:
                    self._gate.report_state(DeviceState.FAILED, "unplugged, as the address says")
                    return
                case Fault.DROP:
                    self._gate.drop("lost", len(frames))
                case _:
                    self._deliver([corrupted(frame, fault) for frame in frames], truths, first_ns, epoch)
            if stop.is_set():
                return
            k += 1

    def _frames(self, k: int) -> list[Frame]:
        shown = self._fault_schedule.shown(k)
        late_ns = self._simulation.time_ns(k) - self._simulation.time_ns(shown)
        return [
            replace(frame, seq=k, t_host_ns=frame.t_host_ns + late_ns, t_device_ticks=frame.t_device_ticks + late_ns)
            for frame in self._simulation.frames(shown, self._color_s)
        ]

    def _deliver(self, frames: list[Frame], truths: list[Truth], first_ns: int, epoch: int) -> None:
        for truth in truths:
            self._gate.deliver_truth(replace(truth, t_host_ns=first_ns + truth.t_host_ns))
        for frame in frames:
            t_host_ns, t_arrival_ns = first_ns + frame.t_host_ns, self._clock()
            self._gate.deliver(replace(frame, t_host_ns=t_host_ns, t_arrival_ns=t_arrival_ns, epoch=epoch))
