// One taxel: what it reads now, with its interval, and its curve over its samples.

import { call } from "./api.js";
import { el, facts, num, put } from "./dom.js";
import { Chart } from "./chart.js";
import { on, state } from "./store.js";
import { KINDS, kindOf } from "./skin.js";

/** Numbers that change faster than this, in ms, cannot be read. */
const WRITE_EVERY_MS = 100;

const models = new Map();

/** A taxel's model, asked for once a set. */
export async function model(modelSet, taxel) {
  const key = `${modelSet}/${taxel}`;
  if (!models.has(key)) {
    if (models.size > 500) models.clear();
    models.set(key, call("ModelService/GetModelSet", { modelSet, curves: [taxel] }).then((set) => set.curves[0]).catch((error) => { models.delete(key); throw error; }));
  }
  return models.get(key);
}

/** A curve as layers of a chart: the band of two sigma, then the line. */
export function curve(found, colour = "green", dash = []) {
  const points = found?.points ?? [];
  const count = (p) => p.count ?? 0;
  const kpa = (p) => p.pressureKpa ?? 0;
  return [
    { kind: "band", points: points.map((p) => [count(p), kpa(p) - 2 * (p.sigmaKpa ?? NaN), kpa(p) + 2 * (p.sigmaKpa ?? NaN)]) },
    { kind: "line", colour, dash, points: points.map((p) => [count(p), kpa(p)]) },
  ];
}

/** The card of the taxel that is pointed at. */
export function taxelCard(signal) {
  const body = el("div", el("p.note", "Point at a taxel, tap it, or go there by arrow keys."));
  const remark = el("p.note");
  let found = null;
  let shown = null;
  const chart = new Chart(signal, "Pressure against count of the taxel", () => describe(found), { tall: true });
  chart.node.hidden = true;
  const update = async () => {
    const taxel = state.selected;
    if (taxel === null || !state.skin) return;
    put(body, reading(taxel));
    const set = state.session?.modelSet || state.skin.modelSet;
    const key = `${set}/${taxel}`;
    if (key !== shown) {
      shown = key;
      found = set ? await model(set, taxel).catch(() => null) : null;
    }
    chart.node.hidden = !(found?.points?.length || state.ramp);
    remark.textContent = chart.node.hidden ? "" : `Curve of ${set || "no model set yet"} with its interval of two standard uncertainties. ${state.ramp ? "Dots: the last ramp as this page saw it." : ""}`;
    chart.soon();
  };
  let written = 0;
  const readable = () => {
    if (performance.now() - written < WRITE_EVERY_MS) return;
    written = performance.now();
    update();
  };
  on("taxels", readable, signal);
  for (const name of ["selected", "skin", "session"]) on(name, update, signal);
  update();
  return el("section.card", { id: "taxel" }, el("h2", "Taxel"), body, chart.node, remark);
}

function reading(taxel) {
  const [layout, now] = [state.skin.taxels[taxel], state.taxels?.taxels?.[taxel]];
  const kind = kindOf(now, layout);
  const interval = now?.sigmaKpa === undefined ? "" : ` ± ${num(2 * now.sigmaKpa)}`;
  return facts([
    ["taxel", `${taxel} (${state.layout.moduleOf[taxel]?.name ?? ""})`],
    ["number in its module", layout.slot ?? 0],
    ["state", KINDS.find(([known]) => known === kind)[1]],
    ["count", kind === "silent" ? "–" : num(now?.count, 0)],
    ["pressure", kind === "silent" || now?.pressureKpa === undefined ? "none" : `${num(now.pressureKpa)}${interval} kPa`],
    ["age", kind === "silent" || now?.ageS === undefined ? "–" : `${num(now.ageS, 3)} s`],
    ["area", `${num(layout.areaMm2, 1)} mm²`],
    state.skin.modelSet && layout.exclusion && ["excluded", layout.exclusion],
    now?.faults?.length && ["faults", now.faults.join(", ")],
  ]);
}

function describe(found) {
  const taxel = state.selected;
  const ramp = state.ramp ? state.ramp.kpa.map((kpa, i) => [state.ramp.counts[i][taxel], kpa]) : [];
  const points = found?.points ?? [];
  if (taxel === null || (!points.length && !ramp.length)) return null;
  const newest = state.taxels?.taxels?.[taxel];
  const now = kindOf(newest, state.skin.taxels[taxel]) === "silent" ? undefined : newest;
  const counts = [...points.map((p) => p.count ?? 0), ...ramp.map(([count]) => count), ...(now?.count === undefined ? [] : [now.count])];
  const kpa = [...points.map((p) => p.pressureKpa ?? 0), ...ramp.map(([, p]) => p), now?.pressureKpa ?? 0];
  const layers = [{ kind: "dots", colour: "soft", size: 1.2, points: ramp }, ...curve(found)];
  if (now?.pressureKpa !== undefined) {
    const [p, s] = [now.pressureKpa, now.sigmaKpa ?? 0];
    layers.push({ kind: "dots", colour: "blue", size: 5, points: [[now.count, p, p - 2 * s, p + 2 * s]] });
  }
  const [low, high] = [Math.min(...counts), Math.max(...counts)];
  return { x: [low - 2, high + 2], y: [Math.min(0, ...kpa), 1.05 * Math.max(1, ...kpa)], xLabel: "count", yLabel: "kPa", layers };
}
