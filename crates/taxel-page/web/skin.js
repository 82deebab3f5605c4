// The skin as a picture: each taxel filled by what it reads, and by its outline what to think of that.

import { el, num } from "./dom.js";
import { Solid } from "./solid.js";
import { ticks } from "./ticks.js";
import { isOld, on, select, state, verdict } from "./store.js";

/** What a taxel can be beside its reading: told apart by shape, not by colour. First match counts. */
export const KINDS = [
  ["never", "never received"],
  ["silent", "silent"],
  ["saturated", "saturated"],
  ["faulty", "faulty"],
  ["excluded", "excluded"],
  ["extrapolated", "beyond calibration"],
  ["active", "active"],
  ["plain", "unloaded"],
];

/** Which of them a taxel is now. */
export function kindOf(reading, layout) {
  if (!reading || reading.count === undefined) return "never";
  if (reading.stale || isOld()) return "silent";
  const faults = reading.faults ?? [];
  if (faults.includes("saturated") || faults.includes("out of range by status")) return "saturated";
  if (faults.length) return "faulty";
  if (!reading.calibrated && state.skin?.modelSet && layout?.exclusion) return "excluded";
  if (reading.range === "RANGE_ABOVE") return "extrapolated";
  return reading.active ? "active" : "plain";
}

const STEPS_KPA = [5, 10, 20, 35, 70, 100, 200];
const STEPS_COUNTS = [20, 40, 80, 160, 255];

/** The colours of the page as they are now. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const get = (name) => style.getPropertyValue(`--${name}`).trim();
  // Even steps of lightness, so that equal steps of pressure look equally far apart, also in grey and to the colour-blind.
  const [low, high] = [Number(get("low")), Number(get("high"))];
  const ramp = Array.from({ length: 65 }, (_, i) => `oklch(${low + ((high - low) * i) / 64} ${0.02 + 0.14 * Math.sin((Math.PI * i) / 90)} ${110 + (170 * i) / 64})`);
  return { ramp, ink: get("ink"), soft: get("soft"), line: get("line"), card: get("card"), red: get("red"), amber: get("amber"), green: get("green"), blue: get("blue"), faint: get("faint"), band: get("band") };
}

/** Draws one taxel: `share` of the scale, or nothing known. */
export function drawTaxel(g, kind, share, x, y, r, tint) {
  g.beginPath();
  if (kind === "saturated") g.rect(x - r * 0.88, y - r * 0.88, 1.76 * r, 1.76 * r);
  else g.arc(x, y, r, 0, 2 * Math.PI);
  const filled = ["saturated", "extrapolated", "active", "plain"].includes(kind);
  g.fillStyle = filled ? tint.ramp[Math.round(64 * Math.max(0, Math.min(1, share || 0)))] : tint.card;
  g.fill();
  g.setLineDash(kind === "silent" || kind === "never" ? [r * 0.5, r * 0.45] : []);
  g.lineWidth = kind === "active" || kind === "extrapolated" || kind === "saturated" ? Math.max(1.4, r * 0.24) : Math.max(0.7, r * 0.1);
  g.strokeStyle = kind === "plain" ? tint.line : kind === "silent" || kind === "excluded" || kind === "never" ? tint.soft : tint.ink;
  g.stroke();
  g.setLineDash([]);
  g.lineWidth = Math.max(1.2, r * 0.2);
  g.beginPath();
  const k = r * 0.55;
  if (kind === "faulty") { g.moveTo(x - k, y - k); g.lineTo(x + k, y + k); g.moveTo(x + k, y - k); g.lineTo(x - k, y + k); }
  if (kind === "excluded") { g.moveTo(x - k, y + k); g.lineTo(x + k, y - k); }
  if (kind === "silent") { g.moveTo(x - k, y); g.lineTo(x + k, y); }
  if (kind === "saturated") { g.moveTo(x - k, y - k * 0.6); g.lineTo(x + k, y - k * 0.6); g.moveTo(x - k, y); g.lineTo(x + k, y); }
  g.stroke();
  if (kind === "extrapolated") {
    g.beginPath();
    g.moveTo(x, y - k); g.lineTo(x + k * 0.9, y + k * 0.7); g.lineTo(x - k * 0.9, y + k * 0.7); g.closePath();
    g.fillStyle = tint.card; g.fill(); g.strokeStyle = tint.ink; g.lineWidth = Math.max(0.8, r * 0.1); g.stroke();
  }
}

