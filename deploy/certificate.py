#!/usr/bin/env python3
"""Recomputes every number of a calibration certificate from the exported raw data, and shares no code with taxeld.

    taxeld certificate SET --out certificate.json      (the number of the session is in it)
    taxeld sessions export N --out samples.csv
    taxeld models export SET --out models.json
    python3 certificate.py certificate.json samples.csv models.json

Needs numpy. Exit code 1, with a list of what disagrees, if anything does. The curves are evaluated from the coefficients
that the certificate states. How each number is defined: crates/taxeld/doc/certificate.md.
"""

import hashlib
import json
import pathlib
import re
import sys

import numpy as np

LEVELS, SCANS_MIN, K = 10, 5, 2.0
FILLED_SHARE_MAX = 0.2  # of a known load that says anything of areas
# What people entered, and what the store alone knows: nothing can be computed of these.
ENTERED = re.compile(
    r"stated\.|version$|session\.(number|target_kpa|refused\.\w+|counts_per_unit)$|expanded\.coverage_factor$"
    r"|loads\.\d+\.(load|mass_kg|force_n|force_sigma_n|read_n|read_sigma_n|read_scatter_n|scans|out_of_range"
    r"|filled_share|mean_area_mm2|area_factor|area_uncertainty)$|loads_summary\.area_uncertainty$"
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
        greatest, unknown = max(map(abs, known), default=0.0), np.array([kpa is None for kpa in self.gauge])[self.ramp]
        self.gauge_doubt = greatest / np.sqrt(3)
        if greatest > 0 and len(known) < self.ramps:
            self.gauge_doubt = max(greatest, min(np.maximum(self.kpa[unknown], 0.0), default=0.0))
        self.kpa = self.kpa - np.array([others if kpa is None else kpa for kpa in self.gauge])[self.ramp]
        self.shift = self.zero - self.zero[0]
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

    def smoothed(self, counts, seconds):
        steps = np.sort(np.diff(self.time)[np.diff(self.ramp) == 0])
        # A thousandth of a scan short is a whole one: the file's times are rounded to a microsecond.
        half = int(0.5 * seconds / steps[len(steps) // 2] + 1e-3) if len(steps) and seconds > 0 else 0
        parts = []
        for ramp in range(self.ramps):
            own = counts[self.ramp == ramp]
            sums, at = np.concatenate([[0.0], np.cumsum(own)]), np.arange(len(own))
            begin, end = np.maximum(at - half, 0), np.minimum(at + half + 1, len(own))
            parts.append((sums[end] - sums[begin]) / (end - begin))
        return np.concatenate(parts)


def with_plays(plays, counts):
    """Readings with the hysteresis compensated by play operators."""
    sign, low, high = plays["sign"], plays["count_min"], plays["count_max"]
    felt = np.maximum(counts, low) if sign > 0 else np.minimum(counts, high)
    bend = np.zeros(len(counts))
    for radius, weight in zip(plays["radii_counts"], plays["weights_kpa"]):
        rest, top = sorted([sign * low, sign * high])
        if 2 * radius >= top - rest:
            z = sign * (rest + (top - rest) / 2)
        else:  # of the past of the first count nothing is known: midway between a rise from rest and a fall from the top
            load = sign * felt[0]
            risen, fallen = max(rest + radius, load - radius), min(top - radius, load + radius)
            z = sign * (risen + (fallen - risen) / 2)
        for scan, count in enumerate(felt):
            z = min(max(z, count - radius), count + radius)
            bend[scan] += weight * (z - count)
    return evaluate(plays, low, high, counts) - sign * bend


def taxel(stated, session, reference, per_unit, smooth_s):
    """The figures of one taxel, its errors, and its slope and zero shifts."""
    number, low, high = stated["taxel"], stated["count_min"], stated["count_max"]
    counts, shifts = session.counts[:, number], session.shift[:, number]
    errors = evaluate(stated, low, high, counts) - session.kpa
    grid = low + np.linspace(0.0, 1.0, 101) * (high - low)
    curve = evaluate(stated, low, high, grid)
    span, slope, n = abs(curve[-1] - curve[0]), (curve[-1] - curve[0]) / (high - low), len(errors)
    order = len(stated["chebyshev_kpa"]) - 1
    hysteresis, repeatability, shift = session.hysteresis(errors), session.repeatability(errors), strongest(shifts[1:])
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
        "zero_counts": known(session.zero[0, number]), "zero_noise_counts": known(session.noise[0, number]),
        "zero_shift_counts": shift,
        "lower_limit_kpa": max(2.4 * np.sqrt(np.sum(errors**2) / max(n - order - 1, 1)), abs(slope) / per_unit),
        "outside_share": np.mean((counts < low) | (counts > high)),
        "expanded_uncertainty_kpa": K * np.sqrt(reference**2 + rms(errors) ** 2 + (repeatability or 0) ** 2 + u_zero**2),
    }
    if stated["plays"]:
        read = with_plays(stated["plays"], session.smoothed(counts, smooth_s))
        figures["plays"] = {"rmse_kpa": rms(read - session.kpa)}
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
    parts, points, counting, newest = [], [], [], loads[-1] if loads else None
    for load in loads:
        u = np.sqrt(load["read_sigma_n"] ** 2 + load["force_sigma_n"] ** 2 + load["read_scatter_n"] ** 2 / max(load["scans"], 1))
        error = load["read_n"] - load["force_n"]
        parts.append({"error_percent": 100 * error / load["force_n"], "normalised_error": error / (K * u)})
        same_filling = load.get("filled") in (None, bool(newest.get("filled")))
        told = "left_out_because" in load  # earlier versions counted all, those within the range in the factor
        outdated = told and (abs(load["mean_area_mm2"] / newest["mean_area_mm2"] - 1) > 1e-9 or not same_filling)
        unfit = load["out_of_range"] > 0 or bool(load.get("reasons")) or load.get("filled_share", 0) > FILLED_SHARE_MAX
        said = [bool(load.get(key)) for key in ("outdated_because", "left_out_because")]
        if told and said != [outdated, unfit and not outdated]:
            parts[-1]["counts"] = not outdated and not unfit  # the certificate says otherwise
        if not outdated:
            counting.append(parts[-1])
        if not outdated and not unfit:
            area = load["area_uncertainty"] * load["read_n"]
            read = max(load["read_sigma_n"] ** 2 - area**2, 0) + load["read_scatter_n"] ** 2 / max(load["scans"], 1)
            variance = max(read / load["area_factor"] ** 2 + load["force_sigma_n"] ** 2, (1e-3 * load["force_n"]) ** 2)
            points.append((load["read_n"] / load["area_factor"], load["force_n"], 1 / variance))
    if not loads:
        return parts, None
    summary = {"loads": len(counting), "within": sum(abs(part["normalised_error"]) <= 1 for part in counting)}
    summary["mean_absolute_error_percent"] = np.mean([abs(part["error_percent"]) for part in counting])
    if "left_out_because" in newest:  # earlier versions did not count them
        summary["in_factor"] = len(points)
    summary |= {"area_factor": None, "area_factor_sigma": None}
    if len(points) >= 3:
        x, y, w = np.array(points).T
        factor = np.sum(w * x * y) / np.sum(w * x * x)
        chi2 = np.sum(w * (y - factor * x) ** 2) / (len(x) - 1)
        summary |= {"area_factor": factor, "area_factor_sigma": np.sqrt(max(chi2, 1) / np.sum(w * x * x))}
    return parts, summary


def recompute(stated, samples, models_text, text):
    models, smooth_s = json.loads(models_text), stated["set"]["smooth_s"]
    per_unit, top = stated["session"]["counts_per_unit"], models["pressure_max_kpa"]
    session = Session(samples, stated["session"]["branches"] == "both", top, per_unit)
    entered = stated["stated"]["reference_expanded_uncertainty_kpa"] or 0.0
    zero_doubt = session.gauge_doubt * steeper_at_rest(models)
    reference = max(np.hypot(models["gauge_gain_rel"] * top, models["gauge_offset_kpa"]), np.hypot(entered / K, zero_doubt))
    figures, all_errors, slopes, shifts = zip(*(taxel(t, session, reference, per_unit, smooth_s) for t in stated["taxels"]))
    recorded = (models.get("recorded") or {"taxels": []})["taxels"]
    for part, own in zip(figures, stated["taxels"]):  # the curves are those of the models
        model = models["taxels"][own["taxel"]]
        part |= {"taxel": model["taxel"], "count_min": model["range"][0], "count_max": model["range"][1]}
        curve = lambda c: {"centre": c["centre"], "half_width": c["half_width"], "chebyshev_kpa": c["chebyshev"]}
        part |= curve(model["curve"])
        if own["plays"]:
            plays = recorded[own["taxel"]]["plays"]
            part["plays"] |= curve(plays["curve"]) | {"count_min": plays["range"][0], "count_max": plays["range"][1]}
            part["plays"] |= {key: plays[key] for key in ("radii_counts", "weights_kpa")}
            part["plays"]["sign"] = 1 if model["sign"] == "rising" else -1
    slopes, shifts, mean = np.array(slopes), np.array(shifts), np.mean(all_errors, axis=0)
    moved = [strongest([abs(np.mean((row * slopes)[np.isfinite(row)]))]) for row in shifts.T[1:] if np.any(np.isfinite(row))]
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
                "taxels": len(models["taxels"]), "smooth_s": (models.get("recorded") or {}).get("smooth_s", 0.0),
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
        # What an earlier version did not state and nobody knows.
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
    if not isinstance(stated, dict) or (stated.get("format"), stated.get("version")) != ("taxeld-certificate", 1):
        sys.exit(f"{sys.argv[1]}: expected a taxeld-certificate of version 1")
    computed = recompute(stated, samples, models, text)
    found = list(disagreements(stated, computed))
    for line in found[:500]:
        print(line)
    if found:
        sys.exit(f"{len(found)} of the certificate's values disagree with the data")
    print(f"certificate {stated['number']}: {sum(1 for _ in leaves(computed))} values recomputed, all agree")


if __name__ == "__main__":
    main()
