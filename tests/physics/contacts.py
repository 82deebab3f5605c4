#!/usr/bin/env python3
"""What a sum over taxels misses of a contact, and whether the table of crates/taxel-engine/src/force/sampling.rs says it.

usage: contacts.py [--seed 1] [--contacts 300] [--errors] [--edge]      needs numpy

Presses made-up contacts of eight shapes on the second simulated skin (skin.py), under layers of 1, 2 and 3 mm, and prints for each
shape the root mean square error of the sum, that of the sum as crates/taxel-engine/src/force/place.rs reads it by its place, what the
table states, and the share of contacts within 95 %. With --errors the root mean
square errors that the table follows from: by effective taxels, and by how many times as long a contact is as a round one. With --edge
what untouched taxels beside a touch bear of a dead zone of 0.3 to 2 kPa; crates/taxel-engine/src/force/measure.rs says, such a share as of
those beside them are touched.
Exit status 1 if less than 85 % of a shape lie within 95 %, or what lies at the edge is off by more than 0.2.
Left out: curvature, holes, hysteresis, and all but 0.35 kPa of noise.
"""

import argparse
import math
import pathlib
import re
import sys

import numpy as np

import skin

LAYERS_MM = (1.0, 2.0, 3.0)
SHAPES = ("round", "ellipse", "skewed", "flat 6", "flat 10", "flat 20", "edge", "two", "mass")
RADII_MM, LARGE = (3.5, 4.5, 5.5, 6.5, 8, 10, 13, 18), 5
NOISE_KPA, TOUCHED_KPA, BESIDE_KPA, RIM = 0.35, 1.4, 0.55, 0.1
SOURCE = pathlib.Path(__file__).parents[2] / "crates/taxel-engine/src/force/sampling.rs"


class Surface:
    """Places, areas and neighbours of the taxels, and which of them lie at the rim."""

    def __init__(self):
        local = skin.triangle()
        self.places = np.concatenate([local * turn + centre for centre, turn in skin.tiling()])
        corner = {1: 0.115, 5: 0.115, 9: 0.115, 3: 0.085}
        share = np.array([corner.get(slot, 0.095) for slot in skin.SLOTS])
        module_mm2 = math.sqrt(3) / 4 * skin.SIDE_MM**2
        self.newton_per_kpa = np.tile(share / share.sum() * module_mm2 * 1e-3, len(skin.tiling()))
        offset = self.places[:, None] - self.places[None]
        apart = np.linalg.norm(offset, axis=2)
        self.beside = (apart < 8) & (apart > 0)
        away = np.where(self.beside[..., None], offset / np.where(apart > 0, apart, 1)[..., None], 0).sum(1)
        self.at_rim = np.linalg.norm(away, axis=1) >= 0.4 * np.maximum(self.beside.sum(1), 1)
        self.stencils = {depth: skin.layer_stencil(depth) for depth in LAYERS_MM}
        self.discs = [self.disc_kpa(radius) for radius in RADII_MM]

    def disc_kpa(self, radius):
        """What a pad so far from the centre of a disc of 1 N feels under 2 mm of layer, mm and kPa."""
        x, y, weights = skin.layer_stencil(2.0)
        r = np.arange(0, 30, 0.25)
        within = 1 - ((r[:, None] + x) ** 2 + y**2) / radius**2
        return r, 1.5e3 / (math.pi * radius**2) * np.sqrt(np.maximum(within, 0)) @ weights

    def factor(self, centre, taxels):
        """How many times its sum a round contact is: one over what is read of the disc about there that as many taxels carry."""
        apart = np.linalg.norm(self.places - centre, axis=1)
        kpa = np.array([np.interp(apart, *disc, right=0) for disc in self.discs])
        carried = np.where(kpa > 0.03 * np.array([disc[1][0] for disc in self.discs])[:, None], kpa, 0)
        carry = np.maximum.accumulate(carried.sum(1) ** 2 / np.maximum((carried**2).sum(1), 1e-9))
        # Large ones keep their sum.
        return 1 / np.interp(taxels, carry, np.where(np.arange(len(RADII_MM)) < LARGE, kpa @ self.newton_per_kpa, 1))

    def pads_kpa(self, pressure, layer_mm):
        x, y, weights = self.stencils[layer_mm]
        return (pressure(self.places[:, 0, None] + x, self.places[:, 1, None] + y) * weights).sum(1)

    def parts(self, touched):
        """The contacts that touched taxels form, each as a mask."""
        left = touched.copy()
        while left.any():
            part = np.zeros(len(left), bool)
            part[np.flatnonzero(left)[0]] = True
            while (grown := touched & (part | self.beside[part].any(0))).sum() > part.sum():
                part = grown
            left &= ~part
            yield part


