"""The run of a log, read when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bilayer_core.log.run.log_source import SHAPE_TIME, TIME, LogSource
from bilayer_core.log.run.quantities import Entry, Quantity
from bilayer_core.log.run.run_data import RunData


class LoggedRun(RunData):
    """A run whose arrays are read when they are asked for: a quantity alone, an attribute with all that comes at its
    rate.
    """

    def __init__(self, source: LogSource) -> None:
        self.__dict__.update(
            _source=source,
            description=source.description,
            times=source.times[TIME],
            shape_times=source.times[SHAPE_TIME],
            quantities=_Quantities(self, source),
        )

    def __getattr__(self, name: str) -> object:
        """Read all values that a log holds at one rate when the first of them is used.

        Python calls this for attributes that do not exist yet.
        """
        if name not in self.__dataclass_fields__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        self.__dict__.update(self._source.attributes_with(name))
        return self.__dict__[name]

    @property
    def lacks(self) -> tuple[str, ...]:
        """Topics that the log does not hold; what comes of them is NaN."""
        return self._source.lacks

    def entries(self) -> dict[str, Entry]:
        """Return the entry of each quantity by name: everything that is known of it beside its values."""
        return self._source.entries

    def why_not(self, name: str) -> str | None:
        """Return why a quantity that other logs have is not in this one; None if it is, or if no log has it."""
        return self._source.why_not(name)

    def blocks(self, wanted: Sequence[Entry]) -> Iterator[tuple[slice, dict[str, np.ndarray]]]:
        """Return the values of quantities that come at one rate, in blocks of rows, by name, as they are read."""
        return self._source.blocks(wanted)


class _Quantities(Mapping[str, Quantity]):
    """The quantities of a log: names are known at once, values are read when they are looked up, and kept."""

    def __init__(self, run: LoggedRun, source: LogSource):
        self._run, self._source = run, source
        self._read: dict[str, Quantity] = {}

    def __getitem__(self, name: str) -> Quantity:
        if name not in self._read:
            entry = self._source.entries[name]
            known = entry.attribute in self._run.__dict__
            self._read[name] = entry.of(self._run) if known else self._source.read(entry)
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._source.entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._source.entries)

    def __len__(self) -> int:
        return len(self._source.entries)
