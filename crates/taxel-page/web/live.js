// The force now, and the skin.

import { call } from "./api.js";
import { Chart } from "./chart.js";
import { button, el, facts, num, percent, put } from "./dom.js";
import { SkinView } from "./skin.js";
import { age, on, state, verdict } from "./store.js";
import { taxelCard } from "./taxel.js";

/** How often the force is judged and written anew, in ms: also when nothing comes, and no faster than it can be read. */
const LOOK_EVERY_MS = 100;

const xyz = (v, k, unit, places) => (v ? `${num((v.x ?? 0) * k, places)}, ${num((v.y ?? 0) * k, places)}, ${num((v.z ?? 0) * k, places)} ${unit}` : undefined);

/** The force, big, with what keeps it from being good. */
export function forceCard(signal) {
  const value = el("div.big", { id: "force" }, "–");
  const told = el("span.verdict", { id: "verdict" });
  const simulated = el("span.pill.warn", { id: "simulated", title: "no skin is touched" }, "simulated");
  const reasons = el("ul.reasons", { id: "reasons" });
  const more = el("div");
  const chart = new Chart(signal, "Force over the last minute", lastMinute);
  const card = el("section.card", { id: "force-card" },
    el("div.row.between", el("h2", "Normal force"), simulated, told), value, reasons, chart.node, more);
  const update = () => {
    const now = verdict();
    const force = state.force ?? {};
    card.classList.toggle("noforce", !now.shown);
    simulated.hidden = !force.simulated;
    told.className = `verdict ${now.kind}`;
    told.textContent = now.word;
    if (now.shown) {
      const high = force.highN === undefined ? "or more" : `to ${num(force.highN)}`;
      put(value, `${num(force.totalN)} N `, el("small", `${num(force.lowN)} ${high} N`));
    } else {
      put(value, "no force");
    }
    put(reasons, now.reasons.slice(0, 8).map((reason) => el("li", reason)));
    put(more, details(force, now));
    chart.soon();
  };
  const timer = setInterval(update, LOOK_EVERY_MS);
  signal.addEventListener("abort", () => clearInterval(timer));
  update();
  return card;
}

function details(force, now) {
  return facts([
    ["age", !Number.isFinite(age()) ? "–" : `${num(age(), 2)} s`],
    now.shown && ["of it undetected", force.undetectedN === undefined ? undefined : `up to ${num(force.undetectedN)} N`],
    ["taxels", `${force.active ?? 0} touched, ${force.excluded ?? 0} excluded, ${force.stale ?? 0} silent, ${force.outOfRange ?? 0} beyond calibration`],
    now.shown && ["force vector", xyz(force.resultantN, 1, "N", 2)],
    now.shown && ["centre of pressure", xyz(force.centreOfPressureM, 1000, "mm", 1)],
    now.shown && ["moment", xyz(force.momentNm, 1, "N\u00a0m", 3)],
    ["model set", force.modelSet || "none"],
  ]);
}

/** The last minute, its interval of 95 %, and hatched where no force could be told. */
function lastMinute() {
  const now = performance.now() / 1000;
  const at = ({ t }) => t - now;
  const highs = state.course.map(({ n, high }) => high ?? n).filter(Number.isFinite);
  const top = Math.max(1, ...highs) * 1.08;
  const spans = [];
  for (const point of state.course) {
    if (Number.isFinite(point.n)) continue;
    const last = spans.at(-1);
    if (last && at(point) - last[1] < 0.3) last[1] = at(point);
    else spans.push([at(point) - 0.05, at(point)]);
  }
  const end = state.course.at(-1);
  if (!end || at(end) < -0.5) spans.push([end ? at(end) : -60, 0]);
  return {
    x: [-60, 0], y: [0, top], xLabel: "s", yLabel: "N",
    layers: [
      { kind: "gaps", spans },
      { kind: "band", points: state.course.map((p) => [at(p), p.low, p.high ?? p.n]) },
      { kind: "line", points: state.course.map((p) => [at(p), p.n]) },
    ],
  };
}

/** The button that takes the zero. */
export function tareButton(vouches = () => "") {
  const work = () => call("SkinService/Tare", { patch: state.patch, confirmedBy: vouches() });
  return button("Tare", work, { id: "tare", title: "Nothing may touch the skin", done: (zero) => `zero taken: ${zero.reason ?? ""}` });
}

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
  update();
  return el("div.row", kpa, counts);
}

export function live(signal) {
  const skin = new SkinView(signal, { values: state.skin?.modelSet ? "kpa" : "counts" });
  const remarks = el("p.note");
  const tell = () => { remarks.textContent = (state.skin?.geometryRemarks ?? []).join("; "); };
  on("skin", tell, signal);
  tell();
  return el("div.live.three",
    forceCard(signal),
    el("section.card", el("div.row.between", el("h2", "The skin, laid flat, seen from outside"), chooser(skin), tareButton()), skin.node, remarks),
    taxelCard(signal));
}
