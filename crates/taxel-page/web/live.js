// The force now, and the skin.

import { call } from "./api.js";
import { Chart } from "./chart.js";
import { button, download, el, facts, num, put, toast, whoConfirms } from "./dom.js";
import { SkinView } from "./skin.js";
import { COURSE_S, GAP_S, age, emit, on, state, verdict } from "./store.js";
import { taxelCard } from "./taxel.js";

/** How often the force is judged and written anew, in ms: also when nothing comes, and no faster than it can be read. */
const LOOK_EVERY_MS = 100;

const xyz = (v, k, unit, places) => (v ? `${num((v.x ?? 0) * k, places)}, ${num((v.y ?? 0) * k, places)}, ${num((v.z ?? 0) * k, places)} ${unit}` : undefined);

/** How often the budget is asked for while it is shown, in ms. */
const BUDGET_EVERY_MS = 1000;

/** What the terms of the budget are, in words. */
const TERMS = {
  readings: "noise of each taxel", choice: "a light touch may be noise", zero: "the zero may have moved",
  hysteresis: "hysteresis", unloading: "a load that decreases", curve: "fit of the curves", "beyond range": "beyond the calibrated range", gauge: "the pressure gauge",
  "gain of the day": "the skin differs from day to day", area: "area of a taxel", sampling: "load between the taxels", rim: "load at the rim of the skin",
  "dead zone": "load that no count shows", "unread taxels": "excluded and faulty taxels", flicker: "a module that jumps",
};

/** The force, big, with what keeps it from being good. */
export function forceCard(signal) {
  const value = el("div.big", { id: "force" }, "–");
  const course = new Course(signal);
  const why = el("button.quiet.link", { id: "why", type: "button" }, "why so wide?");
  const budget = budgetOf(signal, why);
  const begin = el("a.button.primary", { href: "#calibrate", id: "begin" }, "Calibrate this skin");
  const told = el("span.verdict", { id: "verdict" });
  const simulated = el("span.pill.warn", { id: "simulated", title: "no skin is touched" }, "simulated");
  const reasons = el("ul.reasons", { id: "reasons" });
  const more = el("div");
  const card = el("section.card", { id: "force-card" },
    el("div.row.between", el("h2", "Normal force"), simulated, told), value, why, budget, reasons, begin, course.node, more);
  const update = () => {
    const now = verdict();
    const force = state.force ?? {};
    card.classList.toggle("noforce", !now.shown);
    simulated.hidden = !force.simulated;
    told.className = `verdict ${now.kind}`;
    told.textContent = now.word;
    begin.hidden = now.word !== "UNCALIBRATED";
    state.shown = now.shown ? state.force : null;
    why.hidden = !now.shown;
    emit("shown");
    if (now.shown) {
      const high = force.highN === undefined ? "N or more" : `to ${num(force.highN)} N`;
      put(value, `${num(force.totalN)} N `, el("small", `95 %: ${num(force.lowN)} ${high}`));
    } else {
      put(value, "no force");
    }
    put(reasons, now.reasons.slice(0, 8).map((reason) => el("li", reason)));
    put(more, details(force, now));
    course.chart.soon();
  };
  const timer = setInterval(update, LOOK_EVERY_MS);
  signal.addEventListener("abort", () => { clearInterval(timer); state.shown = null; });
  update();
  return card;
}

/** What the interval is made of, as bars: a tap on the button shows it, another hides it. */
function budgetOf(signal, why) {
  const node = el("div", { id: "budget", hidden: true });
  const show = async () => {
    if (node.hidden) return;
    const force = await call("ForceService/GetForce", { patch: state.patch }).catch(() => ({}));
    const terms = (force.budget ?? []).toSorted((a, b) => b.sigmaN - a.sigmaN);
    const most = terms[0]?.sigmaN || 1;
    put(node, el("p.note", terms.length ? "Standard uncertainty by cause. The low end of the interval is the force less twice the root of their summed squares." : "There is no force now."),
      el("div.budget", terms.map((t) => {
        const bar = el("i");
        bar.style.width = `${(100 * t.sigmaN) / most}%`;
        return [el("span", { title: t.term }, TERMS[t.term] ?? t.term), bar, el("span", `${num(t.sigmaN)} N`)];
      })),
      force.undetectedN !== undefined && el("p.note", `Undetected force: up to ${num(force.undetectedN)} N could press without any taxel showing it. It moves the high end up; uncertainties add as squares, so the parts do not simply add up. A tare of the unloaded skin makes it smaller.`));
  };
  why.addEventListener("click", () => { node.hidden = !node.hidden; show(); });
  const timer = setInterval(show, BUDGET_EVERY_MS);
  signal.addEventListener("abort", () => clearInterval(timer));
  return node;
}

