"""Quantities of a simulator over time, kept in memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Protocol

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.messages.encoders import SOLVER_LABELS
from bilayer_core.log.run.frame_values import FrameValues
from bilayer_core.log.run.quantities import Entry, Quantity, entries
from bilayer_core.log.run.recorded import Recorded
from bilayer_core.log.run.tables import chosen_names
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.observer import Observer

Array = np.ndarray


class Attachable(Protocol):
    """Object that can be recorded: a `Simulator`."""

    @property
    def description(self) -> Description: ...

    def frame(self) -> Frame: ...

    def attach(self, observer: Observer) -> Callable[[], None]: ...


class Recorder(Recorded):
    """Records quantities of a simulator from now on, whoever makes its steps, and forgets the rest.

    A state that is loaded, and `Simulator.reset`, may go back in time: what was recorded from there on is dropped, so
    that times always increase.

    Parameters
    ----------
    simulator : Simulator
    quantities : str or sequence of str
        Names, such as ``"com"``, or patterns, such as ``"body/*/position"``; all by default. See `log.run.quantities`.
    rate : float
        Times in each simulated second, at the multiples of its period. No step is another for it.

    Raises
    ------
    InputError
        If there is no quantity of a name, with the nearest names, or the rate is none.

    Examples
    --------
    >>> recorder = Recorder(sim, ["com", "body/ball/*"], rate=100)  # doctest: +SKIP
    >>> sim.run(until=2.0)  # doctest: +SKIP
    >>> recorder["com"].values[-1], recorder.to_dataframe()  # doctest: +SKIP
    """

    def __init__(self, simulator: Attachable, quantities: str | Sequence[str] = (), rate: float = 50.0) -> None:
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate: {rate} is not allowed; it must be a number of frames a second above 0")
        self.rate = float(rate)
        self.description = simulator.description
        known = {e.name: e for e in entries(self.description, simulator.frame().energy, SOLVER_LABELS)}
        asked = [quantities] if isinstance(quantities, str) else list(quantities)
        names = [name for one in asked for name in chosen_names(known, one, lambda _: None)] if asked else list(known)
        self._entries = {name: known[name] for name in names}
        self._in_frames = FrameValues(self.description)
        self._times: list[float] = []
        self._values: dict[str, list[Array]] = {name: [] for name in self._entries}
        self._detach = simulator.attach(self)

    def __repr__(self) -> str:
        span = f"t = {self._times[0]:g} to {self._times[-1]:g} s" if self._times else "empty"
        names = ", ".join(list(self._entries)[:6]) + (", …" if len(self._entries) > 6 else "")
        scene = self.description.scene_name
        return f"Recorder({scene}: {span}, {len(self._times)} frames; {len(self._entries)} quantities: {names})"

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop()

    def stop(self) -> None:
        """Record no more; what was recorded stays."""
        self._detach()

    # what the simulator tells

    def start(self, description: Description) -> None:
        """Begin to record a run. The simulator calls this when the recorder is attached.

        Parameters
        ----------
        description : Description
            The constant part of the run.
        """

    def observe(self, frame: Frame) -> None:
        """Keep the quantities of a frame.

        Parameters
        ----------
        frame : Frame
        """
        kept = int(np.searchsorted(self._times, frame.time))
        del self._times[kept:]
        for values in self._values.values():
            del values[kept:]
        self._times.append(frame.time)
        for name, entry in self._entries.items():  # those of nodes in single precision, as in logs
            self._values[name].append(self._in_frames.picked(entry, frame, np.float32 if entry.of_shape else float))

    def close(self, complete: bool, termination: str = "") -> None:
        """End the recording. The simulator calls this when the recorder is detached.

        Parameters
        ----------
        complete : bool
            False if the run was cut short.
        termination : str
            Why it ended.
        """

    # what was recorded

    @property
    def times(self) -> Array:  # type: ignore[override]  # grows while the simulator runs
        """Times of all quantities [s], shape (frames,)."""
        return np.array(self._times)

    @property
    def shape_times(self) -> Array:  # type: ignore[override]
        """The same: shapes of rods are recorded with all else."""
        return self.times

    @property
    def quantities(self) -> Mapping[str, Quantity]:
        """Quantities recorded so far, by name."""
        times, found = self.times, {}
        for name, entry in self._entries.items():
            picked = np.array(self._values[name])
            found[name] = entry.filled(times, entry.derived(picked) if len(picked) else picked)
        return found

    def entries(self) -> dict[str, Entry]:
        return dict(self._entries)
