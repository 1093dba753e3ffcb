"""Why an image of a board is not used: one exception for each reason, its message in words for who holds the board."""


class BoardError(ValueError):
    """A view of a board that a calibration must not use; a subclass for each reason."""


class NothingFoundError(BoardError):
    """The image shows no such board, or not enough of it."""


class MirroredBoardError(BoardError):
    """The image shows the board as a mirror would."""


class SaturatedError(BoardError):
    """So much of the board is as bright as the sensor can tell that edges have moved."""


class TooSmallError(BoardError):
    """The board's squares are too few pixels wide."""


class CutOffError(BoardError):
    """The image ends on the board."""


class BlurredError(BoardError):
    """Edges are spread over so many pixels that corners are where the blur puts them."""


class MovedError(BoardError):
    """The board moved between this image and the one before, so that sensors do not see it in the same place."""
