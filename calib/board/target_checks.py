"""Checks of the parameters of boards."""


class TargetError(ValueError):
    """Invalid board parameters; the message begins with the wrong attribute."""


def check_counts(columns: int, rows: int, least: int) -> None:
    """Checks the numbers of points along both sides."""
    for name, count in (("columns", columns), ("rows", rows)):
        if not least <= count <= 100:
            raise TargetError(f"{name}: {count} must be from {least} to 100")


def check_length(name: str, length: float) -> None:
    """Checks a length [m]."""
    if not 1e-4 <= length <= 10:
        raise TargetError(
            f"{name}: {length:g} m must be from 0.0001 to 10 m; {name}_mm is in millimetres, {name} in metres"
        )
