"""Controls of a recording on the page: time, play, pause, step, speed."""

from collections.abc import Callable
from queue import Empty, SimpleQueue

import viser

from abs_service.display.page.playback import Playback

#: Speeds to choose from.
SPEEDS: list[str] = [f"{speed} ×" for speed in ("0.1", "0.25", "0.5", "1", "2", "5")]

#: The slider follows the recording in steps of this [s].
FOLLOWED_S = 0.1

#: Place of the controls among those of the page: below the status.
ORDER = 0.5


class Player:
    """The controls; what they ask for is done in `tick`, in the thread of the page."""

    def __init__(self, gui: viser.GuiApi, playback: Playback) -> None:
        self._playback = playback
        self._requests: SimpleQueue[Callable[[], None]] = SimpleQueue()
        with gui.add_folder("Recording", order=ORDER):
            longest_s = max(round(playback.duration_s, 2), 0.01)
            self._time = gui.add_slider("Time [s]", 0.0, longest_s, 0.01, 0.0)
            self._play = gui.add_button("Pause")
            step = gui.add_button_group("Step", ("Back", "Forward"), hint="To the estimate before or after this one")
            speed = gui.add_dropdown("Speed", SPEEDS, initial_value=SPEEDS[3])
        self._time.on_update(self._moved)
        self._play.on_click(lambda _: self._requests.put(self._toggle))
        step.on_click(lambda event: self._ask_step(event.target.value == "Forward"))
        speed.on_update(lambda event: self._ask_speed(float(event.target.value.split()[0])))

    def tick(self) -> None:
        """Carries out requests of the page, and delivers the messages of the present time."""
        while True:
            try:
                self._requests.get_nowait()()
            except Empty:
                break
        self._playback.advance()
        label, position_s = "Pause" if self._playback.playing else "Play", round(self._playback.position_s, 2)
        if self._play.label != label:
            self._play.label = label
        near = abs(self._time.value - position_s) < (FOLLOWED_S if self._playback.playing else 0.005)
        if not near:
            self._time.value = position_s

    def _moved(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        if event.client is not None:  # not by `tick`
            position_s = event.target.value
            self._requests.put(lambda: self._playback.jump(position_s))

    def _toggle(self) -> None:
        if self._playback.playing:
            self._playback.playing = False
        else:
            self._playback.play()

    def _ask_step(self, forward: bool) -> None:
        self._requests.put(lambda: self._playback.step(forward))

    def _ask_speed(self, speed: float) -> None:
        def change() -> None:
            self._playback.speed = speed

        self._requests.put(change)
