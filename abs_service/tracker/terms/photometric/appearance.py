"""Appearance of the vertices: their colours, and their values in each imaging sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import LUMA, ChannelImage, ColorImage, Image
from abs_service.tracker.detection.templates.base import ALL_SEEN, Sight
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.photometric.demosaicing import demosaiced
from abs_service.tracker.terms.photometric.illumination import lambert
from calib import pose
from calib.camera import Camera
from calib.noise.bayer import GaussianBayer
from calib.noise.color import GaussianColor
from calib.noise.grey import GaussianGrey
from calib.noise.intensity import GaussianIntensity
from calib.rig import Rig, Sensor

Values = NDArray[np.float64]

#: Smallest cosine of incidence from which a reflectivity is estimated.
LEAST_COSINE = 0.2


def with_appearance(mesh: Mesh, images: Mapping[str, Image], rig: Rig, sight: Sight = ALL_SEEN) -> Mesh:
    """The mesh with its colours, and with its appearance in every imaging sensor.

    The appearance comes from the sensor's own image, because no two cameras agree on a colour; for vertices that it
    did not see, from the other sensors' colours. Only a Bayer sensor prefers the colour sensors, which measure all
    three channels of a vertex.

    Args:
        mesh: the mesh at the time of the images.
        images: images of that moment, by sensor name.
        rig: the sensors.
        sight: what a template knows. Vertices that the first depth image does not show get no appearance from the
            images. Colours of the template count for all vertices in place of the images', which only say how bright
            they are in each sensor and channel; infra-red and amplitudes, of which a template knows nothing, excepted.
    """
    own = {name: _seen(image, rig.sensors[name].camera, mesh) for name, image in images.items()}
    colors = _colors(mesh, own, rig)
    appearance: dict[str, Values] = {}
    for name, sensor in rig.sensors.items():
        seen = own.get(name, np.full((1, 1), np.nan))
        match sensor.noise:
            case GaussianColor():
                appearance[name] = _known(seen, colors)
            case GaussianGrey():
                appearance[name] = _known(seen, colors @ LUMA[:, None])
            case GaussianBayer():
                appearance[name] = _known(_filtered(sensor, sensor.noise, mesh, images, rig), seen)
            case GaussianIntensity(illumination="active"):
                appearance[name] = seen / _brightness(sensor.camera, mesh)
            case GaussianIntensity(illumination="passive"):
                appearance[name] = seen + np.zeros((len(mesh.vertices), 1))
    seen, known = sight.seen(mesh)[:, None], sight.colors(mesh).astype(np.float64)
    colors = _painted(np.where(seen, colors, np.nan), known)
    for name, values in appearance.items():
        visible = np.where(seen, values, np.nan)
        is_picture = isinstance(rig.sensors[name].noise, (GaussianColor, GaussianGrey, GaussianBayer))
        own_colors = known @ LUMA[:, None] if values.shape[1] == 1 else known
        appearance[name] = _painted(visible, own_colors) if is_picture else visible
    as_single = {name: values.astype(np.float32) for name, values in appearance.items()}
    return replace(mesh, colors=colors.astype(np.float32), appearance=as_single)


def _painted(measured: Values, known: Values) -> Values:
    """Known colours (n, channels) as bright as measured ones, in the median; where unknown, the measured ones."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(known > 0, measured / known, np.nan)
    compared = np.isfinite(ratio)
    gain = [np.median(ratio[one, c]) if (one := compared[:, c]).any() else 1.0 for c in range(known.shape[1])]
    return _known(known * gain, measured)


def _colors(mesh: Mesh, own: Mapping[str, Values], rig: Rig) -> Values:
    """Red, green and blue (n, 3) of the vertices: of the colour sensors, else of the Bayer sensors, else grey."""
    color, bayer, grey = [], [], []
    for name, seen in own.items():
        match rig.sensors[name].noise:
            case GaussianColor():
                color.append(seen)
            case GaussianBayer() as noise:
                bayer.append(noise.remove_crosstalk(seen))
            case GaussianGrey():
                grey.append(np.repeat(seen, 3, axis=1))
    shape = (len(mesh.vertices), 3)
    return _known(_mean(color, shape), _known(_mean(bayer, shape), _mean(grey, shape)))


