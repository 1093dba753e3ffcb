"""The health of one component in words: rates, phase, file."""

from absmsg.v1.health_pb2 import Health

from abs_service.supervision.health.rig_view import dropped, size


def words(component: str, health: Health) -> str:
    """Activity of a component as text; "" if its health holds none."""
    kind = component.partition("/")[0]
    parts = {"capture": _capture, "track": _track, "record": _record}.get(kind, _run)(health)
    return ", ".join(part for part in parts if part)


def _capture(health: Health) -> list[str]:
    rates = [
        (name.removeprefix("rate_hz.").removesuffix("/image"), rate)
        for name, rate in health.gauges.items()
        if name.startswith("rate_hz.")
    ]
    missed = dropped(health.counters)
    return [*(f"{stream} {rate:.1f} Hz" for stream, rate in sorted(rates)), f"{missed} dropped" if missed else ""]


def _track(health: Health) -> list[str]:
    solve_ms = health.gauges.get("solve_ms")
    kernels = health.labels.get("kernels")
    return [
        health.labels.get("phase", ""),
        f"kernels {kernels}" if kernels else "",
        f"{health.counters['estimates']} estimates" if "estimates" in health.counters else "",
        "" if solve_ms is None else f"{solve_ms:.1f} ms each",
    ]


def _record(health: Health) -> list[str]:
    file = health.labels.get("file", "").removesuffix(".active")
    missed = dropped(health.counters)
    return [
        file,
        size(health.gauges["file_bytes"]) if file and "file_bytes" in health.gauges else "",
        f"{size(health.gauges['free_bytes'])} free" if "free_bytes" in health.gauges else "",
        f"{missed} dropped" if missed else "",
        health.labels.get("tracking", ""),
        health.labels.get("trigger", ""),
    ]


def _run(health: Health) -> list[str]:
    return [
        f"{name.removeprefix('restarts.')} restarted {number}×"
        for name, number in sorted(health.counters.items())
        if name.startswith("restarts.") and number
    ]
