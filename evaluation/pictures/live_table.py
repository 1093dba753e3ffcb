"""The picture of the live table in the first tutorial, taken from a real run of the demo rig.

python -m evaluation.pictures.live_table docs/images/table.svg
"""

import argparse
import io
import tempfile
from pathlib import Path
from unittest import mock

from rich.console import Console
from rich.text import Text

from abs_service.commands import run
from abs_service.commands.parts.log import logs
from abs_service.display.terminal import choice
from abs_service.display.terminal.output import Output
from abs_service.display.terminal.table import TableDisplay, draw
from abs_service.supervision.health.rig_view import RigView

#: Length of the run [s].
DURATION_S = 15


class _LastTable(TableDisplay):
    """Keeps the last table that was drawn while everything ran."""

    def __init__(self) -> None:
        nowhere = io.StringIO()
        super().__init__(Console(file=nowhere, force_terminal=True, width=108, height=40), Output(nowhere.write))
        self._recorder = Console(file=io.StringIO(), record=True, width=108)

    def update(self, view: RigView) -> None:
        if view.elapsed_s > DURATION_S - 1 and not self._recorder.export_text(clear=False):
            self._recorder.print(draw(view, Text("")))

    def save(self, path: Path) -> None:
        self._recorder.save_svg(str(path), title="abs-service run")


def main() -> None:
    """Runs the demo rig for some seconds and saves its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    picture = parser.parse_args().picture
    display = _LastTable()
    options = argparse.ArgumentParser()
    run.add_arguments(options)
    logs.add_arguments(options)
    with tempfile.TemporaryDirectory() as folder, mock.patch.object(choice, "shown", return_value=display):
        run.run(options.parse_args(["--duration", str(DURATION_S), "--out", folder]))
    display.save(picture)


if __name__ == "__main__":
    main()
