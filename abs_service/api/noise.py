"""Noise models of sensors, by their public names; docs/explanation/noise.md has formulas and how to measure them."""

from calib.noise.constant import Settings as Constant
from calib.noise.gaussian_polynomial import Settings as GaussianPolynomial
from calib.noise.images.bayer import Settings as Bayer
from calib.noise.images.binary import Settings as LightBarrier
from calib.noise.images.color import Settings as Color
from calib.noise.images.grey import Settings as Grey
from calib.noise.images.intensity import Settings as Intensity
from calib.noise.measured import Settings as Measured
from calib.noise.per_pixel import Settings as PerPixel
from calib.noise.pixel_polynomial import Settings as PixelPolynomial
from calib.noise.region_polynomial import Settings as RegionPolynomial
from calib.noise.structured_light import Settings as StructuredLight
from calib.noise.tof_amplitude import Settings as TofAmplitude

__all__ = [
    "Bayer",
    "Color",
    "Constant",
    "GaussianPolynomial",
    "Grey",
    "Intensity",
    "LightBarrier",
    "Measured",
    "PerPixel",
    "PixelPolynomial",
    "RegionPolynomial",
    "StructuredLight",
    "TofAmplitude",
]