def shape(rng, surface, kind):
    """The pressure of 1 N, kPa by place in mm."""
    angle = rng.uniform(0, 2 * math.pi)
    along = np.array([math.cos(angle), math.sin(angle)])
    centre = rng.uniform(surface.places.min(0) + 14, surface.places.max(0) - 14)

    def ellipse(a, b, about=centre, hertz=True, tilt=0.0):
        def pressure(x, y):
            u = ((x - about[0]) * along[0] + (y - about[1]) * along[1]) / a
            v = ((y - about[1]) * along[0] - (x - about[0]) * along[1]) / b
            q = u * u + v * v
            return 1e3 / (math.pi * a * b) * np.where(q < 1, (1.5 * np.sqrt(np.maximum(1 - q, 0)) if hertz else 1) * (1 + tilt * u), 0)
        return pressure

    if kind == "edge":
        half = rng.uniform(7.5, 15)
        def edge(x, y):
            u = (x - centre[0]) * along[0] + (y - centre[1]) * along[1]
            v = (y - centre[1]) * along[0] - (x - centre[0]) * along[1]
            return 1e3 / (2 * half * 2) * ((abs(u) < half) & (abs(v) < 1))
        return edge
    if kind == "two":
        radius = rng.uniform(4.5, 8)
        pair = [ellipse(radius, radius, centre + side * 12.5 * along) for side in (-1, 1)]
        return lambda x, y: 0.5 * (pair[0](x, y) + pair[1](x, y))
    if kind == "mass":
        aspect = rng.uniform(1, 2)
        a = math.sqrt(600 / math.pi * aspect)
        return ellipse(a, a / aspect, hertz=rng.random() < 0.5, tilt=rng.uniform(0, 0.4))
    if kind.startswith("flat"):
        return ellipse(*[float(kind.split()[1]) / 2] * 2, hertz=False)
    radius, aspect = rng.uniform(4.5, 9.5), 1.0 if kind == "round" else rng.uniform(1.3, 2.2)
    tilt = rng.uniform(0.3, 0.8) if kind == "skewed" else 0.0
    return ellipse(radius * math.sqrt(aspect), radius / math.sqrt(aspect), tilt=tilt)


def press(rng, surface, kind, layer_mm):
    """Relative errors of the sum, and of it read by place; newtons; of each part its force, effective taxels, length over a round one's,
    share at the rim; or None."""
    newton = rng.uniform(2, 10) if kind == "mass" else rng.uniform(1.5, 8)
    kpa = newton * surface.pads_kpa(shape(rng, surface, kind), layer_mm)
    read = kpa + rng.normal(0, NOISE_KPA, len(kpa)) * (1 + kpa / 40)
    touched = read > TOUCHED_KPA
    if not touched.any():
        return None
    touched |= surface.beside[touched].any(0) & (read > BESIDE_KPA)
    summed = touched | surface.beside[touched].any(0)
    parts, placed_n = [], 0.0
    for part in surface.parts(touched):
        p = np.where(part, read, 0)
        force_n, taxels = surface.newton_per_kpa @ p, p.sum() ** 2 / (p @ p)
        centre = p @ surface.places / p.sum()
        apart = surface.places - centre
        length_mm = math.sqrt(max(np.linalg.eigvalsh((p[:, None] * apart).T @ apart / p.sum())[1], 0))
        longness = length_mm / (0.293 * math.sqrt(taxels * 1e3 * force_n / p.sum()))
        round_share = 1 - min(max((longness - 1.1) / 0.2, 0), 1)
        placed_n += force_n * (1 + round_share * (min(max(surface.factor(centre, taxels), 0.7), 1.6) - 1))
        parts.append((force_n, taxels, longness, surface.newton_per_kpa @ (p * surface.at_rim) / force_n))
    sum_n = surface.newton_per_kpa @ np.where(summed, read, 0)
    placed_n *= sum_n / sum(part[0] for part in parts)
    return [sum_n / newton - 1, placed_n / newton - 1], newton, parts


