"""Verdicts on the recordings of a noise calibration: what moved, and distances that cannot be those of the targets."""

from abs_service.calibration.noise.measurement import NoiseCalibration
from abs_service.report.content import Level, Verdict
from calib.sequences.reference import Kind

#: Fraction of moving pixels that triggers a warning.
_MOVING = 0.3

#: Deviation by which all pixels change together, in those of a pixel; it adds 4 % to σ.
_TOGETHER = 0.3

#: Largest offset of a sensor, in parts of the distance; beyond it the target may have been elsewhere.
_OFFSET = 0.03


def distances(found: NoiseCalibration) -> list[Verdict]:
    """Distances that were given for a target, and that no sensor measures so wrongly."""
    if found.kind is not Kind.KNOWN:
        return []
    return [
        Verdict(
            Level.DOUBTFUL,
            f"Its distances are {abs(off):.1%} {'longer' if off > 0 else 'shorter'} than --distance-m says.",
            "Measure the distance of this target again, and see whether the unit of the images is right.",
            name,
        )
        for name, row in found.rows
        if abs(off := row.offset / row.distance) > _OFFSET
    ]


def motion(found: NoiseCalibration) -> list[Verdict]:
    """Sequences in which pixels moved: many of them, or all together."""
    said = []
    for static in found.statics:
        if static.moving > _MOVING:
            text = f"{static.moving:.0%} of the pixels moved and were left out."
            said.append(Verdict(Level.DOUBTFUL, text, "Look at the map of what was taken as static.", static.name))
        if (together := static.common) > _TOGETHER:
            text = f"From image to image all pixels change together, by {together:.2g} times what one scatters by."
            advice = (
                "Fasten the sensor and its target, and let the sensor warm up: σ and μ are those of things at rest."
            )
            said.append(Verdict(Level.DOUBTFUL, text, advice, static.name))
    return said
