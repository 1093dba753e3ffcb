"""A process that does nothing until it is asked to end."""

from abs_service.supervision.children.child_process import ThreadTimes


class Idle:
    """A `Process` that does nothing; appends its name to `ended` when it is asked to end.

    Attributes:
        woken: how often it was woken.
    """

    def __init__(self, component: str = "", ended: list[str] | None = None):
        self._component, self._ended = component, [] if ended is None else ended
        self._code: int | None = None
        self.woken = 0

    @property
    def pid(self) -> int:
        return 4711

    def poll(self) -> int | None:
        return self._code

    def threads(self) -> dict[int, ThreadTimes]:
        return {}

    def terminate(self) -> None:
        self._ended.append(self._component)
        self._code = 0

    def kill(self) -> None:
        if self._code is None:
            self.terminate()

    def wake(self) -> None:
        self.woken += 1

    def output_tail(self) -> str:
        return ""
