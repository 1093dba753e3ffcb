"""Shares of a mesh that agree with what all sensors together show of it."""

import math
from collections.abc import Sequence

from abs_service.tracker.terms.sensor_fit import MIN_RIM, RimFit, SensorFit
from abs_service.tracker.terms.vertex_counts import VertexCounts

#: Minimum number of vertices that agree or disagree with a sensor, or should, for their share to be judged.
MIN_JUDGED = 20

#: A vertex beside its place has a colour that agrees by chance, every third one on a print. So half of a mesh may be
#: elsewhere if fewer than this share of a sensor's colours agree …
MIN_COLORS = 2 / 3
#: … and more than this share of the distances disagree: those stay as they were when a lamp goes out. Without a free
#: edge in sight, distances do not tell.
UNLIT_DISTANCES = 0.05

#: An image shows where a surface is if more than this share of the vertices that it shows agrees.
NEARLY_ALL = 0.9


def inlier_share(fits: Sequence[SensorFit]) -> float:
    """Share of the vertices visible to any sensor that agree with their measurement; 0 if none is visible."""
    visible = sum(fit.visible for fit in fits)
    return sum(fit.inliers for fit in fits) / visible if visible else 0.0


def outlier_share(fits: Sequence[SensorFit]) -> float:
    """Share of the vertices visible to any sensor that do not agree with their measurement; 1 if none is visible."""
    return 1 - inlier_share(fits)


def occluded_share(fits: Sequence[SensorFit]) -> float:
    """Share of occluded vertices in the sensor with the smallest such share; 0 without a sensor.

    Light barriers are ignored: their single sample is no vertex.
    """
    shares = [fit.occluded / (fit.occluded + fit.visible) for fit in fits if fit.occluded + fit.visible > 1]
    return min(shares, default=0.0)


def most_agreeing(fits: Sequence[SensorFit]) -> VertexCounts:
    """Counts of the sensor in which the largest share of what should be in sight agrees; zeros without any."""
    counts = (fit.counts for fit in fits if fit.counts.expected)
    return max(counts, key=lambda one: one.agreeing / one.expected, default=VertexCounts())


def outside_share(fits: Sequence[SensorFit]) -> float:
    """Share outside the depth image of what should be in sight; the smallest of the sensors of distances, 0 without.

    Within a hole of an image the surface around it holds a vertex, and its colour. Beyond the border nothing is around
    it, and a colour says where it is across the line of sight at best; on a plain surface not even that.
    """
    counts = (fit.counts for fit in of_distances(fits) if fit.counts.expected >= MIN_JUDGED)
    return min((one.outside / one.expected for one in counts), default=0.0)


def has_left(fits: Sequence[SensorFit], share: float) -> bool:
    """True if the depth sensors cannot see more than a share, hardly a distance agrees, and less than it in any sensor.

    They cannot see what is outside their images or turned away from them. Colours of the few vertices that a wider
    camera still sees would hold a mesh beside the images for good.
    """
    depths = [fit.counts for fit in of_distances(fits)]
    unseen = [(one.outside + one.turned_away) / max(one.expected + one.turned_away, 1) for one in depths]
    agreeing = [fit.counts.agreeing / max(fit.counts.expected + fit.counts.turned_away, 1) for fit in fits]
    few = sum(one.agreeing for one in depths) < MIN_JUDGED
    return min(unseen, default=0.0) > share and few and max(agreeing) < share


def turned_away_share(fits: Sequence[SensorFit]) -> float:
    """Share of all vertices that do not face it; the smallest of the sensors of distances, 0 without."""
    counts = [fit.counts for fit in of_distances(fits)]
    shares = [one.turned_away / (one.facing + one.turned_away) for one in counts if one.facing + one.turned_away]
    return min(shares, default=0.0)


def distances_share(fits: Sequence[SensorFit]) -> float:
    """Share of the distances that agree; the largest of the sensors that measure half of what they could, 1 without.

    A sensor could measure what faces it inside its image and is not behind the object itself.
    """
    counts = [fit.counts for fit in of_distances(fits)]
    inside = [one.facing - one.behind_itself - one.outside for one in counts]
    seen = [(one.agreeing, one.agreeing + one.disagreeing, whole) for one, whole in zip(counts, inside)]
    return max((good / known for good, known, whole in seen if known >= max(MIN_JUDGED, whole / 2)), default=1.0)


def image_agrees(fits: Sequence[SensorFit]) -> bool:
    """True if nearly all vertices that an image of the appearance shows agree with it."""
    images = [fit for fit in _of_appearance(fits) if _judged(fit) >= MIN_JUDGED]
    return any(fit.counts.agreeing > NEARLY_ALL * _judged(fit) for fit in images)


