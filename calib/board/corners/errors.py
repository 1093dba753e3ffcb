"""Errors of board detection, one for each reason; messages address the person holding the board."""


class BoardError(ValueError):
    """Unusable view of a board; a subclass for each reason."""


class NothingFoundError(BoardError):
    """No such board in the image, or not enough of it."""


class MirroredBoardError(BoardError):
    """Mirrored image of the board."""


class OtherBoardError(BoardError):
    """Board that is not as described."""


class SaturatedError(BoardError):
    """Saturation displaces the edges of the board."""


class TooSmallError(BoardError):
    """Squares of the board span too few pixels."""


class CutOffError(BoardError):
    """Board cut off by the image's border."""


class HiddenError(BoardError):
    """Hidden points, by which the others are numbered."""


class BlurredError(BoardError):
    """Blurred edges bias the corners."""


class MovedError(BoardError):
    """Board moved since the previous image, so that sensors do not see it in the same place."""
