// Validation: known masses on the skin against what it reads.

import { call } from "./api.js";
import { Chart } from "./chart.js";
import { doing, el, facts, num, put, table, toast, when } from "./dom.js";
import { forceCard } from "./live.js";
import { state } from "./store.js";

export function validate(signal) {
  let validation = {};
  const rows = el("div");
  const summary = el("div");
  const chart = new Chart(signal, "Force read against force laid on", () => readAgainstTrue(validation.loads ?? []), { tall: true });
  const update = async () => {
    validation = await call("ValidationService/GetValidation", { patch: state.patch });
    if (signal.aborted) return;
    const loads = validation.loads ?? [];
    put(rows, table(["#load", "when", "by", "#mass, kg", "#laid on ± 2σ, N", "#read ± 2σ, N", "#error", "within 2σ", "note"], loads.map(row), "no load yet: lay a known mass on the skin, then say what it is"));
    put(summary, figures(validation));
    chart.node.hidden = !loads.length;
    chart.soon();
  };
  update().catch((error) => toast(error.message, "bad"));
  return el("div.live",
    el("div.stack", el("section.card", el("h2", "A known load lies on the skin now"), form(update)), forceCard(signal)),
    el("div.stack",
      el("section.card", el("h2", "Read against laid on"), chart.node, summary),
      el("section.card", el("h2", "Loads"), rows)));
}

function form(update) {
  const amount = el("input", { type: "number", min: "0", step: "any", required: true, name: "amount", id: "amount" });
  const unit = el("select", { id: "unit", "aria-label": "Unit" }, el("option", { value: "massKg" }, "kg"), el("option", { value: "forceN" }, "N"));
  const by = el("input", { maxLength: 200, name: "by", id: "by" });
  const note = el("input", { maxLength: 1000, name: "note", id: "note", placeholder: "which mass, where" });
  const go = el("button.primary", { type: "submit", id: "record" }, "Record this load");
  const work = async () => {
    const load = await call("ValidationService/RecordLoad", { patch: state.patch, [unit.value]: Number(amount.value), by: by.value, note: note.value });
    (load.reasons ?? []).forEach((reason) => toast(reason, "bad"));
    await update();
    return load;
  };
  const done = (load) => `read ${num(load.readN)} N of ${num(load.forceN)} N: ${num(load.errorPercent, 1)} %`;
  return el("form.row", { onsubmit: doing(go, work, done) },
    el("label", "Load", el("span.row", amount, unit)), el("label", "By", by), el("label", "Note", note), go,
    el("p.note", "The skin is read for one second. Let the load lie still."));
}

function row(load) {
  const off = load.errorPercent ?? 0;
  const note = [load.note, load.outdatedBecause && `does not count: ${load.outdatedBecause}`, load.leftOutBecause && `does not count: ${load.leftOutBecause}`, ...(load.leftOutBecause || load.outdatedBecause ? [] : load.reasons ?? [])].filter(Boolean).join("; ");
  return [load.load, when(load.time), load.by || "", num(load.massKg, 3), `${num(load.forceN)} ± ${num(2 * (load.forceSigmaN ?? 0))}`,
    `${num(load.readN)} ± ${num(2 * (load.readSigmaN ?? 0))}`, `${off > 0 ? "+" : ""}${num(off, 1)} %`,
    load.withinTwoSigma ? "yes" : "no", el("td.wrap", note)];
}

function figures(validation) {
  return facts([
    ["mean absolute error", validation.meanAbsoluteErrorPercent === undefined ? "–" : `${num(validation.meanAbsoluteErrorPercent, 1)} %`],
    ["model set", validation.modelSet || "none"],
  ]);
}

function readAgainstTrue(loads) {
  const points = loads.map((load) => [load.forceN, load.readN, load.readN - 2 * (load.readSigmaN ?? 0), load.readN + 2 * (load.readSigmaN ?? 0), load]);
  const top = 1.1 * Math.max(1, ...points.map((p) => Math.max(p[0], p[3])));
  return {
    x: [0, top], y: [0, top], xLabel: "laid on, N", yLabel: "read, N",
    layers: [
      { kind: "line", colour: "soft", dash: [5, 4], width: 1, points: [[0, 0], [top, top]] },
      { kind: "dots", colour: "soft", size: 3, points: points.filter((p) => p[4].outdatedBecause) },
      { kind: "dots", colour: "green", size: 4, points: points.filter((p) => !p[4].outdatedBecause) },
    ],
  };
}
