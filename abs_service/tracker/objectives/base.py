"""Interface of an objective, and the sum of all terms."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import ObservedTerm, Prediction, Term
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.places.keypoints import Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.sensor_fit import SensorFit


class Objective(Protocol):
    """Compares deformed meshes with observations, one after the other."""

    def observe(self, observation: Observation, predicted: Surface, reach_m: float = np.inf) -> "ObservedObjective":
        """The cost of deformed meshes given an observation.

        Args:
            observation: the measurements.
            predicted: the predicted mesh, a population of one.
            reach_m: radius around the prediction outside which costs need not be exact, only high [m].
        """
        ...


class ObservedObjective(Protocol):
    """A cost over deformed meshes, given one observation; asked until the next one is observed."""

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh; lower explains the measurements better."""
        ...

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of a population of one, and their derivatives, see `ObservedTerm.linearize`."""
        ...

    def fits(self, surface: Surface) -> list[SensorFit]:
        """Agreement of every contributing sensor with a population of one."""
        ...

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> list[PointLinearization]:
        """Residuals of the places in the images where the appearance of a population of one is (`ObservedTerm`)."""
        ...

    @property
    def recognized(self) -> list[Recognized]:
        """Keypoints of the appearance that are recognised in the images that have any (`ObservedTerm`)."""
        ...

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurements, and its deviation by noise (2, n) [m]."""
        ...

    def learn(self, surface: Surface) -> None:
        """Takes the estimate in, a population of one: later observations may be compared otherwise."""
        ...

    def of_distances(self) -> "ObservedObjective":
        """The same without the sensors that measure an appearance."""
        ...


class Feedback(Protocol):
    """Information of an estimate on the sensors."""

    def fits(self, terms: Sequence[ObservedTerm], surface: Surface) -> list[SensorFit]:
        """Agreement of the sensor of every term with a population of one."""
        ...

    def learn(self, terms: Sequence[ObservedTerm], surface: Surface) -> None:
        """Takes the estimate in, a population of one."""
        ...


class NoiseFeedback:
    """Feedback to noise models: residuals tell whether they are right, and what to correct."""

    def fits(self, terms: Sequence[ObservedTerm], surface: Surface) -> list[SensorFit]:
        """The agreement as every term has it."""
        return [term.fit(surface) for term in terms]

    def learn(self, terms: Sequence[ObservedTerm], surface: Surface) -> None:
        """Passes the estimate to every term."""
        for term in terms:
            term.learn(surface)


_OF_NOISE = NoiseFeedback()


class TermSum:
    """The sum of all sensors' terms (eq. 16); a sensor without a frame contributes zero."""

    def __init__(self, synthesizer: Synthesizer, terms: Sequence[Term], feedback: Feedback = _OF_NOISE):
        self._synthesizer = synthesizer
        self._terms = terms
        self._feedback = feedback
        self._frames = 0

    def observe(self, observation: Observation, predicted: Surface, reach_m: float = np.inf) -> "ObservedTerms":
        """Passes every sensor's image to its term; occluders that some of them find hide the mesh from the others."""
        prediction = Prediction(predicted, reach_m, resampling=self._synthesizer.observe(observation))
        terms = [term for term in self._terms if term.sensor in observation.images]
        observed: dict[str, ObservedTerm] = {}
        for term in sorted(terms, key=lambda term: not term.finds_occluders):
            found = observed[term.sensor] = term.observe(observation.images[term.sensor], prediction)
            prediction = replace(prediction, occluders=np.concatenate([prediction.occluders, found.occluders]))
        self._frames = frame = self._frames + 1
        distances = [observed[term.sensor] for term in terms if term.finds_occluders]
        everything = [observed[term.sensor] for term in terms]
        return ObservedTerms(everything, distances, self._feedback, lambda: self._frames == frame)


class ObservedTerms:
    """The sum of the terms of the sensors that contribute to one frame.

    Args:
        terms: one of every sensor.
        distances: those among them of the sensors that measure distances.
        feedback: information of an estimate on the sensors.
        is_newest: False once a sensor's next image was observed, which uses the same memory.
    """

    def __init__(
        self,
        terms: Sequence[ObservedTerm],
        distances: Sequence[ObservedTerm],
        feedback: Feedback,
        is_newest: Callable[[], bool],
    ):
        self._observed = terms
        self._distances = distances
        self._feedback = feedback
        self._is_newest = is_newest

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        if not self._terms:
            return np.zeros(len(surface.vertices))
        return reduce(np.add, (term.cost(surface) for term in self._terms))

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of all sensors and their derivatives."""
        return [part for term in self._terms for part in term.linearize(surface, sparse_jacobian)]

    def fits(self, surface: Surface) -> list[SensorFit]:
        """Agreement of every contributing sensor with a population of one."""
        return self._feedback.fits(self._terms, surface)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> list[PointLinearization]:
        """Residuals of the places in the images where the appearance is, of all sensors."""
        return [term.match(surface, sparse_jacobian, patches) for term in self._terms]

    @property
    def recognized(self) -> list[Recognized]:
        """Keypoints that are recognised in the images of all sensors that have any."""
        return [found for term in self._terms if len((found := term.recognized).seen)]

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurements, the largest, and its deviation by noise (2, n) [m]."""
        none = np.zeros((2, surface.vertices.shape[2]))
        return reduce(_larger, (term.misfit(surface) for term in self._terms), none)

    def learn(self, surface: Surface) -> None:
        """Takes the estimate in, a population of one."""
        self._feedback.learn(self._terms, surface)

    def of_distances(self) -> "ObservedTerms":
        """The sum of those of the sensors that measure distances."""
        return ObservedTerms(self._distances, self._distances, self._feedback, self._is_newest)

    @property
    def _terms(self) -> Sequence[ObservedTerm]:
        if not self._is_newest():
            raise RuntimeError("the cost of a frame is asked after the next frame was observed")
        return self._observed


def _larger(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.abs(one[0]) >= np.abs(other[0]), one, other)
