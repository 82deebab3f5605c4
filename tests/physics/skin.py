"""A second simulated skin, from the physics alone and without any code of taxeld's: candump logs and the truth.

Triangles tile the plane with gaps between their pads (module centres 18 mm apart, pads of 4 mm). What presses is spread by
a soft layer of 2 mm (Boussinesq's half-space). Each taxel has its own curve, creep of 5 and 60 s, crosstalk of 3 % to its
neighbours, drift, noise of 0.9 counts and rounding; hysteresis is none, a play of 1 to 2 counts, or a loop that closes at
rest. Left out: curvature, shear, temperature, faults of electronics, bag wrinkles (the bag presses the same everywhere).
"""

import math

import numpy as np

SPACING_MM = 18.0
SIDE_MM = SPACING_MM * math.sqrt(3)
PITCH_MM = 6.533
SLOTS = (0, 1, 2, 3, 4, 5, 7, 8, 9, 11)
BOARDS = ((13, 16), (12, 7))
PERIOD_S = 0.05
GAUGE = 0x3A1


def triangle():
    """Places of the ten taxels about the centre, in mm: corners 1, 5, 9, centre 3, the others on the edges."""
    height = PITCH_MM * math.sqrt(3) / 2
    rows = [[(i - (n - 1) / 2) * PITCH_MM for i in range(n)] for n in (4, 3, 2, 1)]
    places = [(x, (row - 1) * height) for row, xs in enumerate(rows) for x in xs]
    of_slot = {1: 0, 2: 1, 4: 2, 5: 3, 0: 4, 3: 5, 7: 6, 11: 7, 8: 8, 9: 9}
    return np.array([places[of_slot[slot]] for slot in SLOTS])


def tiling():
    """Centre and orientation of 23 triangles in three strips without overlap, in mm."""
    height = SIDE_MM * math.sqrt(3) / 2
    modules = []
    for row in range(3):
        for k in range(8):
            up = (k + row) % 2 == 0
            modules.append(((k * SIDE_MM / 2, row * height + (height / 3 if up else 2 * height / 3)), 1 if up else -1))
    return modules[:23]


def layer_stencil(depth_mm=2.0, pad_mm=2.0):
    """Where a pad feels a pressure at the surface, relative to its centre in mm, and how much of it."""
    grid = np.arange(-9, 9.01, 0.75)
    x, y = np.meshgrid(grid, grid)
    r2 = x**2 + y**2
    point = 3 * depth_mm**3 / (2 * np.pi * (r2 + depth_mm**2) ** 2.5)
    pad = (r2 <= pad_mm**2).astype(float)
    spectrum = np.fft.fft2(np.fft.ifftshift(point)) * np.fft.fft2(np.fft.ifftshift(pad))
    weights = np.fft.fftshift(np.real(np.fft.ifft2(spectrum)))
    keep = weights > 1e-4 * weights.sum()
    return x[keep], y[keep], weights[keep] / weights[keep].sum()


class Skin:
    """230 taxels with everything that they remember."""

    def __init__(self, rng, hysteresis):
        self.rng, self.hysteresis = rng, hysteresis
        local = triangle()
        self.places = np.concatenate([local * turn + centre for centre, turn in tiling()])
        n = self.taxels = len(self.places)
        self.rest = 240 + rng.normal(0, 1.5, n)
        self.gain, self.half_kpa = rng.uniform(45, 110, n), rng.uniform(25, 60, n)
        self.play = rng.uniform(1.0, 2.0, n) / 2
        self.loop = rng.uniform(0.03, 0.06, n)
        self.followed, self.drift = np.zeros(n), np.zeros(n)
        self.creep = [] if hysteresis == "none" else [[np.zeros(n), 5.0, 0.02], [np.zeros(n), 60.0, 0.02]]
        apart = np.linalg.norm(self.places[:, None] - self.places[None], axis=2)
        self.beside = ((apart < 8) & (apart > 0)).astype(float)
        self.stencil = layer_stencil()

    def pads_kpa(self, pressure):
        """What each pad feels of `pressure(x, y)` on the surface, kPa."""
        x, y, weights = self.stencil
        return (pressure(self.places[:, 0, None] + x, self.places[:, 1, None] + y) * weights).sum(1)

    def scan(self, kpa):
        """Counts of one scan with so much on each pad."""
        felt = self.gain * kpa / (kpa + self.half_kpa)
        for state in self.creep:
            state[0] += (felt - state[0]) * (1 - math.exp(-PERIOD_S / state[1]))
        felt = felt + sum(share * state for state, _, share in self.creep)
        felt = 0.97 * felt + 0.03 * (self.beside @ felt) / np.maximum(self.beside.sum(1), 1)
        width = {"none": 0.0, "play": self.play, "loop": self.loop * felt}[self.hysteresis]
        self.followed = np.maximum(np.minimum(self.followed, felt + width), felt - width)
        if self.hysteresis != "none":
            self.drift += self.rng.normal(0, 0.01, self.taxels) * math.sqrt(PERIOD_S)
        counts = self.rest - self.followed + self.drift + self.rng.normal(0, 0.9, self.taxels)
        return np.clip(np.rint(counts), 0, 255).astype(int)


