"""Exceptions that reach the user, each with the exit code of the command line."""

from __future__ import annotations


class BilayerError(Exception):
    """Base of all errors raised on purpose by this package."""

    exit_code = 2


class SceneError(BilayerError):
    """A scene file, or an override of one of its values, is not acceptable.

    The message names the file, the key path, the value found and what is allowed.
    """


class InputError(BilayerError):
    """Another input is not acceptable: a path, a command-line value, a stimulus, a saved state."""


class PenetrationError(SceneError):
    """A scene starts with a node behind a surface, or nearer to it than can be resolved."""


class ForceError(BilayerError):
    """A scene needs a force that is planned and that no term of the engine computes."""


class SimulationError(BilayerError):
    """The simulation could not go on; the last accepted state is kept.

    Attributes
    ----------
    reason : str
        What failed.
    time : float
        Simulated time of the last accepted step [s].
    """

    exit_code = 3

    def __init__(self, reason: str, time: float):
        super().__init__(f"stopped at t = {time:.6g} s: {reason}")
        self.reason = reason
        self.time = time

    def __reduce__(self) -> tuple:
        """For its way between processes."""
        return type(self), (self.reason, self.time)
