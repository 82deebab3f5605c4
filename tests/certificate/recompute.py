#!/usr/bin/env python3
"""Recomputes every number of a calibration certificate from the exported raw data, and shares no code with taxeld.

    taxel-lab certificate SET --out certificate.json      (the number of the session is in it)
    taxeld sessions export N --out samples.csv
    taxeld models export SET --out models.json
    python3 recompute.py certificate.json samples.csv models.json

Needs numpy. Exit code 1, with a list of what disagrees, if anything does. The curves are evaluated from the coefficients
that the certificate states. How each number is defined: crates/taxel-lab/doc/certificate.md.
"""

import hashlib
import json
import pathlib
import re
import sys

import numpy as np

LEVELS, SCANS_MIN, K = 10, 5, 2.0
# What people entered, and what the store alone knows: nothing can be computed of these.
ENTERED = re.compile(
    r"stated\.|places_mm\.|version$|session\.(number|target_kpa|counts_per_unit)$|expanded\.coverage_factor$"
    r"|loads\.\d+\.(load|mass_kg|force_n|force_sigma_n|read_n|read_sigma_n|read_scatter_n|scans)$"
)


def table(text):
    """Scans and figures of an exported session: the last two columns are the ramp, and what a row is if it is no scan."""
    rows = [line.split(",") for line in text.splitlines()[1:]]
    numbers = lambda rows: np.array([[float(cell or "nan") for cell in row[:-1]] for row in rows])
    figures = {name: numbers([row for row in rows if row[-1] == name]) for name in ("zero", "noise")}
    return numbers([row for row in rows if not row[-1]]), figures


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def strongest(values):
    """Of the values that are numbers the one farthest from 0; None without any."""
    values = [value for value in values if np.isfinite(value)]
    return max(values, key=abs) if values else None


def evaluate(curve, low, high, counts):
    s = (np.clip(counts, low, high) - curve["centre"]) / curve["half_width"]
    return np.polynomial.chebyshev.chebval(s, curve["chebyshev_kpa"])


def steeper_at_rest(models):
    """By how much a doubt about the gauge's zero grows up to the end of the range: nine taxels of ten bend no more."""
    found = []
    for model, rest in zip(models["taxels"], models["baseline"]):
        if model["status"] != "ok" or not model["curve"] or rest["mean"] is None:
            continue
        low, high = model["range"]
        begin, end = (low, high) if abs(rest["mean"] - low) < abs(rest["mean"] - high) else (high, low)
        curve = model["curve"] | {"chebyshev_kpa": model["curve"]["chebyshev"]}
        kpa = evaluate(curve, low, high, begin + np.array([0.0, 0.2, 0.8, 1.0]) * (end - begin))
        found.append((kpa[3] - kpa[2]) / (kpa[1] - kpa[0]))
    found = sorted(s for s in found if np.isfinite(s) and s > 0)
    steeper = found[int(0.9 * (len(found) - 1) + 0.5)] if found else 1.0
    return min(max((steeper - 1) / np.sqrt(3), 1.0), 10.0)