function details(force, now) {
  return facts([
    ["age", !Number.isFinite(age()) ? "–" : `${num(age(), 2)} s`, "Time since the newest frame of the skin was received"],
    now.shown && ["undetected", force.undetectedN === undefined ? undefined : `up to ${num(force.undetectedN)} N`, "Largest force (95 %) that may be there without being detected; part of the interval"],
    ["taxels", !now.shown ? `${force.stale ?? 0} silent; without a force it is not known which are active` : `${force.active ?? 0} active, ${force.excluded ?? 0} excluded or faulty, ${force.stale ?? 0} silent, ${force.outOfRange ?? 0} beyond calibration`, "Active: more pressure than the threshold; they make the force. Excluded: no usable model. Faulty: a fault now. Silent: no frames come. Beyond calibration: more pressure than was calibrated"],
    now.shown && ["force vector", xyz(force.resultantN, 1, "N", 2)],
    now.shown && ["centre of pressure", xyz(force.centreOfPressureM, 1000, "mm", 1)],
    now.shown && ["moment", xyz(force.momentNm, 1, "N\u00a0m", 3)],
    ["model set", force.modelSet || "none", "The fitted curves of the patch, one a taxel"],
  ]);
}

/** The force over time, also from before this page was opened: a minute or ten, held still on demand, with its peak and the value under the pointer. */
class Course {
  constructor(signal) {
    this.seconds = 60;
    this.held = null;
    this.chart = new Chart(signal, "Force over time", () => overTime(this.held?.course ?? state.course, this.held?.now ?? performance.now() / 1000, this.seconds));
    const choose = el("select", { "aria-label": "Time shown", onchange: (event) => { this.seconds = Number(event.target.value); } },
      [60, COURSE_S].map((s) => el("option", { value: s }, s === 60 ? "1 minute" : `${s / 60} minutes`)));
    const hold = el("button", { id: "hold", onclick: () => {
      this.held = this.held ? null : { now: performance.now() / 1000, course: state.course.map((point) => ({ ...point })) };
      hold.textContent = this.held ? "Go on" : "Pause";
    } }, "Pause");
    this.node = el("div", this.chart.node, el("div.row", choose, hold, recordButton(signal)), el("p.note", "Hatched: no force that may be used."));
  }
}

on("force", () => {
  if (!state.recorded) return;
  const { word, shown } = verdict();
  const { time, totalN, lowN, highN } = state.force;
  state.recorded.push([time, state.patch, word, ...(shown ? [totalN, lowN, highN] : ["", "", ""]), age()].map((cell) => cell ?? "").join(","));
});

/** The button that records each force that comes here, also beside another view, and saves them as a table. */
function recordButton(signal) {
  const node = el("button", { id: "save-force", title: "Each force that this page gets, as a table", onclick: () => {
    if (state.recorded) download(`force-${state.patch}.csv`, ["time,patch,state,total_n,low_n,high_n,age_s", ...state.recorded, ""].join("\n"), "text/csv");
    state.recorded = state.recorded ? null : [];
    tell();
  } });
  const tell = () => { node.textContent = state.recorded ? `Save (${state.recorded.length})` : "Record"; };
  on("force", tell, signal);
  tell();
  return node;
}

