// Model sets: which there are, which is in use, and how two of them differ.

import { call } from "./api.js";
import { compared, excludedTable } from "./calibrate.js";
import { Chart } from "./chart.js";
import { button, download, el, num, put, sure, table, toast, when } from "./dom.js";
import { SkinView } from "./skin.js";
import { loadSkin, on, state } from "./store.js";
import { curve, model } from "./taxel.js";

/** Largest file that the service takes. */
const FILE_BYTES_MAX = 16 << 20;

export function models(signal) {
  const list = el("div");
  const against = el("div.stack");
  const pick = ["", ""];
  const update = async () => {
    const { modelSets = [] } = await call("ModelService/ListModelSets", { patch: state.patch });
    if (signal.aborted) return;
    const ids = modelSets.map((set) => set.modelSet);
    if (!ids.includes(pick[0])) pick[0] = ids[0] ?? "";
    if (!ids.includes(pick[1])) pick[1] = modelSets.find((set) => set.active && set.modelSet !== pick[0])?.modelSet ?? ids[1] ?? "";
    put(list, table(["model set", "made", "#session", "#usable", "#up to, kPa", ""], modelSets.map((set) => row(set, update)), "no model set yet: calibrate, or import one"));
    put(against, comparison(signal, ids, pick));
  };
  update().catch((error) => toast(error.message, "bad"));
  return el("div.stack", el("section.card", el("div.row.between", el("h2", "Model sets"), importer(update)), list, el("p.note", "To print a certificate of the set in use (only if a session made it): ", el("code", "taxel-lab certificate --out certificate.html"))), against);
}

function row(set, update) {
  const id = set.modelSet;
  const use = button("Use", async () => {
    await call("ModelService/ActivateModelSet", { patch: set.patch, modelSet: id });
    await Promise.all([loadSkin(), update()]);
  }, { disabled: set.active, done: `${id} is in use` });
  const save = button("Export", async () => download(`${id}.json`, (await call("ModelService/ExportModelSet", { modelSet: id })).json));
  const remove = button("Delete", async () => {
    if (!(await sure(`Delete ${id} for good?`, "Delete it"))) return;
    await call("ModelService/DeleteModelSet", { modelSet: id });
    await update();
  }, { kind: "danger", disabled: set.active });
  return [el("td", id, " ", set.active && el("span.pill.ok", "in use")), when(set.created), set.session ?? "",
    `${set.calibrated ?? 0} of ${set.taxels ?? 0}`, num(set.pressureMaxKpa, 1), el("td", el("div.row", use, save, remove))];
}

function importer(update) {
  const file = el("input", { type: "file", accept: ".json,application/json", hidden: true });
  const go = button("Import", async () => file.click());
  file.addEventListener("change", async () => {
    const chosen = file.files[0];
    file.value = "";
    if (!chosen) return;
    try {
      if (chosen.size > FILE_BYTES_MAX) throw new Error(`${chosen.name} has ${chosen.size} bytes, at most ${FILE_BYTES_MAX} are taken`);
      const { modelSet } = await call("ModelService/ImportModelSet", { json: await chosen.text() });
      toast(`${modelSet} is here; it is not in use yet`);
      await update();
    } catch (error) {
      toast(error.message, "bad");
    }
  });
  return el("span", go, file);
}

function comparison(signal, ids, pick) {
  if (!ids.length) return null;
  const result = el("div");
  const excluded = el("div");
  const found = [null, null];
  const remark = el("p.note", "Point at a taxel to see both curves.");
  const chart = new Chart(signal, "The curves of a taxel in both sets", () => curves(found), { tall: true });
  const curveOf = async () => {
    if (state.selected === null) return;
    for (const i of [0, 1]) found[i] = pick[i] ? await model(pick[i], state.selected).catch(() => null) : null;
    remark.textContent = `Taxel ${state.selected}: line ${pick[0]}${pick[1] ? `, dashed ${pick[1]}` : ""}, each with two standard uncertainties.`;
    chart.soon();
  };
  const update = async () => {
    const sets = await Promise.all(pick.map((id) => (id ? call("ModelService/GetModelSet", { modelSet: id }) : null)));
    if (signal.aborted) return;
    put(result, compared(sets[0], sets[1], ["first", "second"]));
    put(excluded, excludedTable(sets[0]));
    await curveOf();
  };
  const choose = (i) => el("select", { "aria-label": i ? "Second set" : "First set", onchange: (event) => { pick[i] = event.target.value; update(); } },
    i === 1 && el("option", { value: "" }, "nothing"), ids.map((id) => el("option", { value: id, selected: id === pick[i] }, id)));
  on("selected", curveOf, signal);
  update().catch((error) => toast(error.message, "bad"));
  return el("div.live",
    el("section.card", el("h2", "Compared"), el("div.row", choose(0), "with", choose(1)), result, el("h3", "Excluded in the first"), excluded),
    el("section.card", el("h2", "Curves (colour of the map: change of count now)"), new SkinView(signal, { values: "counts", overlays: false }).node, chart.node, remark));
}

function curves(found) {
  const points = found.flatMap((one) => one?.points ?? []);
  if (!points.length) return null;
  const counts = points.map((p) => p.count ?? 0);
  const top = Math.max(1, ...points.map((p) => p.pressureKpa ?? 0));
  const layers = [...curve(found[0]), ...curve(found[1], "blue", [6, 4])];
  return { x: [Math.min(...counts) - 2, Math.max(...counts) + 2], y: [0, 1.05 * top], xLabel: "count", yLabel: "kPa", layers };
}