class Session:
    """The raw data in ramps, branches and levels."""

    def __init__(self, samples, both, top_kpa, per_unit):
        values, figures = table(samples)
        self.time, self.kpa, self.counts = values[:, 0], values[:, 1], values[:, 2:-1] / per_unit
        self.ramp = values[:, -1].astype(int) - 1
        self.zero, self.noise = figures["zero"][:, 2:-1], figures["noise"][:, 2:-1]
        self.ramps = len(self.zero)
        self.gauge = [kpa if np.isfinite(kpa) else None for kpa in figures["zero"][:, 1]]
        known = [kpa for kpa in self.gauge if kpa is not None]
        others = np.mean(known) if known else 0.0
        self.gauge_doubt = max(map(abs, known), default=0.0) / np.sqrt(3)
        self.kpa = self.kpa - np.array([others if kpa is None else kpa for kpa in self.gauge])[self.ramp]
        self.shift = self.zero - self.zero[-1]
        self.counts = self.counts - np.nan_to_num(self.shift)[self.ramp]
        self.falling = np.zeros(len(self.kpa), bool)
        for ramp in range(self.ramps if both else 0):
            own = np.flatnonzero(self.ramp == ramp)
            if len(own):
                self.falling[own[np.argmax(self.kpa[own]) + 1 :]] = True
        self.width = top_kpa / LEVELS
        self.level = np.clip((self.kpa / self.width).astype(int), 0, LEVELS - 1)

    def means(self, figure, falling, ramp=None):
        """Mean of a figure over each level of a branch; NaN where there are too few scans."""
        chosen = self.falling == falling
        if ramp is not None:
            chosen = chosen & (self.ramp == ramp)
        n = np.bincount(self.level[chosen], minlength=LEVELS)
        sums = np.bincount(self.level[chosen], figure[chosen], minlength=LEVELS)
        return np.where(n >= SCANS_MIN, sums / np.maximum(n, 1), np.nan), n

    def hysteresis(self, errors):
        return strongest(self.means(errors, True)[0] - self.means(errors, False)[0])

    def repeatability(self, errors):
        means = np.array([self.means(errors, False, ramp)[0] for ramp in range(self.ramps)])
        enough = [column[np.isfinite(column)] for column in means.T]
        variances = [np.var(column, ddof=1) for column in enough if len(column) >= 2]
        return np.sqrt(np.mean(variances)) if variances else None


def taxel(stated, session, reference, per_unit):
    """The figures of one taxel, its errors, and its slope and zero shifts."""
    number, low, high = stated["taxel"], stated["count_min"], stated["count_max"]
    counts, shifts = session.counts[:, number], session.shift[:, number]
    errors = evaluate(stated, low, high, counts) - session.kpa
    grid = low + np.linspace(0.0, 1.0, 101) * (high - low)
    curve = evaluate(stated, low, high, grid)
    span, slope, n = abs(curve[-1] - curve[0]), (curve[-1] - curve[0]) / (high - low), len(errors)
    order = len(stated["chebyshev_kpa"]) - 1
    hysteresis, repeatability, shift = session.hysteresis(errors), session.repeatability(errors), strongest(shifts[:-1])
    u_zero = 0.0 if shift is None else abs(shift * slope) / np.sqrt(3)
    known = lambda value: value if np.isfinite(value) else None
    figures = {
        "order": order,
        "range_kpa": sorted([curve[0], curve[-1]]),
        "sensitivity_counts_per_kpa": 1 / abs(slope),
        "linearity_percent": 100 * np.max(np.abs(curve - np.linspace(curve[0], curve[-1], 101))) / span,
        "rmse_kpa": rms(errors), "bias_kpa": np.mean(errors), "max_error_kpa": np.max(np.abs(errors)),
        "hysteresis_kpa": hysteresis, "repeatability_kpa": repeatability,
        "hysteresis_percent": None if hysteresis is None else 100 * abs(hysteresis) / span,
        "zero_counts": known(session.zero[-1, number]), "zero_noise_counts": known(session.noise[-1, number]),
        "zero_shift_counts": shift,
        "lower_limit_kpa": max(2.4 * np.sqrt(np.sum(errors**2) / max(n - order - 1, 1)), abs(slope) / per_unit),
        "outside_share": np.mean((counts < low) | (counts > high)),
        "expanded_uncertainty_kpa": K * np.sqrt(reference**2 + rms(errors) ** 2 + (repeatability or 0) ** 2 + u_zero**2),
    }
    return figures, errors, slope, shifts


