"""What can go wrong that is not simply a bad argument (those are ValueError)."""


class MjskipError(Exception):
    """Base of this package's own errors; its text is one line fit for a user."""


class SceneError(MjskipError):
    """A scene is missing, does not compile, or lacks a part that was asked for."""


class MeshError(MjskipError, ValueError):
    """A mesh cannot be a stone: open, inverted, degenerate or without volume."""


class CouplingError(MjskipError):
    """The water had stopped acting on a model: another callback took its place."""


class DivergedError(MjskipError):
    """A run produced a force or a state that is not finite.

    Attributes:
        body: name of the body.
        time: simulated time of the first non-finite value [s].
    """

    def __init__(self, message: str, *, body: str = "", time: float = float("nan")) -> None:
        super().__init__(message)
        self.body = body
        self.time = time


class RenderError(MjskipError):
    """No picture can be drawn or encoded here; the text says what to install."""


class MjskipWarning(UserWarning):
    """A result that may not be right physically: the run goes on, with both numbers in the text."""
