"""The state of a rig in plain words: status, reason, age, and the remedy."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from abs_service.display.sentences import sentences

#: Data older than this is stale [s]; a tracker below this share of its camera's rate is slow.
STALE_S, SLOW_SHARE = 1.0, 0.8

#: A status in words, its colour, and what to do about it.
STATUS = {
    "INITIALIZING": ("Looking for the object", "#3b82f6", "Put the object where its region selects it."),
    "TRACKING": ("Tracking", "#16a34a", ""),
    "DEGRADED": ("Tracking with doubts", "#d97706", "Use the estimate with care."),
    "LOST": ("Object lost", "#dc2626", "Bring the object back into view, or press Reinitialise."),
}

STALE_COLOR, STARTING = "#6b7280", STATUS["INITIALIZING"][1]


@dataclass(frozen=True, slots=True)
class StatusLine:
    """A line about a tracker or a rig: title, reasons and remedy, and its colour."""

    title: str
    text: str
    color: str


def age(seconds: float) -> str:
    """An age for people: 0.4 s, 12 s, 3 min."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def stream(name: str, age_s: float, rate_hz: float) -> str:
    """Title of an image: its stream, and its age if it is stale [s], else its rate [1/s] if that is known, not 0."""
    if age_s > STALE_S:
        return f"{name}, {age(age_s)} old"
    return f"{name}, {rate_hz:.1f} Hz" if rate_hz else name


def preparing(kernels: str) -> StatusLine:
    """A tracker that compiles its kernels, with the progress of that, or loads them."""
    if not kernels:
        return StatusLine("Loading kernels", "The first start on a computer compiles them, once.", STARTING)
    text = f"{kernels[:1].upper()}{kernels[1:]}. Once on each computer; tracking begins by itself."
    return StatusLine("Compiling kernels for this rig", text, STARTING)


def tracker(
    status: str, reasons: Sequence[str], warnings: Sequence[str], age_s: float, sigma_mm: float, slow: str = ""
) -> StatusLine:
    """A tracker's state.

    Args:
        status: as in messages, without prefix; "" before the first estimate.
        reasons, warnings: of its last estimate.
        age_s: since that came [s].
        sigma_mm: median deviation of its vertices [mm]; NaN if unknown.
        slow: warning of `slow`; the first reason, since a tracker that misses images gets into all other trouble.
    """
    if not status:
        return StatusLine(
            "No estimate yet", "The first one is still to come; if none does, the sensors deliver nothing.", STALE_COLOR
        )
    title, color, remedy = STATUS.get(status, (status.title(), STALE_COLOR, ""))
    if age_s > STALE_S:
        text = f"The last estimate said: {title.lower()}. Check that the tracker runs and its sensors deliver."
        return StatusLine(f"No estimate for {age(age_s)}", text, STALE_COLOR)
    precise = f", σ {sigma_mm:.2f} mm" if status in ("TRACKING", "DEGRADED") and math.isfinite(sigma_mm) else ""
    text = sentences((slow, *reasons, *warnings))
    color = STATUS["DEGRADED"][1] if slow and status == "TRACKING" else color
    return StatusLine(title + precise, f"{text} {remedy}".strip(". "), color)


def slow(rate_hz: float, camera_hz: float, skipped: int) -> str:
    """Warning that a tracker is slower than its camera; "" if it is not.

    Args:
        rate_hz: of its estimates.
        camera_hz: of the images of its reference; 0 if unknown.
        skipped: frame sets that it passed over in the last minute; without any, it waits for images.
    """
    if not skipped or camera_hz <= 0 or rate_hz >= SLOW_SHARE * camera_hz:
        return ""
    return (
        f"Only {rate_hz:.0f} estimates a second of {camera_hz:.0f} images: the tracker is slow, "
        "or gets too little processor time. Close other programs, or choose fewer vertices"
    )


def silence(age_s: float, remedy: str) -> StatusLine | None:
    """Silence of the whole rig: its duration and advice; None while the rig publishes."""
    if age_s <= 3 * STALE_S:
        return None
    since = "yet" if age_s == float("inf") else f"for {age(age_s)}"
    return StatusLine(f"Nothing received from the rig {since}", remedy, STALE_COLOR)
