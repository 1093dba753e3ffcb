"""Numbers in sentences about a calibration."""


def rounded(value: float, digits: int = 2) -> str:
    """A number with so many significant digits, and without an exponent: 0.18, 2.3, 180."""
    return f"{float(f'{value:.{digits}g}'):.15g}"
