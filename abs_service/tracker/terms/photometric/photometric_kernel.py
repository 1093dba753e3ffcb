"""From a candidate's surface to what its looks cost, for sensors that compare looks."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.fused_cost import Step
from abs_service.tracker.synthesis import centers, sampling
from abs_service.tracker.synthesis.base import Sight
from abs_service.tracker.terms.photometric.illumination import AS_IT_IS, as_it_is
from calib.jit import composed, kernel


def judging(sight: Sight, cost: Callable[..., None], measured: tuple[Any, ...], light: Step = AS_IT_IS) -> Step:
    """A judging step: what is seen, in this light, is compared with what was measured.

    Args:
        sight: how it is seen.
        cost: a kernel that takes pixels (population, n), attributes (population, n, channels), what was measured, and
            an array for its results (population,).
        measured: what it takes.
        light: from attributes, vertices and normals of a candidate to how the attributes look.
    """
    seeing, looking = sight
    parts = {"see": seeing.kernel, "look": looking.kernel, "shine": light.kernel, "compare": cost}
    first, second, third = len(seeing.arguments), len(looking.arguments), len(light.arguments)
    kernel = composed(_judge, **parts, SEEN=first, LOOKED=first + second, LIT=first + second + third)
    return Step(kernel, seeing.arguments + looking.arguments + light.arguments + measured)


#: What `judging` puts others in the place of.
see: Callable[..., Any] = sampling.see
look: Callable[..., Any] = centers.constant
shine: Callable[..., Any] = as_it_is

#: Where the arguments of `see`, `look` and `shine` end.
SEEN, LOOKED, LIT = 0, 0, 0


@kernel
def _nothing(pixel: NDArray[np.int32], attributes: NDArray[np.float32], out: NDArray[np.float64]) -> None:
    """Costs nothing, where there is nothing to compare with."""
    out[:] = 0


compare: Callable[..., Any] = _nothing


@kernel
def _judge(
    thetas: NDArray[np.float64], vertices: NDArray[np.float32], normals: NDArray[np.float32], *arguments: Any
) -> float:
    """See `judging`."""
    pixel, _ = see(vertices, normals, *arguments[:SEEN])
    attributes = shine(look(vertices, pixel, *arguments[SEEN:LOOKED]), vertices, normals, *arguments[LOOKED:LIT])
    out = np.empty(1)
    compare(pixel, attributes, *arguments[LIT:], out)
    return out[0]
