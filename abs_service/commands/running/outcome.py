"""Outcome of a run or a replay for its exit code: a recorder that lacks something, trackers that never tracked."""

from collections.abc import Mapping

from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.health.rig_view import RigView
from abs_service.tracking.log.tracker_log import TrackerLog


def code(view: RigView, is_stopped: bool) -> Exit:
    """FAILED if the recording lacks something, or if the rig ended by itself and nothing was tracked.

    A user who stops a rig before it has found its object has not failed: systemd would start it again.
    """
    failed = not is_stopped and untracked(view.live.trackers)
    return Exit.FAILED if failed else recording_code(view)


def recording_code(view: RigView) -> Exit:
    """FAILED if a recorder has reported losses or a failure, whatever else went well."""
    worst = any(child.component == "record" and child.worst_code for child in view.children)
    return Exit.FAILED if worst or view.live.counters("record")["failures"] else Exit.OK


def untracked(trackers: Mapping[str, TrackerLog]) -> list[str]:
    """Names of the trackers none of whose estimates was of use."""
    return [name for name, log in trackers.items() if not log.has_tracked]
