"""Imports what the processes of a rig have in common, in the fork server."""

from contextlib import suppress
from importlib import import_module

from abs_service.supervision.children import forked

#: Beside what the demo rig names: its model, search and objective are the default ones.
MODULES = (
    "abs_service.cli",
    "abs_service.commands.parts.log.logs",
    "abs_service.commands.processes.capture",
    "abs_service.commands.processes.record",
    "abs_service.commands.processes.track",
    *(
        f"abs_service.tracker.measurements.{kind}"
        for kind in ("bayer", "binary", "color", "depth", "grey", "intensity")
    ),
    "scipy.sparse.csgraph",
)

forked.detach()
with suppress(Exception):  # which the process that needs the module will meet, and tell
    for name in MODULES:
        import_module(name)
    import_module("calib.jit").load_compiler()
    import_module("abs_service.config").load_default()
