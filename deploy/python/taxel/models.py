"""Model sets: the curves of a patch, as `taxeld models export` and `taxel-lab fit` write them (MODELS.json)."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, List, Mapping, Optional, Sequence, Tuple, Union

_POINTS = 101  # that a curve is drawn by


@dataclass(frozen=True)
class ModelSet:
    """The curve of each taxel that has a usable one, by the taxel's number."""

    id: str
    curves: Mapping[int, Mapping[str, Any]]

    def curve(self, taxel: int) -> Tuple[List[float], List[float]]:
        """Counts over the calibrated range, and the pressure in kPa that a steady load of that count is."""
        curve = self.curves[taxel]
        shares = [2.0 * point / (_POINTS - 1) - 1.0 for point in range(_POINTS)]
        counts = [curve["centre"] + curve["half_width"] * share for share in shares]
        return counts, [_chebyshev(curve["chebyshev"], share) for share in shares]

    def plot(self, taxels: Optional[Sequence[int]] = None, axes: Any = None) -> Any:
        """Count against pressure, a line a taxel, as `Session.plot` has its scans; needs matplotlib. Gives the axes."""
        if axes is None:
            import matplotlib.pyplot as pyplot

            _, axes = pyplot.subplots()
        for taxel in self.curves if taxels is None else taxels:
            counts, kpa = self.curve(taxel)
            axes.plot(kpa, counts, label=f"curve of taxel {taxel}")
        axes.set_xlabel("pressure in kPa")
        axes.set_ylabel("count")
        return axes


def read_models(path: Union[str, "os.PathLike[str]"]) -> ModelSet:
    """Reads a model set."""
    with open(path, encoding="utf-8") as file:
        text = json.load(file)
    if text.get("format") != "taxeld-models":
        raise ValueError(f"{os.fspath(path)}: expected a file of `taxeld models export`")
    usable = {number: taxel["curve"] for number, taxel in enumerate(text["taxels"]) if taxel["status"] == "ok"}
    return ModelSet(text.get("id", ""), {number: curve for number, curve in usable.items() if curve})


def _chebyshev(coefficients: Sequence[float], x: float) -> float:
    """Clenshaw's sum."""
    first, second = 0.0, 0.0
    for coefficient in reversed(coefficients[1:]):
        first, second = coefficient + 2.0 * x * first - second, first
    return coefficients[0] + x * first - second