def ramp_part(session, ramp, shifts):
    own = np.flatnonzero(session.ramp == ramp)
    shifts = shifts[np.isfinite(shifts)]
    part = {"ramp": ramp + 1, "scans_rising": int(np.sum(~session.falling[own])), "scans_falling": int(np.sum(session.falling[own]))}
    part["gauge_zero_kpa"] = session.gauge[ramp]
    part["zero_mean_counts"], part["zero_rms_counts"] = (np.mean(shifts), rms(shifts)) if len(shifts) else (None, None)
    if len(own):
        first, top, last = own[0], own[np.argmax(session.kpa[own])], own[-1]
        rate = lambda a, b: (session.kpa[b] - session.kpa[a]) / (session.time[b] - session.time[a]) if b > a else None
        part |= {"from_kpa": session.kpa[first], "top_kpa": session.kpa[top], "to_kpa": session.kpa[last]}
        part["rise_kpa_per_s"] = rate(first, top)
        part["fall_kpa_per_s"] = rate(top, last) if np.any(session.falling[own]) else None
    return part


def levels_part(session, all_errors, mean):
    parts = []
    for falling in (False, True):
        reference, n = session.means(session.kpa, falling)
        error = session.means(mean, falling)[0]
        own = np.array([session.means(errors, falling)[0] for errors in all_errors])
        for level in np.flatnonzero(np.isfinite(error)):
            parts.append({
                "branch": "falling" if falling else "rising", "scans": int(n[level]),
                "from_kpa": level * session.width, "to_kpa": (level + 1) * session.width,
                "reference_kpa": reference[level], "reading_kpa": reference[level] + error[level],
                "error_kpa": error[level], "spread_kpa": np.std(own[:, level], ddof=1) if len(own) > 1 else None,
            })
    return parts


def loads_part(loads):
    parts = []
    for load in loads:
        u = np.sqrt(load["read_sigma_n"] ** 2 + load["force_sigma_n"] ** 2 + load["read_scatter_n"] ** 2 / max(load["scans"], 1))
        error = load["read_n"] - load["force_n"]
        parts.append({"error_percent": 100 * error / load["force_n"], "normalised_error": error / (K * u)})
    if not loads:
        return parts, None
    within = sum(abs(part["normalised_error"]) <= 1 for part in parts)
    mean = np.mean([abs(part["error_percent"]) for part in parts])
    return parts, {"loads": len(parts), "within": within, "mean_absolute_error_percent": mean}