def _filtered(sensor: Sensor, noise: GaussianBayer, mesh: Mesh, images: Mapping[str, Image], rig: Rig) -> Values:
    """Colours (n, 3) of the colour sensors after the defocus and crosstalk of a Bayer sensor."""
    seen = []
    for name, image in images.items():
        if isinstance(image, ColorImage):
            camera = rig.sensors[name].camera
            blur_px = noise.defocus_px * _magnification(camera, sensor.camera, mesh.vertices)
            rgb = cv2.GaussianBlur(image.rgb, (0, 0), blur_px) if blur_px > 0 else image.rgb
            seen.append(_seen(ColorImage(np.asarray(rgb, np.uint8)), camera, mesh))
    return noise.apply_crosstalk(_mean(seen, (len(mesh.vertices), 3)))


def _magnification(camera: Camera, other: Camera, points: Values) -> float:
    """Pixels of one camera per pixel of another, where the points are."""
    scales = [one.fx / np.median((points - one.center) @ one.T_rs[:3, 2]) for one in (camera, other)]
    return float(scales[0] / scales[1])


def _brightness(camera: Camera, mesh: Mesh) -> Values:
    """Lambert's factor (n, 1) of the vertices for a lamp at the camera; NaN where it is too small to divide by."""
    surface = Surface(*(np.ascontiguousarray(part.T[None], np.float32) for part in (mesh.vertices, mesh.normals)))
    shade = lambert(surface, camera.center)[0].astype(np.float64)
    cosine = shade * np.sum((mesh.vertices - camera.center) ** 2, axis=1)
    return np.where(cosine > LEAST_COSINE, shade, np.nan)[:, None]


def _seen(image: Image, camera: Camera, mesh: Mesh) -> Values:
    """Values of an image at the vertices (n, channels), interpolated bilinearly; NaN where unknown."""
    match image:
        case ColorImage():
            return _between(image.rgb, camera, mesh.vertices)
        case ChannelImage() if image.channels.size > 1:
            return _between(demosaiced(image.values, image.channel), camera, mesh.vertices)
        case ChannelImage():
            return _between(image.values[..., None], camera, mesh.vertices)
    return np.full((len(mesh.vertices), 1), np.nan)


def _between(values: NDArray[np.generic], camera: Camera, points: Values) -> Values:
    """Bilinear interpolation (n, c) among those of the four pixels (height, width, c) around a point that are known."""
    height, width, channels = values.shape
    place = _place(camera, points)
    inside = np.isfinite(place).all(axis=1)
    result = np.full((len(points), channels), np.nan)
    corner = np.floor(place[inside]).astype(int)
    steps = np.arange(2)
    column, row = corner[:, :1] + steps, corner[:, 1:] + steps
    across, down = (np.maximum(1 - np.abs(part - place[inside, i, None]), 0) for i, part in enumerate((column, row)))
    valid = ((row >= 0) & (row < height))[:, :, None] & ((column >= 0) & (column < width))[:, None, :]
    row, column = np.clip(row, 0, height - 1)[:, :, None], np.clip(column, 0, width - 1)[:, None, :]
    corners = values[row, column].astype(np.float64)
    known = np.isfinite(corners)
    weights = (down[:, :, None] * across[:, None, :] * valid)[..., None] * known
    total = weights.sum(axis=(1, 2))
    filled = np.where(known, corners, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        result[inside] = np.where(total > 0, (weights * filled).sum(axis=(1, 2)) / total, np.nan)
    return result


def _place(camera: Camera, points: Values) -> Values:
    """Pixel coordinates (n, 2) of points; NaN for what is outside the image, or only folded into it by the lens."""
    local = pose.transform(camera.T_sr, points)
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = np.linalg.norm(local[:, :2], axis=1) / local[:, 2]
        place = camera.project(points)
        pixel = np.floor(place + 0.5)
        seen = (aside < camera.field_radius) & np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=1)
    return np.where((seen & (local[:, 2] > 0))[:, None], place, np.nan)


def _known(values: Values, others: Values) -> Values:
    """The values, and the others where they are unknown."""
    return np.where(np.isfinite(values), values, others)


def _mean(parts: Sequence[Values], shape: tuple[int, int]) -> Values:
    """Mean of what is known; NaN where nothing is."""
    total, count = np.zeros(shape), np.zeros(shape)
    for part in parts:
        known = np.isfinite(part)
        total[known] += part[known]
        count[known] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
