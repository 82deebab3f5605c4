"""What the error of a recipe on another day is made of, from the recordings alone and without any code of taxeld's.

    python3 tests/recipes.py DIR      # DIR holds left_calibration, left_validation and left_steps, each .csv.gz

Fits a curve of order 3, with plays and with creep beside it, to `left_calibration`, and prints for each recipe the error of
the mean over the taxels above 30 kPa, in percent: on the lower half of the falling branch, which that fit has not seen, and
on the two other recordings, as it is and with the one gain taken out that fits the recording best. Needs numpy.
"""

import gzip
import sys

import numpy as np

HZ = 48.7
SMOOTH_SCANS = 25
TARE_S = 2.0
ORDER = 3
PLAYS = (0.08, 0.20)  # radii, shares of the swing
CREEP_S = (5.0, 60.0, 300.0)
FIT_EVERY = 10  # neighbours in time say the same
SWING_MIN, JUMP_COUNTS, JUMPS_MAX, RAIL_MAX = 25, 8, 0.002, 0.02


class Recording:
    def __init__(self, path):
        with gzip.open(path, "rt") as text:
            next(text)
            table = np.genfromtxt(text, delimiter=",")
        self.kpa, counts = table[:, 1], table[:, 2:]
        swing = np.ptp(np.percentile(counts, (0.2, 99.8), axis=0), axis=0)
        jumps = np.mean(np.abs(np.diff(counts, axis=0)) > JUMP_COUNTS, axis=0)
        rails = np.mean((counts <= 0) | (counts >= 255), axis=0)
        self.sound = (swing > SWING_MIN) & (jumps < JUMPS_MAX) & (rails < RAIL_MAX)
        kernel = np.ones(SMOOTH_SCANS)
        inside = np.convolve(np.ones(len(counts)), kernel, "same")
        smooth = np.stack([np.convolve(column, kernel, "same") / inside for column in counts.T], axis=1)
        self.tare = table[:, 0] < table[0, 0] + TARE_S
        # Counts towards pressure from where the taxels rest.
        self.pressed = counts[self.tare].mean(axis=0) - smooth


def play(pressed, radius):
    """A play that hangs back on the side of the load at rest, less its count."""
    lag, z = np.empty_like(pressed), pressed[0] + radius
    for i, count in enumerate(pressed):
        z = np.clip(z, count - radius, count + radius)
        lag[i] = z - count
    return lag


def creep(pressed, seconds):
    """An exponential mean of the count, less the count."""
    lag, mean, gain = np.empty_like(pressed), pressed[0].copy(), -np.expm1(-1 / HZ / seconds)
    for i, count in enumerate(pressed):
        mean += gain * (count - mean)
        lag[i] = mean - count
    return lag


def lags_of(recording, ends):
    swing = ends[1] - ends[0]
    lags = {f"play {share}": play(recording.pressed, share * swing) for share in PLAYS}
    return lags | {f"creep {seconds:g} s": creep(recording.pressed, seconds) for seconds in CREEP_S}


def curve(pressed, ends):
    return np.polynomial.chebyshev.chebvander(2 * (np.clip(pressed, *ends) - ends[0]) / np.ptp(ends) - 1, ORDER)


def weights(design, lags, kpa):
    """Least squares beside a free curve; no weight is negative."""
    q, _ = np.linalg.qr(design)
    left, rest = lags - q @ (q.T @ lags), kpa - q @ (q.T @ kpa)
    used = list(range(lags.shape[1]))
    found = np.zeros(lags.shape[1])
    while used:
        found[:] = 0
        found[used] = np.linalg.lstsq(left[:, used], rest, rcond=None)[0]
        if found.min() >= 0:
            break
        used.remove(int(np.argmin(found)))
    return found if used else np.zeros(lags.shape[1])


class Model:
    """One taxel: `share` of the weights that least squares finds, and the curve that is best with them."""

    def __init__(self, pressed, lags, kpa, ends, share):
        self.ends, design = ends, curve(pressed, ends)
        lags = -np.stack(lags, axis=1) if lags else np.zeros((len(kpa), 0))
        self.weights = share * weights(design, lags, kpa)
        self.curve = np.linalg.lstsq(design, kpa - lags @ self.weights, rcond=None)[0]
        top = ends[1] - np.array([0.05 * np.ptp(ends), 0.0])
        self.slope = np.ptp(curve(top, ends) @ self.curve) / np.ptp(top)

    def read(self, pressed, lags):
        kpa = curve(pressed, self.ends) @ self.curve + np.maximum(pressed - self.ends[1], 0) * self.slope
        return kpa - sum(weight * lag for weight, lag in zip(self.weights, lags))


def percent(area, kpa):
    high = kpa > 30
    return 100 * np.mean(np.abs(area[high] - kpa[high]) / kpa[high])


def main(folder):
    days = {name: Recording(f"{folder}/left_{name}.csv.gz") for name in ("calibration", "validation", "steps")}
    first = days["calibration"]
    taxels = np.where(first.sound)[0]
    ends = np.percentile(first.pressed, (0.2, 99.8), axis=0)
    lags = {name: lags_of(day, ends) for name, day in days.items()}
    top, n = int(first.kpa.argmax()), len(first.kpa)
    unseen = np.arange(n) > top + (n - top) // 2

    def models(wanted, share, seen):
        rows = np.where(seen)[0][::FIT_EVERY]
        of = lambda t: [lags["calibration"][lag][rows, t] for lag in wanted]
        return {t: Model(first.pressed[rows, t], of(t), first.kpa[rows], ends[:, t], share) for t in taxels}

    def area(fitted, name, wanted, own_rest):
        day, sum_kpa, known = days[name], 0.0, 0
        for t in taxels[day.sound[taxels]]:
            kpa = fitted[t].read(day.pressed[:, t], [lags[name][lag][:, t] for lag in wanted])
            sum_kpa, known = sum_kpa + kpa - (kpa[day.tare].mean() if own_rest else 0.0), known + 1
        return sum_kpa / known

    def row(title, wanted, share=1.0, own_rest=False):
        held_out = area(models(wanted, share, ~unseen), "calibration", wanted, own_rest)
        cells, fitted = [f"{percent(held_out[unseen], first.kpa[unseen]):.2f} %"], models(wanted, share, ~unseen | unseen)
        for name in ("validation", "steps"):
            kpa, read = days[name].kpa, area(fitted, name, wanted, own_rest)
            gain = np.sum((read * kpa)[kpa > 30]) / np.sum((kpa * kpa)[kpa > 30])
            cells += [f"{percent(read, kpa):.2f} %", f"{100 * gain - 100:+.1f} %", f"{percent(read / gain, kpa):.2f} %"]
        print(f"| {title} | " + " | ".join(cells) + " |", flush=True)

    print("| recipe | unseen half | validation | its gain | without it | steps | its gain | without it |\n" + "|---" * 8 + "|")
    both = [f"play {share}" for share in PLAYS]
    slow = [f"creep {seconds:g} s" for seconds in CREEP_S]
    row("curve", [])
    row("plays", both)
    for share in (0.75, 0.5, 0.25):
        row(f"{share:g} of the plays", both, share)
    row("the small play alone", both[:1])
    row("the great play alone", both[1:])
    row("plays and a creep of 60 s", both + slow[1:2])
    row("plays and creeps of 5, 60 and 300 s", both + slow)
    row("the creeps alone", slow)
    row("curve, less what it reads at the tare", [], own_rest=True)
    row("plays, less what they read at the tare", both, own_rest=True)


if __name__ == "__main__":
    main(sys.argv[1])
