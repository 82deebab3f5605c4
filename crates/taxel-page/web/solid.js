// The skin in space: where each taxel is seen from a side that is turned by hand, and the force as an arrow.

import { directions, mean, sub, dot, cross, unit, scaled, vector } from "./unroll.js";

/** How far the drag of a pixel turns the skin, in radians. */
const TURN_PER_PX = 0.01;
/** Length of the arrow of the force, in mm. */
const ARROW_MM = 60;

export class Solid {
  constructor(skin) {
    const places = skin.taxels.map((taxel) => (taxel.positionM ? vector(taxel.positionM, 1000) : null));
    const known = places.filter(Boolean);
    this.middle = mean(known);
    this.places = places.map((place) => place && sub(place, this.middle));
    this.normals = skin.taxels.map((taxel) => (taxel.normal ? vector(taxel.normal) : null));
    this.radius = Math.max(...this.places.filter(Boolean).map((place) => Math.hypot(...place))) + 10;
    // At first its length lies across the screen, and most of its normals point here.
    const [, , right] = directions(known, this.middle);
    const outward = mean(this.normals.filter(Boolean));
    const away = sub(outward, scaled(right, dot(outward, right)));
    const towards = Math.hypot(...away) > 0.05 ? unit(away) : directions(known, this.middle)[0];
    this.frame = { right, up: cross(towards, right), towards };
  }

  /** Turns it by a drag of so many pixels. */
  turn(dx, dy) {
    const { right, up, towards } = this.frame;
    const about = (p, q, angle) => [sub(scaled(p, Math.cos(angle)), scaled(q, Math.sin(angle))), sub(scaled(q, Math.cos(angle)), scaled(p, -Math.sin(angle)))];
    const [across, first] = about(right, towards, -dx * TURN_PER_PX);
    const [upright, last] = about(up, first, dy * TURN_PER_PX);
    this.frame = { right: unit(across), up: unit(upright), towards: unit(last) };
  }

  /** Takes a canvas of this size. */
  fit(width, height) {
    this.k = Math.min(width, height) / (2 * this.radius);
    this.centre = [width / 2, height / 2];
  }

  /** Where a place from the middle, in mm, is on the canvas. */
  on(place) {
    return [this.centre[0] + this.k * dot(place, this.frame.right), this.centre[1] - this.k * dot(place, this.frame.up)];
  }

  /** Taxels as they are seen: where, how near, whether from outside, and a disc how narrow in which direction. */
  seen() {
    const { right, up, towards } = this.frame;
    return this.places.map((place, taxel) => {
      const normal = this.normals[taxel] ?? towards;
      return {
        at: place ? this.on(place) : [NaN, NaN],
        near: place ? dot(place, towards) : -Infinity,
        outside: dot(normal, towards) > 0,
        width: Math.max(0.2, Math.abs(dot(normal, towards))),
        angle: Math.atan2(-dot(normal, up), dot(normal, right)),
      };
    });
  }

  /** The ends of the arrow of a force that acts on the skin; its head is where it acts. */
  arrow(force) {
    if (!force.centreOfPressureM || !force.resultantN) return null;
    const head = sub(vector(force.centreOfPressureM, 1000), this.middle);
    const tail = sub(head, scaled(unit(vector(force.resultantN)), ARROW_MM));
    return [this.on(tail), this.on(head)];
  }
}
