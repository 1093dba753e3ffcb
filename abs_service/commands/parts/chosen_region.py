"""The region of a tracker whose user chooses the object: for the running tracker, and for the rig file."""

import json
from dataclasses import fields, replace

from abs_service.config import plugins
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import above_plane, distance, nearest, seed
from abs_service.tracking.plan import Plan, RegionSettings
from abs_service.tracking.session import TrackingSession
from abs_service.wire.commands import Choice, Pixel, RefusedError
from calib.rig import Rig


def reinitialize(session: TrackingSession, rig: Rig, plan: Plan, tracker: str, choice: Choice) -> str:
    """Makes a tracker look for its object anew; returns the table of the rig file that keeps a choice, else "".

    Raises:
        RefusedError: a pixel is outside the image, or the region's mask is gone.
    """
    region = chosen(plan.region, choice)
    if region is None:
        session.reinitialize()
        return ""
    camera = rig.sensors[plan.reference].camera
    for pixel in (choice.seed,) if choice.seed else choice.polygon:
        if pixel[0] >= camera.width or pixel[1] >= camera.height:
            size = f"{camera.width} × {camera.height} pixels"
            raise RefusedError(f"the pixel {list(pixel)} is outside the depth image of {size}")
    try:
        session.reinitialize(region.build())
    except DetectionError as error:
        raise RefusedError(str(error)) from error
    return toml(tracker, region)


def chosen(region: RegionSettings, choice: Choice) -> RegionSettings | None:
    """The region of a rig file, with a user's choice; None if there is none."""
    if choice.polygon:
        return in_polygon(region, choice.polygon)
    return at_pixel(region, choice.seed) if choice.seed else None


def at_pixel(region: RegionSettings, pixel: Pixel) -> RegionSettings:
    """The region of a rig file, with a pixel of the object.

    The rig file's settings of surfaces are kept: the plane that the object lies on, steps, edges of colours, a mask.

    Args:
        region: of the rig file.
        pixel: column and row in the depth image.
    """
    match region:
        case above_plane.Settings():
            return replace(region, seed=pixel, polygon=None)
        case seed.Settings():
            return replace(region, pixel=pixel, color=None, motion_s=None, polygon=None)
        case nearest.Settings() | distance.Settings():
            return seed.Settings(pixel, maximum_step_m=region.maximum_step_m, within=region.within)
        case _:
            return seed.Settings(pixel)


def in_polygon(region: RegionSettings, polygon: tuple[Pixel, ...]) -> RegionSettings:
    """The region of a rig file, limited to a polygon: of it the nearest surface, or the one on the plane.

    The rig file's settings of surfaces are kept as by `at_pixel`.

    Args:
        region: of the rig file.
        polygon: corners (column, row) in the depth image.
    """
    match region:
        case above_plane.Settings():
            return replace(region, seed=None, polygon=polygon)
        case nearest.Settings():
            return replace(region, polygon=polygon)
        case seed.Settings() | distance.Settings():
            return nearest.Settings(
                maximum_step_m=region.maximum_step_m,
                minimum_pixels=region.minimum_pixels,
                within=region.within,
                polygon=polygon,
            )
        case _:
            return nearest.Settings(polygon=polygon)


def toml(tracker: str, region: RegionSettings) -> str:
    """The table of a rig file that describes a region of this package; defaults are left out."""
    defaults = {field.name: field.default for field in fields(type(region))}  # pyright: ignore[reportArgumentType]
    values = {key: value for key, value in plugins.table(region).items() if key == "type" or value != defaults[key]}
    lines = (f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items())
    return "\n".join((f"[trackers.{tracker}.region]", *lines, ""))