def stated(table, newton, parts):
    """Relative standard uncertainty as sampling.rs states it, with that of the rim and 0.06 N of noise."""
    def of(taxels, longness):
        long = min(max((longness - 1.1) / 0.2, 0), 1)
        return (1 - long) * np.interp(taxels, table[:, 0], table[:, 1]) + long * np.interp(taxels, table[:, 0], table[:, 2])
    sampling = sum((of(taxels, longness) * force) ** 2 for force, taxels, longness, _ in parts)
    return math.sqrt(sampling + (RIM * sum(force * rim for force, _, _, rim in parts)) ** 2 + 0.06**2) / newton


def edge(rng, surface, contacts):
    """Mean share of its dead zone that an untouched taxel bears, by the share of those beside it that are touched."""
    shares = {}
    around, inner = surface.beside.sum(1), ~surface.at_rim
    for kind in SHAPES:
        for layer_mm in LAYERS_MM * contacts:
            kpa = rng.uniform(1.5, 8) * surface.pads_kpa(shape(rng, surface, kind), layer_mm)
            zone_kpa = math.exp(rng.uniform(math.log(0.3), math.log(2)))
            touched = kpa > zone_kpa + BESIDE_KPA
            lit = (surface.beside & touched).sum(1)
            for taxel in np.flatnonzero(inner & ~touched & (lit > 0)):
                shares.setdefault(round(12 * lit[taxel] / around[taxel]), []).append(min(kpa[taxel] / zone_kpa, 1))
    print("\n| touched of those beside | taxels | share of the dead zone |\n|---|---|---|")
    for twelfths, of in sorted(shares.items()):
        print(f"| {twelfths / 12:.2f} | {len(of)} | {np.mean(of):.2f} |")
        if len(of) >= 100 and abs(np.mean(of) - twelfths / 12) > 0.2:
            sys.exit("what lies at the edge of a touch is not as stated")


def rms(values):
    return math.sqrt(np.mean(np.square(values))) if len(values) else math.nan


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--contacts", type=int, default=300, help="of each shape under each layer")
    parser.add_argument("--errors", action="store_true")
    parser.add_argument("--edge", action="store_true")
    args = parser.parse_args()
    rows = re.search(r"BY_TAXELS[^=]*= \[(.*?)\];", SOURCE.read_text(encoding="utf-8"), re.S)[1]
    table = np.array([[float(x) for x in row.split(",")] for row in re.findall(r"\[([^\]]+)\]", rows)])
    rng, surface, alone, least = np.random.default_rng(args.seed), Surface(), [], 1.0
    print("| shape | contacts | of the sum, rms | by place | stated | stated over error | within 95 % |\n|---|---|---|---|---|---|---|")
    for kind in SHAPES:
        pressed = [press(rng, surface, kind, layer) for layer in LAYERS_MM for _ in range(args.contacts)]
        pressed = [one for one in pressed if one]
        sums, errors = np.array([both for both, _, _ in pressed]).T
        says = np.array([stated(table, newton, parts) for _, newton, parts in pressed])
        within = np.mean(abs(errors) < 1.96 * says)
        least = min(least, within)
        print(f"| {kind} | {len(pressed)} | {100 * rms(sums):.1f} % | {100 * rms(errors):.1f} % | {100 * rms(says):.1f} % | {rms(says) / rms(errors):.2f} | "
              f"{100 * within:.0f} % |", flush=True)
        alone += [(*parts[0][1:3], both[1]) for both, _, parts in pressed if len(parts) == 1 and parts[0][3] < 0.1]
    if args.errors:
        alone, lengths = np.array(alone), [0, 0.95, 1.05, 1.15, 1.25, 1.4, 9]
        print("\neffective taxels, then errors by length from " + ", ".join(map(str, lengths)))
        for low, high in zip(edges := [1, 1.25, 1.6, 2, 2.5, 3, 3.6, 4.4, 5.2, 6.5, 8, 10, 13, 99], edges[1:]):
            of = alone[(alone[:, 0] >= low) & (alone[:, 0] < high)]
            by = [of[(of[:, 1] >= a) & (of[:, 1] < b), 2] for a, b in zip(lengths, lengths[1:])]
            print(f"{of[:, 0].mean():5.2f} " + " ".join(f"{100 * rms(e):6.1f} % ({len(e)})" for e in by))

    if args.edge:
        edge(rng, surface, args.contacts)
    if least < 0.85:
        sys.exit(f"{100 * least:.0f} % of a shape lie within what is said to hold 95 %")


if __name__ == "__main__":
    main()