def disagreeing_colors(fits: Sequence[SensorFit]) -> int:
    """Number of vertices whose appearance is not that of an image; the largest of such sensors, 0 without."""
    return max((fit.counts.disagreeing for fit in _of_appearance(fits)), default=0)


def shows_other_colors(fits: Sequence[SensorFit]) -> bool:
    """True if an image of the appearance disagrees with most of the vertices that it shows."""
    images = [fit for fit in _of_appearance(fits) if _judged(fit) >= MIN_JUDGED]
    return any(2 * fit.counts.disagreeing > _judged(fit) for fit in images)


def contradicting(fits: Sequence[SensorFit]) -> list[tuple[str, str, float]]:
    """Name, kind of measurement and agreeing share of every sensor that contradicts the mesh.

    Most of its distances disagree, or a third of its colours: together with some distances, or if no free edge tells
    whether the surface is where it was. On a table, its distances agree wherever it is.
    """
    distances = of_distances(fits)
    moved = any(fit.counts.disagreeing > UNLIT_DISTANCES * _judged(fit) or not rims(fits) for fit in distances)
    result = []
    for fit in fits:
        what, minimum = ("distances", 1 / 2) if fit in distances else ("colours", MIN_COLORS if moved else 0.0)
        if _judged(fit) >= MIN_JUDGED and fit.counts.agreeing < minimum * _judged(fit):
            result.append((fit.sensor, what, fit.counts.agreeing / _judged(fit)))
    return result


def _judged(fit: SensorFit) -> int:
    """Number of vertices that agree with a measurement or do not."""
    return fit.counts.agreeing + fit.counts.disagreeing


def of_distances(fits: Sequence[SensorFit]) -> list[SensorFit]:
    """The sensors of distances among them."""
    return [fit for fit in fits if fit.is_surprised or math.isfinite(fit.remainder.at_first)]


def _of_appearance(fits: Sequence[SensorFit]) -> list[SensorFit]:
    """The other sensors among them."""
    distances = of_distances(fits)
    return [fit for fit in fits if fit not in distances]


def unexplained_share(fits: Sequence[SensorFit]) -> float:
    """Surface beside the mesh that was not there at first, see `Remainder`; the smallest of the sensors, 0 without.

    Where the object comes into sight beyond an edge that something hid at first, the mesh is right as far as it goes.
    """
    shares = [fit.remainder.gained for fit in fits if math.isfinite(fit.remainder.share) and not fit.rim.uncovered]
    return min(shares, default=0.0)


def rim_share(fits: Sequence[SensorFit]) -> float:
    """Share of the visible vertices on free edges that lie off the outline; the smallest of the sensors, 0 without."""
    shares = [(rim.outside + rim.inside) / rim.visible for rim in rims(fits)]
    return min(shares, default=0.0)


def rim_distance(fits: Sequence[SensorFit]) -> float:
    """Distance [m] of the visible free edges from the outline, see `RimFit.off_m`; the smallest of the sensors."""
    return min((rim.off_m for rim in rims(fits)), default=0.0)


def rims(fits: Sequence[SensorFit]) -> list[RimFit]:
    """Agreement of the edges with the outline, of the sensors in which enough are visible."""
    return [fit.rim for fit in fits if fit.rim.visible >= MIN_RIM]


def hangs_over(fits: Sequence[SensorFit]) -> bool:
    """True if a mesh off its outline hangs over it: one that slides does so on the side that it slides to."""
    return any(4 * rim.outside >= rim.inside for rim in rims(fits))


def shows_slide(fits: Sequence[SensorFit]) -> bool:
    """True if what is off the outline shows that the mesh has slid or turned, although images hold it.

    A slide lays some edges inside the object and others beside it, over what is no object in images either. Nearly all
    end inside where something lies against them, and nearly all lie in areas that a sensor has lost.
    """
    return hangs_over(fits) and not (_lies_over_loss(fits) and _is_seen_in_loss(fits))


def _lies_over_loss(fits: Sequence[SensorFit]) -> bool:
    """True if nearly all edges off the outline lie in areas that the sensor has lost."""
    return all(4 * (rim.inside + rim.outside - rim.lost) < rim.lost for rim in rims(fits))


def _is_seen_in_loss(fits: Sequence[SensorFit]) -> bool:
    """True if most vertices whose distances disagree have the right colour: beside its object, a mesh lacks both."""
    distances = of_distances(fits)
    lost, other = ([fit.counts.disagreeing for fit in fits if (fit in distances) == is_one] for is_one in (True, False))
    return 2 * max(other, default=0) < min(lost, default=0)