/** A canvas as sharp as the screen; gives its context in CSS pixels. */
export function sharp(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, height);
  return { g, width, height };
}

/** The skin on a canvas of its own. `values` says what fills it: `kpa` or `counts`; `excluded`, if it is set,
 * which taxels a model set excludes that is not in use yet. */
export class SkinView {
  constructor(signal, { values = "kpa", overlays = true } = {}) {
    Object.assign(this, { values, overlays, top: null, marked: null, peak: 0, rest: null, restFrames: 0, waiting: false, drawn: 0, solid: null });
    this.canvas = el("canvas.skin", { tabindex: "0", role: "img", "aria-label": "The skin laid flat. Arrow keys go from taxel to taxel." });
    this.scale = el("canvas.scale", { role: "img" });
    this.node = el("div", this.canvas, this.legend());
    this.signal = signal;
    for (const name of ["taxels", "shown", "skin", "selected", "theme"]) on(name, () => this.soon(), signal);
    on("skin", () => { this.rest = null; if (this.solid) this.inSpace(true); }, signal);
    on("taxels", () => this.learnRest(), signal);
    const observer = new ResizeObserver(() => this.soon());
    observer.observe(this.canvas);
    signal.addEventListener("abort", () => observer.disconnect());
    // Also when nothing comes: what was drawn last must not look like what is.
    const timer = setInterval(() => this.old !== isOld() && this.soon(), 200);
    signal.addEventListener("abort", () => clearInterval(timer));
    this.canvas.addEventListener("pointermove", (event) => {
      if (this.solid && event.buttons) { this.solid.turn(event.movementX, event.movementY); this.soon(); }
      else if (event.pointerType === "mouse") this.point(event);
    });
    this.canvas.addEventListener("pointerdown", (event) => this.point(event));
    this.canvas.addEventListener("keydown", (event) => this.step(event));
  }

  legend() {
    const entries = KINDS.map(([kind, text]) => {
      const canvas = el("canvas");
      return { kind, canvas, node: el("span", canvas, text) };
    });
    this.drawLegend = () => {
      const tint = colours();
      for (const { kind, canvas } of entries) {
        const { g } = sharp(canvas);
        drawTaxel(g, kind, kind === "plain" ? 0 : 0.6, 10, 10, 7.5, tint);
      }
    };
    on("theme", () => this.drawLegend?.(), this.signal);
    requestAnimationFrame(() => this.drawLegend());
    return el("div.legend", this.scale, entries.map((entry) => entry.node));
  }

  /** The colours with their values, where they are others than before. */
  drawScale(top, tint) {
    const label = `0 to ${top} ${this.values === "kpa" ? "kPa" : "counts"}`;
    if (this.scaleOf === label + tint.ink || !this.scale.clientWidth) return;
    this.scaleOf = label + tint.ink;
    this.scale.setAttribute("aria-label", label);
    const { g, width } = sharp(this.scale);
    const at = (share) => 8 + share * (width - 16 - 40);
    tint.ramp.forEach((colour, i) => { g.fillStyle = colour; g.fillRect(at(i / 65), 0, at(1 / 65) - at(0) + 1, 12); });
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = tint.soft;
    g.textAlign = "center";
    for (const value of ticks(0, top, 4)) g.fillText(String(value), at(value / top), 25);
    g.textAlign = "left";
    g.fillText(this.values === "kpa" ? "kPa" : "counts", at(1) + 10, 12);
  }

  /** Counts at rest as this page saw them first, where no model says what they are. */
  learnRest() {
    const taxels = state.taxels?.taxels;
    if (!taxels || this.restFrames >= 20) return;
    this.rest ??= new Float32Array(taxels.length);
    this.restFrames += 1;
    taxels.forEach((taxel, i) => { this.rest[i] += ((taxel.count ?? 0) - this.rest[i]) / this.restFrames; });
  }

  /** Takes the present counts for those at rest. */
  setRest() {
    this.rest = null;
    this.restFrames = 0;
  }

  /** What fills a taxel: its pressure, or how far its count is from rest. */
  value(reading, taxel) {
    if (this.values === "kpa") return reading.pressureKpa;
    const rest = state.modelSet?.taxels?.[taxel]?.figures?.baseline_counts ?? this.rest?.[taxel];
    return reading.count === undefined || rest === undefined ? undefined : Math.abs(reading.count - rest);
  }

