// Health: buses, boards, gauge, zeros, faults, and what happened.

import { all, health as askHealth } from "./api.js";
import { button, el, facts, num, put, sure, table, toast, when } from "./dom.js";
import { tareButton, unloaded } from "./live.js";
import { places, state, verdict } from "./store.js";

/** How often it is asked for, in ms. */
const EVERY_MS = 1000;

/** Events that are shown, the newest. */
const EVENTS_MAX = 50;

/** A gauge whose last reading is older is silent, in s. */
const GAUGE_SILENT_S = 2;

export function health(signal) {
  const body = el("div.stack");
  const happened = el("div");
  const tell = async () => {
    const events = (await all("SkinService/WatchEvents", { patch: state.patch })).slice(-EVENTS_MAX).reverse();
    if (signal.aborted) return;
    put(happened, table(["when", "what", "why"], events.map((one) => [when(one.time), one.kind, el("td.wrap", [one.text, places(one.taxels ?? [])].filter(Boolean).join(": "))]), "nothing since the daemon started"));
  };
  const actions = el("div.row", tareButton(), button("Configure the boards again", async () => {
    if (await sure("Configure the boards again? The zero is lost by it.", "Configure them") && await unloaded("SkinService/BringUp")) toast("the boards are being configured");
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
  tell().catch((error) => toast(error.message, "bad"));
  const timer = setInterval(update, EVERY_MS);
  signal.addEventListener("abort", () => clearInterval(timer));
  return el("div.stack", el("section.card", el("h2", "Patch"), actions), body,
    el("section.card", el("div.row.between", el("h2", "Events, the newest first"), button("Look again", tell)), happened));
}

function shown(now) {
  const { word, reasons } = verdict();
  const degraded = word === "DEGRADED" ? reasons.map((reason) => `${state.patch}: DEGRADED: ${reason}`) : [];
  const problems = [...problemsOf(now), ...degraded];
  const first = el("section.card", { id: "problems" }, el("h2", "Problems"), problems.length ? el("ul.reasons", problems.map((text) => el("li", text))) : el("p.note", "none"),
      el("p.note", `${now.streams ?? 0} of ${now.streamsMax ?? 0} streams are in use, this page's among them.`));
  // What an engine that stands still said last may not be so now.
  if (now.engineStalledS !== undefined) return [first, el("section.card.noforce", el("p", "Buses, boards and zeros are not known: the engine does not run."))];
  return [
    first,
    el("div.cards", (now.patches ?? []).map(patch)),
    el("section.card", el("h2", "Boards"), table(["patch", "#bus", "#board", "state", "#modules that send", "#scans", "#half scans", "#°C", "firmware", "warnings"],
      (now.boards ?? []).map((b) => [b.patch, b.bus ?? 0, b.address, el("td.wrap", b.bringUp), `${b.modulesFresh ?? 0} of ${b.modulesEnabled ?? 0}`, b.scans ?? 0, b.orphans ?? 0, b.celsius === undefined ? "" : num(b.celsius, 1), b.firmware ?? "",
        el("td.wrap", (b.warnings ?? []).join("; "))]))),
    el("section.card", el("h2", "Buses"), table(["#bus", "state", "#frames", "#foreign", "#malformed", "#dropped", "problem"],
      (now.buses ?? []).map((bus) => [bus.bus ?? 0, el(`span.pill.${bus.up ? "ok" : "bad"}`, bus.up ? "up" : "down"), bus.frames ?? 0, bus.foreign ?? 0, bus.malformed ?? 0, bus.dropped ?? 0,
        el("td.wrap", [bus.problem, bus.lastMalformed].filter(Boolean).join("; "))]))),
  ];
}

/** What keeps the force from being good, as `taxeld health` says it. */
export function problemsOf(now) {
  const wrong = [...(now.problems ?? [])];
  for (const bus of now.buses ?? []) if (!bus.up) wrong.push(`bus ${bus.bus ?? 0} is down: ${bus.problem ?? ""}`);
  for (const { address, modulesFresh: fresh = 0, modulesEnabled: all = 0 } of now.boards ?? []) if (fresh < all) wrong.push(`board ${address}: ${all - fresh} of ${all} modules are silent`);
  for (const { patch, tare, noForce } of now.patches ?? []) {
    if (tare && !tare.valid) wrong.push(`${patch}: the zero is invalid: ${tare.reason ?? ""}`);
    else if (noForce) wrong.push(`${patch}: no force: ${noForce}`);
  }
  return wrong;
}

/** The gauge's newest reading as a pill; nothing where none is configured. */
export function gauge(one) {
  if (!one?.hasGauge) return undefined;
  if (one.gaugeKpa === undefined || one.gaugeAgeS > GAUGE_SILENT_S) return el("span.pill.bad", "silent");
  return el("span.pill.ok", `${num(one.gaugeKpa)} kPa`);
}

function patch(one) {
  const tare = one.tare ?? {};
  const faulty = one.faulty ?? [];
  return el("section.card", el("h2", one.patch),
    one.noForce && el("p.advice.bad", one.noForce),
    facts([
      ["zero", el(`span.pill.${tare.valid ? "ok" : "bad"}`, tare.valid ? "valid" : "invalid")],
      tare.valid && ["taken", when(tare.time)],
      [tare.valid ? "found" : "why", tare.reason],
      ["gauge", gauge(one)],
      tare.valid && ["unloaded count", `${num(tare.baselineMedianCounts, 1)}, noise ${num(tare.noiseMedianCounts)}`],
      tare.valid && ["drift followed", `${num(tare.driftMedianCounts ?? 0)} counts`],
    ]),
    el("h3", "Faulty taxels"),
    table(["taxel", "faults"], faulty.map((f) => [one.patch === state.patch ? places([f.taxel ?? 0]) : f.taxel ?? 0, f.faults.join(", ")]), "none"));
}
