// Charts on a canvas: axes with round numbers, lines, bands and points.

import { el } from "./dom.js";
import { on } from "./store.js";
import { colours, sharp } from "./skin.js";
import { ticks } from "./ticks.js";

const short = (value) => Number(value.toPrecision(4)).toString();

/** A chart that draws what `describe()` gives whenever `draw` is called. */
export class Chart {
  constructor(signal, label, describe, { tall = false } = {}) {
    this.describe = describe;
    this.node = el(tall ? "canvas.chart.tall" : "canvas.chart", { role: "img", "aria-label": label });
    this.signal = signal;
    on("theme", () => this.soon(), signal);
    const observer = new ResizeObserver(() => this.soon());
    observer.observe(this.node);
    signal.addEventListener("abort", () => observer.disconnect());
    const point = (x) => () => { this.pointer = x; this.soon(); };
    this.node.addEventListener("pointermove", (event) => point(event.offsetX)());
    this.node.addEventListener("pointerleave", point(null));
  }

  soon() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; if (!this.signal.aborted) this.draw(); });
  }

  draw() {
    const { g, width, height } = sharp(this.node);
    const what = this.describe();
    if (!what || !width) return;
    const tint = colours();
    const [left, right, top, bottom] = [44, 10, 10, 34];
    const [[x0, x1], [y0, y1]] = [what.x, what.y];
    this.px = (x) => left + ((x - x0) / (x1 - x0 || 1)) * (width - left - right);
    this.py = (y) => height - bottom - ((y - y0) / (y1 - y0 || 1)) * (height - top - bottom);
    this.axes(g, tint, what, { width, height, left, right, top, bottom });
    g.save();
    g.beginPath();
    g.rect(left, top - 4, width - left - right + 4, height - top - bottom + 8);
    g.clip();
    for (const layer of what.layers) this[layer.kind](g, tint, layer, { top, foot: height - bottom });
    if (what.nearest && this.pointer) this.reading(g, tint, what.nearest(x0 + ((this.pointer - left) / (width - left - right)) * (x1 - x0)), { top, foot: height - bottom, right: width - right });
    g.restore();
  }

  /** The value under the pointer: `{ x, text }`. */
  reading(g, tint, found, { top, foot, right }) {
    if (!found) return;
    const x = this.px(found.x);
    g.strokeStyle = g.fillStyle = tint.ink;
    g.lineWidth = 1;
    g.beginPath(); g.moveTo(x, top); g.lineTo(x, foot); g.stroke();
    g.font = "600 12px system-ui, sans-serif";
    g.textBaseline = "top";
    g.textAlign = x + g.measureText(found.text).width + 8 > right ? "right" : "left";
    g.fillText(found.text, x + (g.textAlign === "right" ? -5 : 5), top);
  }

  axes(g, tint, what, { width, height, left, right, top, bottom }) {
    g.font = "11px system-ui, sans-serif";
    g.strokeStyle = tint.faint;
    g.fillStyle = tint.soft;
    g.lineWidth = 1;
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const y of ticks(...what.y, Math.max(2, (height - top - bottom) / 36))) {
      g.beginPath(); g.moveTo(left, this.py(y)); g.lineTo(width - right, this.py(y)); g.stroke();
      g.fillText(short(y), left - 5, this.py(y));
    }
    g.textAlign = "center";
    g.textBaseline = "top";
    for (const x of ticks(...what.x, Math.max(2, (width - left - right) / 70))) g.fillText(short(x), this.px(x), height - bottom + 4);
    g.fillText(what.xLabel, (left + width - right) / 2, height - 14);
    g.save();
    g.translate(9, (top + height - bottom) / 2);
    g.rotate(-Math.PI / 2);
    g.textBaseline = "middle";
    g.fillText(what.yLabel, 0, 0);
    g.restore();
  }

  /** `points` of [x, y]; a y that is no number breaks the line. */
  line(g, tint, { points, colour = "green", dash = [], width = 2 }) {
    g.beginPath();
    let down = false;
    for (const [x, y] of points) {
      if (!Number.isFinite(y)) { down = false; continue; }
      g[down ? "lineTo" : "moveTo"](this.px(x), this.py(y));
      down = true;
    }
    g.setLineDash(dash);
    g.lineWidth = width;
    g.strokeStyle = tint[colour];
    g.stroke();
    g.setLineDash([]);
  }

  /** `points` of [x, low, high]. */
  band(g, tint, { points }) {
    g.fillStyle = tint.band;
    let run = [];
    const flush = () => {
      if (run.length > 1) {
        g.beginPath();
        run.forEach(([x, , high]) => g.lineTo(this.px(x), this.py(high)));
        run.reverse().forEach(([x, low]) => g.lineTo(this.px(x), this.py(low)));
        g.fill();
      }
      run = [];
    };
    for (const point of points) Number.isFinite(point[1] + point[2]) ? run.push(point) : flush();
    flush();
  }

  /** Dots at `points` of [x, y], each with a bar from `low` to `high` if it has them. */
  dots(g, tint, { points, colour = "ink", size = 3 }) {
    g.fillStyle = g.strokeStyle = tint[colour];
    g.lineWidth = 1.5;
    for (const [x, y, low, high] of points) {
      if (low !== undefined) { g.beginPath(); g.moveTo(this.px(x), this.py(low)); g.lineTo(this.px(x), this.py(high)); g.stroke(); }
      g.beginPath(); g.arc(this.px(x), this.py(y), size, 0, 2 * Math.PI); g.fill();
    }
  }

  /** A dashed line across at `y`, with what it is. */
  level(g, tint, { y, text, colour = "blue" }) {
    g.strokeStyle = g.fillStyle = tint[colour];
    g.lineWidth = 1.5;
    g.setLineDash([6, 4]);
    g.beginPath(); g.moveTo(0, this.py(y)); g.lineTo(this.node.clientWidth, this.py(y)); g.stroke();
    g.setLineDash([]);
    g.textAlign = "left";
    g.textBaseline = "bottom";
    g.lineWidth = 4;
    g.strokeStyle = tint.card; // what lies behind must not hide the words
    g.strokeText(text, 50, this.py(y) - 2);
    g.fillText(text, 50, this.py(y) - 2);
  }

  /** Hatched stretches from x to x: there was nothing that could be shown. */
  gaps(g, tint, { spans }, { top, foot }) {
    g.strokeStyle = tint.red;
    g.lineWidth = 1;
    g.globalAlpha = 0.5;
    for (const [from, to] of spans) {
      const [a, b] = [this.px(from), this.px(to)];
      g.save();
      g.beginPath(); g.rect(a, top, b - a, foot - top); g.clip();
      g.beginPath();
      for (let x = a - (foot - top) - ((a - (foot - top)) % 9); x < b; x += 9) { g.moveTo(x, foot); g.lineTo(x + foot - top, top); }
      g.stroke();
      g.restore();
    }
    g.globalAlpha = 1;
  }
}
