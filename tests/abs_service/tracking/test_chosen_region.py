"""A region that is chosen while a session runs: used at once and from then on, if it shows an object."""

import dataclasses

import numpy as np

from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.optimizers import cma
from abs_service.tracking.session import TrackingSession
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

SHEET = simulate("simulated://sheet?seed=1")


class Region:
    """The nearest surface, or nothing; counts how often it was asked. It is its own settings."""

    def __init__(self, finds=True):
        self.finds, self.asked = finds, 0
        self._region = nearest.Settings().build()

    def build(self):
        return self

    def select(self, view):
        self.asked += 1
        if not self.finds:
            raise DetectionError("nothing is there")
        return self._region.select(view)


def session(region):
    return TrackingSession(rig_of(SHEET), default_plan(region=region, optimizer=cma.Settings(generations=2)))


def track(tracking, exposures, change=lambda k, frames: frames):
    return [step.estimate for step in drive(tracking, SHEET, exposures, change)]


def test_where_the_rig_file_finds_nothing_the_chosen_region_begins():
    tracking, chosen = session(Region(finds=False)), Region()
    assert track(tracking, range(2))[-1].status == Status.INITIALIZING
    tracking.reinitialize(chosen)
    assert track(tracking, range(2, 4))[-1].status == Status.TRACKING
    assert chosen.asked == 1


def test_a_chosen_region_is_used_after_a_loss_until_the_rig_file_is_asked_for():
    configured, chosen = Region(), Region()
    tracking = session(configured)
    track(tracking, range(2))
    tracking.reinitialize(chosen)
    track(tracking, range(2, 4))
    assert (configured.asked, chosen.asked, tracking.mesh_version) == (1, 1, 2)

    def blind(k, frames):
        return [dataclasses.replace(frame, data=np.zeros_like(frame.data)) for frame in frames]

    lost = track(tracking, range(4, 40), blind)
    assert lost[-1].status == Status.LOST
    assert chosen.asked > 1
    assert configured.asked == 1
    tracking.reinitialize()
    track(tracking, range(40, 42))
    assert configured.asked == 2


def test_a_chosen_region_that_shows_nothing_changes_nothing():
    configured, chosen = Region(), Region(finds=False)
    tracking = session(configured)
    track(tracking, range(2))
    tracking.reinitialize(chosen)
    assert [estimate.status for estimate in track(tracking, range(2, 5))] == [Status.TRACKING] * 3
    assert (configured.asked, chosen.asked, tracking.mesh_version) == (1, 1, 1)