/** So many seconds of the course until `now`, the interval of 95 %, and hatched where there was no force. */
function overTime(all, now, seconds) {
  const at = ({ t }) => t - now;
  const course = all.filter((point) => at(point) >= -seconds);
  const peak = course.reduce((high, point) => (point.n > (high?.n ?? -1) ? point : high), null);
  const top = Math.max(1, ...course.map(({ n, high }) => high ?? n).filter(Number.isFinite)) * 1.08;
  const [spans, points] = [[], []];
  course.forEach((point, i) => {
    const [from, to] = [i ? at(course[i - 1]) : at(point) - 0.05, at(point)];
    const isGap = to - from > GAP_S;
    if (isGap) points.push({ t: point.t, n: NaN, low: NaN, high: NaN });
    points.push(point);
    if (Number.isFinite(point.n) && !isGap) return;
    if (spans.at(-1)?.[1] === from) spans.at(-1)[1] = to;
    else spans.push([from, to]);
  });
  const end = course.at(-1);
  if (!end || at(end) < -0.5) spans.push([end ? at(end) : -seconds, 0]);
  const nearest = (x) => {
    const point = course.reduce((best, one) => (!best || Math.abs(at(one) - x) < Math.abs(at(best) - x) ? one : best), null);
    return point && { x: at(point), text: Number.isFinite(point.n) ? `${num(point.n)} N, ${num(-at(point), 1)} s ago` : point.word };
  };
  return {
    x: [-seconds, 0], y: [0, top], xLabel: "s", yLabel: "N", nearest,
    layers: [
      { kind: "gaps", spans },
      { kind: "band", points: points.map((p) => [at(p), p.low, p.high ?? p.n]) },
      { kind: "line", points: points.map((p) => [at(p), p.n]) },
      ...(peak ? [{ kind: "level", y: peak.n, text: `peak ${num(peak.n)} N`, colour: "soft" }] : []),
    ],
  };
}

/** What the daemon refuses because it cannot see that the skin is unloaded: somebody may confirm it. */
const CONFIRMABLE = ["SKIN_LOADED", "ZERO_INVALID"];

/** A call that wants the skin unloaded; where that is not certain, it asks who confirms it. */
export async function unloaded(method) {
  try {
    return await call(method, { patch: state.patch });
  } catch (refused) {
    if (!CONFIRMABLE.includes(refused.reason)) throw refused;
    const confirmedBy = await whoConfirms(refused.message);
    return confirmedBy === undefined ? null : call(method, { patch: state.patch, confirmedBy });
  }
}

/** The button that takes the zero. */
export const tareButton = () => button("Tare", async () => {
  const zero = await unloaded("SkinService/Tare");
  if (zero) toast(`zero taken: ${zero.reason ?? ""}`);
}, { id: "tare", title: "Takes the zero: nothing may touch the skin" });

/** Pressure or change of count. */
function chooser(skin) {
  const choose = (values) => () => { skin.values = values; skin.peak = 0; skin.soon(); update(); };
  const kpa = el("button", { onclick: choose("kpa") }, "kPa");
  const counts = el("button", { id: "counts", onclick: choose("counts") }, "change of count");
  const update = () => {
    kpa.setAttribute("aria-pressed", skin.values === "kpa");
    counts.setAttribute("aria-pressed", skin.values !== "kpa");
    kpa.classList.toggle("primary", skin.values === "kpa");
    counts.classList.toggle("primary", skin.values !== "kpa");
  };
  const scale = el("select", { id: "scale", "aria-label": "Scale", onchange: (event) => { skin.top = Number(event.target.value) || null; skin.soon(); } },
    el("option", { value: "" }, "automatic scale"), [5, 10, 20, 35, 70, 100, 200].map((top) => el("option", { value: top }, `0 to ${top}`)));
  const solid = el("button", { id: "solid", hidden: !state.layout?.hasPositions, onclick: () => {
    skin.inSpace(!skin.solid);
    solid.textContent = skin.solid ? "Flat" : "3D";
  } }, "3D");
  update();
  return el("div.row", kpa, counts, scale, solid);
}

export function live(signal) {
  const skin = new SkinView(signal, { values: state.skin?.modelSet ? "kpa" : "counts" });
  const remarks = el("p.note");
  const tell = () => { remarks.textContent = (state.skin?.geometryRemarks ?? []).join("; "); };
  on("skin", tell, signal);
  tell();
  return el("div.live.three",
    forceCard(signal),
    el("section.card", el("div.row.between", el("h2", "The skin, seen from outside"), chooser(skin), tareButton()), skin.node, remarks),
    taxelCard(signal));
}