def recompute(stated, samples, models_text, text):
    models = json.loads(models_text)
    per_unit, top = stated["session"]["counts_per_unit"], models["pressure_max_kpa"]
    session = Session(samples, stated["session"]["branches"] == "both", top, per_unit)
    entered = stated["stated"]["reference_expanded_uncertainty_kpa"] or 0.0
    zero_doubt = session.gauge_doubt * steeper_at_rest(models)
    reference = max(np.hypot(models["gauge_gain_rel"] * top, models["gauge_offset_kpa"]), np.hypot(entered / K, zero_doubt))
    figures, all_errors, slopes, shifts = zip(*(taxel(t, session, reference, per_unit) for t in stated["taxels"]))
    for part, own in zip(figures, stated["taxels"]):  # the curves are those of the models
        model = models["taxels"][own["taxel"]]
        part |= {"taxel": model["taxel"], "count_min": model["range"][0], "count_max": model["range"][1]}
        curve = lambda c: {"centre": c["centre"], "half_width": c["half_width"], "chebyshev_kpa": c["chebyshev"]}
        part |= curve(model["curve"])
    slopes, shifts, mean = np.array(slopes), np.array(shifts), np.mean(all_errors, axis=0)
    moved = [strongest([abs(np.mean((row * slopes)[np.isfinite(row)]))]) for row in shifts.T[:-1] if np.any(np.isfinite(row))]
    over = lambda values: rms([v for v in values if v is not None]) if any(v is not None for v in values) else None
    of = lambda key, factor=1.0: over([None if f[key] is None else factor * f[key] for f in figures])
    part_of = lambda value, divisor: None if value is None else abs(value) / divisor
    means = {
        "rmse_kpa": rms(mean), "bias_kpa": np.mean(mean), "max_error_kpa": np.max(np.abs(mean)),
        "hysteresis_kpa": session.hysteresis(mean), "repeatability_kpa": session.repeatability(mean),
        "zero_shift_kpa": max(moved) if moved else None,
    }
    zero = over([part_of(f["zero_shift_counts"], np.sqrt(3) / abs(s)) for f, s in zip(figures, slopes)])
    rows = [
        ("reference", reference, reference), ("residuals", of("rmse_kpa"), means["rmse_kpa"]),
        ("repeatability", of("repeatability_kpa"), means["repeatability_kpa"]),
        ("zero", zero, part_of(means["zero_shift_kpa"], np.sqrt(3))),
        ("hysteresis", of("hysteresis_kpa", 1 / np.sqrt(12)), part_of(means["hysteresis_kpa"], np.sqrt(12))),
        ("resolution", rms(np.abs(slopes) / per_unit / np.sqrt(12)), None),
    ]
    loads, summary = loads_part(stated["loads"])
    usable = [model["taxel"] for model in models["taxels"] if model["status"] == "ok" and model["curve"]]
    numberless = re.sub(r'"number": "c-[0-9a-f]{16}"', '"number": ""', text, count=1)
    sha = lambda content: hashlib.sha256(content.encode()).hexdigest()
    return {
        "number": "c-" + sha(numberless)[:16],
        "hashes": {"samples_csv": sha(samples), "models_json": sha(models_text)},
        "set": {"id": models["id"], "patch": models["patch"], "method": models["method"], "usable": len(usable) if usable == [own["taxel"] for own in stated["taxels"]] else usable,
                "taxels": len(models["taxels"]),
                **{key: models[key] for key in ("pressure_max_kpa", "gauge_gain_rel", "gauge_offset_kpa", "board_settings")}},
        "session": {"scans": len(session.kpa)},
        "ramps": [ramp_part(session, ramp, shifts[:, ramp]) for ramp in range(session.ramps)],
        "levels": levels_part(session, all_errors, mean), "mean": means,
        "budget": [{"name": name, "taxel_kpa": one, "mean_kpa": all_of} for name, one, all_of in rows],
        "expanded": {key: K * np.sqrt(sum((row[at] or 0) ** 2 for row in rows[:4])) for at, key in ((1, "taxel_kpa"), (2, "mean_kpa"))},
        "loads": loads, "loads_summary": summary, "taxels": list(figures),
        "excluded": [{"taxel": m["taxel"], "status": m["status"]} for m in models["taxels"] if m["taxel"] not in usable],
    }


def leaves(value, path=""):
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, (list, tuple)) else None
    if inner is None:
        yield path, value
    for key, below in inner or ():
        yield from leaves(below, f"{path}.{key}" if path else str(key))


def disagreements(stated, computed):
    stated, computed = dict(leaves(stated)), dict(leaves(computed))
    for path, value in computed.items():
        there = stated.get(path, None if value is None else "missing")
        if isinstance(value, (int, float, np.number)) and isinstance(there, (int, float)):
            agrees = abs(there - value) <= 1e-9 + 1e-7 * abs(value)
        else:
            agrees = there == value
        if not agrees:
            yield f"{path}: the certificate says {there}, recomputed {value}"
    for path, value in stated.items():
        if isinstance(value, (int, float)) and not isinstance(value, bool) and path not in computed and not ENTERED.search(path):
            yield f"{path}: {value} cannot be recomputed from these data"


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    try:
        text, samples, models = (pathlib.Path(name).read_bytes().decode() for name in sys.argv[1:])
        stated = json.loads(text)
    except (OSError, ValueError) as error:
        sys.exit(f"cannot read what is to be compared: {error}")
    if not isinstance(stated, dict) or (stated.get("format"), stated.get("version")) != ("taxel-certificate", 1):
        sys.exit(f"{sys.argv[1]}: expected a taxel-certificate of version 1")
    computed = recompute(stated, samples, models, text)
    found = list(disagreements(stated, computed))
    for line in found[:500]:
        print(line)
    if found:
        sys.exit(f"{len(found)} of the certificate's values disagree with the data")
    print(f"certificate {stated['number']}: {sum(1 for _ in leaves(computed))} values recomputed, all agree")


if __name__ == "__main__":
    main()