  soon() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; if (!this.signal.aborted) this.draw(); });
  }

  fit(width, height) {
    const { box } = state.layout;
    this.turned = (box.right - box.left > box.bottom - box.top) !== width > height;
    const [w, h] = [box.right - box.left, box.bottom - box.top];
    const [across, down] = this.turned ? [h, w] : [w, h];
    const k = Math.min(width / across, height / down);
    const [x0, y0] = [(width - across * k) / 2, (height - down * k) / 2];
    this.k = k;
    // Turned by a quarter, not mirrored.
    this.place = ([x, y]) => (this.turned ? [x0 + (box.bottom - y) * k, y0 + (x - box.left) * k] : [x0 + (x - box.left) * k, y0 + (y - box.top) * k]);
    this.turn = ([x, y]) => (this.turned ? [-y, x] : [x, y]);
  }

  /** Shows the skin in space, to be turned by dragging it, or laid flat. */
  inSpace(wanted) {
    this.solid = wanted && state.layout?.hasPositions ? new Solid(state.skin) : null;
    this.canvas.style.touchAction = this.solid ? "none" : "";
    this.soon();
  }

  /** Where the taxels are on the canvas, those that are drawn last at the end. */
  lay(g, tint, width, height) {
    if (this.solid) {
      this.solid.fit(width, height);
      this.k = this.solid.k;
      const seen = this.solid.seen();
      this.at = seen.map(({ at }) => at);
      this.seen = seen;
      return seen.map(({ near }, t) => [near, t]).sort((a, b) => a[0] - b[0]).map(([, t]) => t);
    }
    this.fit(width, height);
    this.outlines(g, tint);
    this.at = state.layout.points.map((point) => this.place([point.x, point.y]));
    this.seen = null;
    return this.at.map((_, t) => t);
  }

  /** A disc that is seen from the side is narrow, and one from inside faint. */
  lean(g, { outside, width, angle }) {
    g.globalAlpha = outside ? 1 : 0.2;
    g.rotate(angle);
    g.scale(width, 1);
    g.rotate(-angle);
  }

  draw() {
    const { g, width, height } = sharp(this.canvas);
    if (!state.layout || !width) return;
    const tint = colours();
    const order = this.lay(g, tint, width, height);
    const readings = state.taxels?.taxels ?? [];
    const steps = this.values === "kpa" ? STEPS_KPA : STEPS_COUNTS;
    const values = state.layout.points.map((_, t) => (readings[t] ? this.value(readings[t], t) : undefined));
    const most = values.reduce((high, v, t) => (v > high && !(readings[t].faults ?? []).length ? v : high), 0);
    this.peak = Math.max(most, this.peak * 0.995);
    const top = this.top ?? steps.find((step) => step >= this.peak) ?? steps.at(-1);
    this.drawScale(top, tint);
    const kinds = this.at.map((_, t) => (this.excluded?.has(t) ? "excluded" : kindOf(readings[t], state.skin.taxels[t])));
    // Where modules lie close together, what is marked lies on top; in space what is nearer.
    for (const marked of this.solid ? [null] : [false, true]) {
      for (const t of order) {
        if (marked !== null && (kinds[t] !== "plain") !== marked) continue;
        g.save();
        g.translate(...this.at[t]);
        if (this.seen) this.lean(g, this.seen[t]);
        drawTaxel(g, kinds[t], values[t] / top, 0, 0, state.layout.radii[t] * this.k, tint);
        g.restore();
      }
    }
    for (const taxel of this.marked ?? []) if (this.at[taxel]) this.ring(g, tint, taxel, tint.amber);
    if (state.selected !== null && this.at[state.selected]) this.ring(g, tint, state.selected, tint.blue);
    if (this.overlays) this.overlay(g, tint);
    this.old = isOld();
    this.drawn += 1;
    this.canvas.dataset.drawn = this.drawn;
  }

  outlines(g, tint) {
    g.lineWidth = 1;
    g.strokeStyle = tint.line;
    g.fillStyle = tint.faint;
    g.lineJoin = "round";
    for (const { hull } of state.layout.modules) {
      g.beginPath();
      hull.forEach((p) => g.lineTo(...this.place(p)));
      g.closePath();
      g.fill();
      g.stroke();
    }
  }

  ring(g, tint, taxel, colour) {
    g.beginPath();
    g.arc(...this.at[taxel], state.layout.radii[taxel] * this.k + 4, 0, 2 * Math.PI);
    g.lineWidth = 3;
    g.strokeStyle = colour;
    g.stroke();
  }

  /** Marks these taxels; none with nothing. */
  mark(taxels) {
    this.marked = taxels;
    this.soon();
  }

  /** Contacts, the centre of pressure and the direction of the force, while there is one to be shown. */
  overlay(g, tint) {
    const force = state.shown ?? state.force; // of the very sample whose number is shown beside it
    if (!force || !verdict().shown) return;
    if (this.solid) return this.arrow(g, tint, this.solid.arrow(force));
    g.font = "600 12px system-ui, sans-serif";
    g.textAlign = "center";
    for (const contact of force.contacts ?? []) {
      const place = contact.centreM && state.layout.project(contact.centreM);
      if (!place) continue;
      const [x, y] = this.place([place.x, place.y]);
      const r = Math.max(14, 3.4 * this.k * Math.sqrt(contact.taxels?.length ?? 1));
      g.beginPath();
      g.setLineDash([6, 4]);
      g.arc(x, y, r, 0, 2 * Math.PI);
      g.lineWidth = 2;
      g.strokeStyle = tint.ink;
      g.stroke();
      g.setLineDash([]);
      this.label(g, tint, `${num(contact.forceN)} N`, x, y - r - 6);
    }
    this.centre(g, tint, force);
  }

  centre(g, tint, force) {
    const place = force.centreOfPressureM && state.layout.project(force.centreOfPressureM);
    if (!place) return;
    const [x, y] = this.place([place.x, place.y]);
    g.lineWidth = 2.5;
    g.strokeStyle = tint.blue;
    g.beginPath();
    g.moveTo(x - 9, y); g.lineTo(x + 9, y); g.moveTo(x, y - 9); g.lineTo(x, y + 9);
    g.stroke();
    if (!force.resultantN || !place.axes) return;
    const f = [force.resultantN.x ?? 0, force.resultantN.y ?? 0, force.resultantN.z ?? 0];
    const on = (axis) => f[0] * axis[0] + f[1] * axis[1] + f[2] * axis[2];
    const total = Math.hypot(...f) || 1;
    const [dx, dy] = this.turn([on(place.axes.along) / total, on(place.axes.around) / total]);
    const length = 60 * Math.hypot(dx, dy);
    if (length < 6) return;
    this.arrow(g, tint, [[x, y], [x + 60 * dx, y + 60 * dy]]);
  }

  /** An arrow from one place to another. */
  arrow(g, tint, ends) {
    if (!ends) return;
    const [[x, y], [ex, ey]] = ends;
    const length = Math.hypot(ex - x, ey - y) || 1;
    const [ux, uy] = [(ex - x) / length, (ey - y) / length];
    g.lineWidth = 2.5;
    g.strokeStyle = tint.blue;
    g.beginPath();
    g.moveTo(x, y); g.lineTo(ex, ey);
    g.moveTo(ex - 7 * ux + 4 * uy, ey - 7 * uy - 4 * ux); g.lineTo(ex, ey); g.lineTo(ex - 7 * ux - 4 * uy, ey - 7 * uy + 4 * ux);
    g.stroke();
  }

  label(g, tint, text, x, y) {
    const half = g.measureText(text).width / 2 + 4;
    const middle = Math.max(half, Math.min(this.canvas.clientWidth - half, x));
    const down = Math.max(14, y);
    g.fillStyle = tint.card;
    g.globalAlpha = 0.85;
    g.fillRect(middle - half, down - 12, 2 * half, 16);
    g.globalAlpha = 1;
    g.fillStyle = tint.ink;
    g.fillText(text, middle, down);
  }

  nearest(x, y, fits = () => true) {
    let [best, least] = [null, Infinity];
    (this.at ?? []).forEach(([tx, ty], t) => {
      const distance = Math.hypot(tx - x, ty - y);
      if (distance < least && this.seen?.[t].outside !== false && fits(tx - x, ty - y, t)) [best, least] = [t, distance];
    });
    return { taxel: best, distance: least };
  }

  point(event) {
    const { taxel, distance } = this.nearest(event.offsetX, event.offsetY);
    if (taxel !== null && distance < Math.max(14, 4 * this.k) && taxel !== state.selected) select(taxel);
  }

  step(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (event.key === "Escape") select(null);
    if (!way || !this.at) return;
    event.preventDefault();
    const [x, y] = this.at[state.selected ?? 0];
    const ahead = (dx, dy, t) => t !== state.selected && dx * way[0] + dy * way[1] > 0.7 * Math.hypot(dx, dy);
    const { taxel } = state.selected === null ? { taxel: 0 } : this.nearest(x, y, ahead);
    if (taxel !== null) select(taxel);
  }
}
