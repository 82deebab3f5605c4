// Health: buses, boards, zeros, faults.

import { call, health as askHealth } from "./api.js";
import { button, el, facts, num, put, sure, table, when } from "./dom.js";
import { tareButton } from "./live.js";
import { state } from "./store.js";

/** How often it is asked for, in ms. */
const EVERY_MS = 1000;

export function health(signal) {
  const body = el("div.stack");
  const by = el("input", { maxLength: 200, placeholder: "nobody: the counts must show it", name: "by" });
  const actions = el("div.row", el("label", "Nothing touches the skin, says", by), tareButton(() => by.value), button("Configure the boards again", async () => {
    const request = { patch: state.patch, confirmedBy: by.value };
    if (await sure("Configure the boards again? The zero is lost by it.", "Configure them")) await call("SkinService/BringUp", request);
  }, { kind: "danger", id: "bring-up" }));
  const update = async () => {
    try {
      const now = await askHealth();
      if (!signal.aborted) put(body, shown(now));
    } catch (error) {
      if (!signal.aborted) put(body, el("section.card.noforce", el("p", error.message)));
    }
  };
  update();
  const timer = setInterval(update, EVERY_MS);
  signal.addEventListener("abort", () => clearInterval(timer));
  return el("div.stack", el("section.card", el("h2", "Patch"), actions), body);
}

function shown(now) {
  const problems = now.problems ?? [];
  const first = el("section.card", el("h2", "Problems"), problems.length ? el("ul.reasons", problems.map((text) => el("li", text))) : el("p.note", "none"),
      el("p.note", `${now.streams ?? 0} of ${now.streamsMax ?? 0} streams are in use, this page's among them.`));
  // What an engine that stands still said last is nothing that is so now.
  if (now.engineStalledS !== undefined) return [first, el("section.card.noforce", el("p", "Buses, boards and zeros are not known: the engine does not run."))];
  return [
    first,
    el("section.card", el("h2", "Buses"), table(["#bus", "state", "#frames", "#foreign", "#malformed", "#lost", "problem"],
      (now.buses ?? []).map((bus) => [bus.bus ?? 0, el(`span.pill.${bus.up ? "ok" : "bad"}`, bus.up ? "up" : "down"), bus.frames ?? 0, bus.foreign ?? 0, bus.malformed ?? 0, bus.dropped ?? 0,
        el("td.wrap", [bus.problem, bus.lastMalformed].filter(Boolean).join("; "))]))),
    el("section.card", el("h2", "Boards"), table(["patch", "#bus", "#address", "bring-up", "#modules", "#scans", "#orphans", "#°C", "firmware", "warnings"],
      (now.boards ?? []).map((b) => [b.patch, b.bus ?? 0, b.address, el("td.wrap", b.bringUp), `${b.modulesFresh ?? 0} of ${b.modulesEnabled ?? 0}`, b.scans ?? 0, b.orphans ?? 0, num(b.celsius, 1), b.firmware ?? "",
        el("td.wrap", (b.warnings ?? []).join("; "))]))),
    el("div.cards", (now.patches ?? []).map(patch)),
  ];
}

function patch(one) {
  const tare = one.tare ?? {};
  const faulty = one.faulty ?? [];
  return el("section.card", el("h2", one.patch),
    facts([
      ["zero", el(`span.pill.${tare.valid ? "ok" : "bad"}`, tare.valid ? "valid" : "not valid")],
      ["taken", when(tare.time)],
      ["because", tare.reason],
      ["count at rest", `${num(tare.baselineMedianCounts, 1)}, noise ${num(tare.noiseMedianCounts)}`],
      ["drift followed", `${num(tare.driftMedianCounts ?? 0)} counts`],
    ]),
    el("h3", "Faulty taxels"),
    table(["#taxel", "faults"], faulty.map((f) => [f.taxel ?? 0, f.faults.join(", ")]), "none"));
}
