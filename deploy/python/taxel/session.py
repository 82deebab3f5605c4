"""Recordings: the samples of a calibration session, or any file of time, pressure and counts.

The file is what `taxel-lab fit` reads: a header `t_s,pressure_kpa,c0,c1,...` and a row a scan; plain or .gz. A cell of the
pressure may be empty. `taxeld sessions export` adds the columns `ramp` and `figure`, and rows of figures, which are no scans.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
from dataclasses import dataclass
from typing import Any, List, Optional, Sequence, Union


_EXPORTED = ["ramp", "figure"]  # columns after the counts


@dataclass(frozen=True)
class Session:
    """Scans in the order of time: `counts[i][taxel]` was read at `time_s[i]` under `pressure_kpa[i]`."""

    time_s: List[float]
    pressure_kpa: List[Optional[float]]
    counts: List[List[float]]

    @property
    def taxels(self) -> int:
        """How many taxels there are."""
        return len(self.counts[0]) if self.counts else 0

    def taxel(self, number: int) -> List[float]:
        """The counts of one taxel, a scan each."""
        return [row[number] for row in self.counts]

    def plot(self, taxels: Optional[Sequence[int]] = None, axes: Any = None) -> Any:
        """Counts against pressure, a line a taxel; needs matplotlib. Gives the axes."""
        if axes is None:
            import matplotlib.pyplot as pyplot

            _, axes = pyplot.subplots()
        pressures = [math.nan if kpa is None else kpa for kpa in self.pressure_kpa]
        for number in range(self.taxels) if taxels is None else taxels:
            axes.plot(pressures, self.taxel(number), linewidth=0.7, label=f"taxel {number}")
        axes.set_xlabel("pressure in kPa")
        axes.set_ylabel("count")
        return axes


def read_session(path: Union[str, "os.PathLike[str]"]) -> Session:
    """Reads a recording. A row that cannot be read is refused with its line, as `taxel-lab fit` does it."""
    name = os.fspath(path)
    opened = gzip.open(name, "rt", newline="") if name.endswith(".gz") else open(name, newline="")
    session = Session([], [], [])
    with opened as file:
        rows = csv.reader(file)
        header = next(rows, [])
        if header[:1] != ["t_s"] or not any(cell == "c0" for cell in header):
            raise ValueError(f"{name}:1: expected the header t_s,pressure_kpa,c0,c1,...")
        first = header.index("c0")
        exported = header[-2:] == _EXPORTED
        end = len(header) - 2 * exported
        expected = [f"c{number}" for number in range(end - first)]
        if header[first:end] != expected or header[1:first] not in ([], ["pressure_kpa"]):
            raise ValueError(f"{name}:1: expected the header t_s,pressure_kpa,c0,c1,...")
        for row in rows:
            if not row:
                continue
            if len(row) != len(header):
                raise ValueError(f"{name}:{rows.line_num}: {len(row)} cells, expected {len(header)}")
            if exported and row[-1]:
                continue
            try:
                numbers = [float(cell) if cell else None for cell in row[:end]]
            except ValueError as error:
                raise ValueError(f"{name}:{rows.line_num}: {error}") from None
            time_s, counts = numbers[0], numbers[first:]
            if time_s is None or None in counts or not all(map(math.isfinite, [time_s, *counts])):
                raise ValueError(f"{name}:{rows.line_num}: expected a number in each cell but the pressure's")
            session.time_s.append(time_s)
            session.pressure_kpa.append(numbers[1] if first == 2 else None)
            session.counts.append(counts)
    return session
