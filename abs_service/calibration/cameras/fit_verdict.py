"""Verdict on a sensor by its own corners: does it still project as it was calibrated, and what would not show."""

from abs_service.report.content import Level, Verdict
from calib.calibration_check.optics import OpticsChange
from calib.calibration_check.sensor_fits import CornerFit

#: Ratios to the expected reprojection error that are doubtful and bad.
DOUBTFUL_RATIO, BAD_RATIO = 1.5, 3.0

#: Image shifts that are negligible, and that are unacceptable [px].
UNNOTICED_PX, SPOILT_PX = 0.3, 1.0

#: Change of a focal length that has to show in the views of its sensor.
BLIND_FOCAL = 0.03


def of_fit(name: str, fit: CornerFit, expected_px: float, optics: OpticsChange | None, likelier: str) -> Verdict:
    """Verdict on one sensor.

    Args:
        name: of the sensor.
        fit: residuals of its corners.
        expected_px: their root mean square at calibration [px].
        optics: change of its focal length and principal point; None if that is unknown.
        likelier: another sensor whose camera fits the corners better; "" if there is none.
    """
    said = f"corners miss by {fit.rms:.2f} px; {expected_px:.2f} px are typical for it."
    level = Level.GOOD
    if fit.rms > DOUBTFUL_RATIO * expected_px and fit.rms >= UNNOTICED_PX:
        level = Level.BAD if fit.rms > BAD_RATIO * expected_px else Level.DOUBTFUL
    if optics is not None and optics.is_significant and optics.shift_px > UNNOTICED_PX:
        level = max(level, Level.BAD if optics.shift_px > SPOILT_PX else Level.DOUBTFUL)
        said = f"{optics}; {said}"
    if level == Level.GOOD:
        return _unchanged(name, said, optics)
    advice = (
        "Was it refocused, zoomed or set to another mode, is another board bent, or are these images of another "
        "camera, cropped or resized? If it changed, calibrate its intrinsics again."
    )
    if likelier:
        advice = f"The camera of {likelier} fits these corners by far better: are they its images?"
    return Verdict(level, f"no longer projects as it was calibrated: {said}", advice, name)


def _unchanged(name: str, said: str, optics: OpticsChange | None) -> Verdict:
    """Verdict on a sensor in whose views nothing has changed, with the change that would not show in them."""
    if optics is None:
        said += " A changed focal length would not show: that needs stored deviations and four distinct poses."
        return Verdict(Level.GOOD, f"still projects as it was calibrated: {said}", about=name)
    said += f" A focal length changed by less than {optics.unseen:.1%} would not show."
    if optics.unseen < BLIND_FOCAL:
        return Verdict(Level.GOOD, f"still projects as it was calibrated: {said}", about=name)
    advice = "Take more shots, the board tilted by 20° to 40° to all sides; so in the calibration, if it had few."
    return Verdict(Level.DOUBTFUL, f"could not be compared well enough: {said}", advice, name)