class Log:
    """A candump log of scans and of the gauge."""

    def __init__(self, path):
        self.out, self.time = open(path, "w", encoding="ascii"), 1.6e9

    def frame(self, ident, data):
        self.out.write(f"({self.time:.6f}) can0 {ident:03X}#{data.hex().upper()}\n")
        self.time += 0.000_12

    def scan(self, counts, gauge_kpa):
        begin, first = self.time, 0
        self.frame(GAUGE, round(gauge_kpa * 1000).to_bytes(4, "little", signed=True))
        for address, modules in BOARDS:
            for module in range(modules):
                values = [240] * 12
                values[6] = values[10] = 100
                for k, slot in enumerate(SLOTS):
                    values[slot] = int(counts[first + k])
                first += 10
                ident = 0x400 | address << 4 | module
                self.frame(ident, bytes([0x40, *values[:7]]))
                self.frame(ident, bytes([0xC0, *values[7:], 0, 0]))
        self.time = begin + PERIOD_S

    def close(self):
        self.out.close()


def is_on_skin(x, y):
    """Whether a place in mm lies within a triangle."""
    sides = np.array([(0, -1), (math.cos(math.pi / 6), 0.5), (-math.cos(math.pi / 6), 0.5)])
    place = np.stack([x, y], -1)
    return np.any([((place - centre) * turn @ sides.T <= SPACING_MM / 2).all(-1) for centre, turn in tiling()], axis=0)


def footprint(rng, skin, kind, newton):
    """The pressure of a contact anywhere on the skin, kPa by place in mm: a mass on 600 mm2, or a finger after Hertz.
    At least 95 % of the force are on the skin: the rest cannot be measured."""
    angle = rng.uniform(0, 2 * math.pi)
    if kind == "mass":
        aspect = rng.uniform(1, 2)
        a = math.sqrt(600.0 / math.pi * aspect)
        b, hertz, tilt = a / aspect, rng.random() < 0.5, rng.uniform(0, 0.4)
    else:
        a = b = rng.uniform(4.5, 9.5)
        hertz, tilt = True, 0.0
    mean_kpa = newton / (math.pi * a * b) * 1000

    def about_centre(x, y):
        u, v = (x * math.cos(angle) + y * math.sin(angle)) / a, (y * math.cos(angle) - x * math.sin(angle)) / b
        q = u * u + v * v
        profile = 1.5 * np.sqrt(np.maximum(1 - q, 0)) if hertz else 1.0
        return mean_kpa * np.where(q < 1, profile * (1 + tilt * u), 0.0)

    x, y = np.meshgrid(*[np.arange(-max(a, b), max(a, b), 0.5)] * 2)
    kpa, margin = about_centre(x, y), max(a, b) - 3
    while True:
        centre = rng.uniform(skin.places.min(0) + margin, skin.places.max(0) - margin)
        if kpa[is_on_skin(x + centre[0], y + centre[1])].sum() >= 0.95 * kpa.sum():
            return lambda x, y: about_centre(x - centre[0], y - centre[1])


def positions_file(skin):
    """iCub's file of positions: 192 rows a board, in metres."""
    lines, first = ["name                l_forearm", "spatial_sampling    taxel", "[calibration]"], 0
    for _, modules in BOARDS:
        for module in range(16):
            for slot in range(12):
                if module >= modules:
                    lines.append("0 0 0 0 0 0")
                    continue
                x, y = skin.places[first + SLOTS.index(slot if slot in SLOTS else 3)] / 1000
                lines.append(f"{x:.6f} {y:.6f} 0.0 0 0 1")
            first += 10 if module < modules else 0
    return "\n".join(lines) + "\n"
