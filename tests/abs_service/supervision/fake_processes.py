"""Time and processes of a supervisor, under the control of a test."""

import signal

from abs_service.supervision.children.child import Child
from abs_service.supervision.limits import Limits
from abs_service.supervision.supervisor import Supervisor

S = 1_000_000_000


class FakeProcess:
    """A process that ends when the test says so.

    It obeys SIGTERM, unless it is stubborn or takes its time; a second one ends it on the spot, as every real one.
    """

    def __init__(self, world, component, pid):
        self.world, self.component, self.pid = world, component, pid
        self.code = None
        self.is_asked_to_end = False
        self.its_threads = {}

    def threads(self):
        return self.its_threads

    def poll(self):
        return self.code

    def terminate(self):
        self.world.events.append(("terminate", self.component))
        if self.is_asked_to_end and self.code is None:
            self.code = 128 + signal.SIGTERM
        elif self.component not in self.world.stubborn:
            self.code = 0
        self.is_asked_to_end = True

    def kill(self):
        if self.code is None:
            self.world.events.append(("kill", self.component))
            self.code = -9

    def wake(self):
        pass

    def output_tail(self):
        return self.world.words


class World:
    """Time, and every process that was ever started; none is while the host has a lack."""

    def __init__(self):
        self.now_ns = 0
        self.events = []
        self.started = []
        self.stubborn = set()
        self.words = ""
        self.lack: OSError | None = None

    def spawn(self, component, arguments):
        if self.lack is not None:
            raise self.lack
        self.started.append(FakeProcess(self, component, len(self.started) + 1))
        return self.started[-1]

    def wait(self, seconds):
        self.now_ns += int(seconds * 1e9)

    def latest(self, component):
        return [process for process in self.started if process.component == component][-1]

    def supervisor(self, *components, **limits):
        children = [Child(component, (component,), stage) for stage, component in enumerate(components)]
        made = Supervisor(children, self.spawn, lambda: self.now_ns, Limits(**limits))
        made.poll()
        return made


def ends(world, supervisor, component, code):
    """The process ends with this code, and its pause passes."""
    world.latest(component).code = code
    supervisor.poll()
    world.now_ns += 4 * S
    supervisor.poll()


def passes(world, supervisor, seconds):
    """Advances the clock, in steps in which the supervisor works."""
    for _ in range(2 * seconds):
        world.now_ns += S // 2
        supervisor.poll()
