// Calibration, step by step: check, tare, pump, fit, review, use it or not.

import { call, health } from "./api.js";
import { button, doing, el, facts, median, num, percent, put, sure, table, word } from "./dom.js";
import { Chart } from "./chart.js";
import { gauge } from "./health.js";
import { tareButton } from "./live.js";
import { SkinView } from "./skin.js";
import { isOld, loadSkin, on, state, watch } from "./store.js";
import { taxelCard } from "./taxel.js";

const STEPS = ["Check", "Tare", "Pump", "Fit", "Review", "Use"];
const STEP_OF = { TARING: 1, RAMPING: 2, FITTING: 3, REVIEW: 4, ACTIVE: 5 };
const stateOf = (session) => (session?.state ?? "").replace("SESSION_STATE_", "");
const isOpen = (session) => ["TARING", "RAMPING", "FITTING", "REVIEW", "INTERRUPTED"].includes(stateOf(session));
const session = () => ({ session: state.session.session });
const show = (answer) => { watch(answer); return answer; };

/** The last of these that was refused is what to heed now; how long it is heeded, in ms. */
const HEEDED_MS = 1500;

export function calibrate(signal) {
  const steps = el("ol.steps");
  const body = el("div.stack");
  let shown = null;
  let again = false;
  const update = () => {
    const now = again || !state.session ? "NONE" : stateOf(state.session);
    const at = STEP_OF[now] ?? 0;
    put(steps, STEPS.map((name, i) => el(i < at || now === "ACTIVE" ? "li.done" : "li", { "aria-current": i === at && now !== "ACTIVE" ? "step" : false }, name)));
    const key = `${state.session?.session}/${now}`;
    if (key === shown) return;
    shown = key;
    const anew = () => { again = true; update(); };
    put(body, view(now, signal, anew));
  };
  on("session", () => { if (isOpen(state.session)) again = false; update(); }, signal);
  update();
  return el("div", steps, body);
}

function view(now, signal, anew) {
  if (now === "TARING") return taring();
  if (now === "RAMPING") return ramping(signal);
  if (now === "FITTING") return el("section.card", el("h2", "Fitting"), el("p", "Models are being computed, one a taxel."));
  if (now === "REVIEW") return review(signal);
  if (now === "ACTIVE") return finished(anew);
  if (["INTERRUPTED", "FAILED", "ABORTED", "DISCARDED"].includes(now)) return [ended(now), check(signal)];
  return check(signal);
}

/** What has to be right before a session begins. */
function check(signal) {
  const list = el("ul.checks");
  const look = async () => {
    const found = await health().catch(() => null);
    if (signal.aborted) return;
    if (!found) return put(list, [el("li", el("span", "✗"), "the daemon answers")]);
    const boards = (found.boards ?? []).filter((board) => board.patch === state.patch);
    const patch = (found.patches ?? []).find((p) => p.patch === state.patch);
    const silent = boards.filter((b) => (b.modulesFresh ?? 0) < (b.modulesEnabled ?? 0));
    const faulty = patch?.faulty?.length ?? 0;
    const valid = patch?.tare?.valid || null;
    put(list, [
      [patch?.hasGauge || null, patch?.hasGauge ? ["the gauge reads ", gauge(patch)] : "a pressure gauge is configured, or its dial is typed"],
      [(found.buses ?? []).every((bus) => bus.up), "every bus is up"],
      [!silent.length, silent.length ? `silent modules on board ${silent.map((b) => b.address).join(", ")}` : "every module sends"],
      [faulty === 0 ? true : null, faulty ? `${faulty} ${faulty === 1 ? "taxel has" : "taxels have"} a fault and will get no model` : "no taxel has a fault"],
      [valid, valid ? "the zero is valid" : "the zero is invalid: the session takes its own"],
      [!(found.problems ?? []).length, (found.problems ?? []).join("; ") || "nothing else is wrong"],
    ].map(([good, text]) => el("li", el("span", good ? "✓" : good === null ? "!" : "✗"), el("span", text))));
  };
  look();
  const timer = setInterval(look, 2000);
  signal.addEventListener("abort", () => clearInterval(timer));
  return el("div.cards",
    el("section.card", el("h2", "Is all as it should be?"), list),
    el("section.card", el("h2", "Begin"), begin(),
      el("p.note", "The bag lies around the skin and is vented. Nothing else touches the skin. The session takes the zero of skin and gauge, then waits for the pressure to rise.")));
}

function begin() {
  const target = el("input", { type: "number", min: "1", step: "any", placeholder: "as configured", name: "target" });
  const branches = el("select", el("option", { value: "BRANCHES_UNSPECIFIED" }, "as configured"),
    el("option", { value: "BRANCHES_RISING" }, "rising pressure"), el("option", { value: "BRANCHES_BOTH" }, "rising and falling"));
  const by = el("input", { maxLength: 200, placeholder: "only if the daemon asks", name: "by" });
  const go = el("button.primary", { type: "submit", id: "start" }, "Start a session");
  const work = async () => {
    const request = { patch: state.patch, branches: branches.value, confirmedBy: by.value };
    if (target.value) request.targetKpa = Number(target.value);
    state.ramp = null;
    show(await call("CalibrationService/StartSession", request));
  };
  return el("form.row", { onsubmit: doing(go, work) },
    el("label", "Up to, kPa", target), el("label", "Branches", branches), el("label", "Unloaded, confirmed by", by), go);
}

const abort = () => button("Abort", async () => {
  if (await sure("Stop this session? Its samples are kept.", "Stop it")) show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_ABORT" }));
}, { kind: "danger", id: "abort" });

/** What should be seen to before the pump runs, found when the session began. */
function found() {
  const lines = state.session.look ?? [];
  return lines.length > 0 && el("ul.note", { id: "look" }, ...lines.map((line) => el("li", line)));
}

function taring() {
  return el("section.card", el("h2", "Hands off"),
    el("p.advice.warn", "The zero is being taken. Do not touch the skin, leave the bag vented."), found(), el("div.row", abort()));
}

/** What to do with the valve now, in a word. */
function adviser() {
  let before = null;
  let heeded = { until: 0, advice: null };
  return (s) => {
    const refused = s.refused ?? {};
    const grew = (name) => before && Number(refused[name] ?? 0) > Number(before[name] ?? 0);
    const now = performance.now();
    const rate = s.rateKpaPerS;
    const falling = s.falling === true;
    const heed = (text, kind) => { heeded = { until: now + HEEDED_MS, advice: [text, kind] }; };
    if (grew("too_fast")) heed("Slower: scans at this rate are not used", "bad");
    else if (grew("gauge_spike") || grew("no_pressure")) heed("The gauge: its readings jump or do not come", "bad");
    else if (grew("stale_module")) heed("A module is silent", "bad");
    else if (grew("zero_in_check")) heed("The zero is being checked: does something touch the skin?", "bad");
    before = refused;
    if (now < heeded.until) return heeded.advice;
    if (rate === undefined) return ["Waiting for the pressure", "warn"];
    if (!falling && rate < -0.1) return ["The pressure falls: is there a leak?", "bad"];
    if (falling && rate > 0.1) return ["The pressure rises: let air in slowly", "bad"];
    if (Math.abs(rate) < 0.05) return [falling ? "Let air in, slowly" : "Pump", "warn"];
    return ["Go on like this", "ok"];
  };
}

/** Where what the dial shows is typed; the daemon says why if it is no plateau. */
function dial() {
  const shows = el("input", { type: "number", step: "any", required: true, name: "dial" });
  const go = el("button.primary", { type: "submit", id: "plateau" }, "Take this plateau");
  const work = async () => {
    show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_PLATEAU", typedKpa: Number(shows.value) }));
    shows.value = "";
  };
  return el("form.row", { onsubmit: doing(go, work) }, el("label", "The dial shows, kPa", shows), go);
}

function ramping(signal) {
  const advice = el("div.advice", { id: "advice" });
  const pressure = el("div.big");
  const bar = el("div");
  const numbers = el("div");
  const skin = new SkinView(signal, { values: "counts", overlays: false });
  const charts = [
    new Chart(signal, "Pressure over time", pressureOverTime, { tall: true }),
    new Chart(signal, "Counts of a few taxels over pressure", countsOverPressure, { tall: true }),
  ];
  on("taxels", () => charts.forEach((chart) => chart.soon()), signal);
  const advise = adviser();
  const update = () => {
    const s = state.session;
    if (stateOf(s) !== "RAMPING") return;
    // A pump goes on by itself.
    const old = isOld();
    const [text, kind] = old ? ["Stop: nothing new comes from the daemon", "bad"] : s.typed ? [s.reason, s.typed.settled ? "ok" : "warn"] : advise(s);
    advice.className = `advice ${kind}`;
    put(advice, text);
    put(pressure, `${old ? "–" : num(s.pressureKpa, 1)} `, el("small", `of ${num(s.targetKpa, 0)} kPa`));
    bar.style.width = `${100 * (s.coverage ?? 0)}%`;
    put(numbers, facts([
      ["rate", old || s.rateKpaPerS === undefined ? "–" : `${num(s.rateKpaPerS, 2)} kPa/s`],
      ["covered", percent(s.coverage ?? 0)],
      ["time left", old || s.remainingS === undefined ? "–" : `${num(s.remainingS, 0)} s`],
      ...(s.typed ? [["plateaus", `${s.typed.taken ?? 0}, 8 make a calibration`]] : []),
      ["taxels that respond", `${s.taxelsResponding ?? 0} of ${s.taxels ?? 0}`],
      ["scans used", `${s.accepted ?? 0}, on disk ${s.durable ?? 0}`],
      ["scans not used", refusedText(s.refused)],
    ]));
  };
  on("session", update, signal);
  update();
  const finish = button("End the ramp here", async () => show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_FINISH_RAMP" })), { id: "finish" });
  return el("div.live",
    el("section.card.spaced", el("h2", state.session.falling ? "Let air in" : "Pump"), advice, pressure, state.session.typed && dial(), el("div.bar", bar), numbers, found(), el("div.row", finish, abort())),
    el("div.stack",
      el("section.card", el("h2", "Pressure over time: no steeper than the slanting dashed line"), charts[0].node),
      el("section.card", el("h2", "Change of count over pressure, of a few taxels; tap a taxel on the map below to see it in blue"), charts[1].node),
      el("section.card", el("h2", "Which taxels respond: change of count"), skin.node)));
}

/** The ramp so far, its target, and from the newest point on the steepest rise or fall that enters the fit. */
function pressureOverTime() {
  const { session: s, ramp } = state;
  const begun = ramp?.at[0] ?? 0;
  const points = (ramp?.at ?? []).map((at, i) => [at - begun, ramp.kpa[i]]);
  const [t, kpa] = points.at(-1) ?? [0, s?.pressureKpa ?? 0];
  const [slope, end] = s?.falling ? [-(s.fallMaxKpaPerS ?? 0), 0] : [s?.riseMaxKpaPerS ?? 0, s?.targetKpa ?? 70];
  const ahead = slope ? Math.max(0, (end - kpa) / slope) : 0;
  const target = s?.targetKpa ?? 70;
  return {
    x: [0, Math.max(20, t + ahead, t * 1.1)], y: [0, 1.1 * target], xLabel: "s", yLabel: "kPa",
    layers: [
      { kind: "level", y: target, text: `target ${num(target, 0)} kPa` },
      { kind: "line", colour: "amber", dash: [5, 4], width: 1.5, points: [[t, kpa], [t + ahead, kpa + slope * ahead]] },
      { kind: "line", points },
    ],
  };
}

/** Taxels whose curves are shown while they grow. */
const SHOWN = 6;

function countsOverPressure() {
  const { ramp, selected } = state;
  if (!ramp?.kpa.length) return null;
  const taxels = ramp.counts[0].length;
  const few = Array.from({ length: Math.min(SHOWN, taxels) }, (_, i) => Math.floor(((i + 0.5) * taxels) / SHOWN));
  const change = (taxel) => ramp.kpa.map((kpa, i) => [kpa, ramp.counts[i][taxel] - ramp.counts[0][taxel]]);
  const lines = few.map((taxel) => ({ kind: "line", colour: "soft", width: 1.2, points: change(taxel) }));
  if (selected !== null) lines.push({ kind: "line", colour: "blue", width: 2.5, points: change(selected) });
  const values = lines.flatMap(({ points }) => points.map(([, y]) => y));
  return {
    x: [0, 1.05 * (state.session?.targetKpa ?? 70)], y: [Math.min(0, ...values) - 1, Math.max(0, ...values) + 1], xLabel: "kPa", yLabel: "counts", layers: lines,
  };
}

function refusedText(refused = {}) {
  const all = Object.entries(refused).filter(([, n]) => Number(n) > 0);
  return all.map(([name, n]) => `${n} ${name.replaceAll("_", " ")}`).join(", ") || "none";
}

/** Why a taxel is excluded, in the words of the verdict (verdict.rs). */
const WHY = {
  dead: "hardly moved", insufficient_swing: "hardly moved", no_data: "gave no usable values", missing: "gave no usable values",
  no_excitation: "saw no change of the pressure", railed: "stayed at an end of the range", frozen: "got stuck or jumped", jumping: "got stuck or jumped",
  module_flicker: "got stuck or jumped", unproven: "had too few samples", poor_fit: "did not follow the pressure closely",
};

/** Taxels without a usable model, by reason; pointed at, they are marked on the skin. */
export function excludedTable(set, skin) {
  const reasons = new Map();
  for (const { status, taxel = 0 } of set.taxels ?? []) {
    const why = WHY[status] ?? status.replaceAll("_", " ");
    if (status !== "ok") reasons.set(why, [...(reasons.get(why) ?? []), taxel]);
  }
  const row = ([reason, list]) => el("tr", { "data-taxels": list.join(" "), onpointerenter: () => skin?.mark(list), onpointerleave: () => skin?.mark(null) },
    el("td", reason), el("td.n", list.length), el("td.wrap", list.slice(0, 30).join(", ") + (list.length > 30 ? " ..." : "")));
  return table(["reason", "#taxels", "which"], [...reasons].map(row), "no taxel is excluded", false);
}

/** The figures of a set that tell it from another. */
export function figures(set) {
  const usable = (set?.taxels ?? []).filter((t) => t.status === "ok");
  const of = (name) => median(usable.map((t) => t.figures?.[name]));
  return {
    usable: usable.length, taxels: set?.taxels?.length ?? 0, rmse: of("rmse_kpa"), swing: of("swing_counts"),
    unloading: 100 * (set?.inUse?.unloading_share ?? NaN), baseline: of("baseline_counts"), noise: of("noise_counts"), top: set?.summary?.pressureMaxKpa,
  };
}

/** Two sets side by side. */
export function compared(one, other, names) {
  const [a, b] = [figures(one), figures(other)];
  const judged = (set) => (set?.verdict ? (set.verdict.isGood ? "good" : "not good") : "–");
  const rows = [
    ["verdict", judged(one), judged(other)],
    ["usable taxels", a.usable, other ? b.usable : "–"],
    ["up to, kPa", num(a.top, 1), num(b.top, 1)],
    ["fit error, kPa (median)", num(a.rmse), num(b.rmse)],
    ["error of a load that decreases, %", num(a.unloading, 1), num(b.unloading, 1)],
    [el("td.wrap", "change of count over the ramp (median)"), num(a.swing, 1), num(b.swing, 1)],
    ["unloaded count (median)", num(a.baseline, 1), num(b.baseline, 1)],
    ["noise, counts (median)", num(a.noise), num(b.noise)],
  ];
  return table(["", `#${names[0]}`, `#${names[1]}`], rows, "", false);
}

/** Whether a calibration is good, in the daemon's words. */
function verdictOf(set) {
  const { isGood = false, lines = [] } = set.verdict ?? {};
  const [first = "", ...others] = lines;
  return [el(`p.advice.${isGood ? "ok" : "bad"}`, first.split(/[.:]/)[0]), el("p", first.replace(/^Good\. |^Not good: /, "")), others.map((line) => el("p.note", line))];
}

function review(signal) {
  const s = state.session;
  const figuresAt = el("div", el("p.note", "reading the models"));
  const [told, excluded] = [el("div", { id: "verdict-of-set" }), el("div")];
  const vent = el("p.advice.warn", { id: "vent" }, "Vent the bag now.");
  const venting = () => { vent.hidden = !(state.session?.pressureKpa >= state.session?.ventedBelowKpa); };
  on("session", venting, signal);
  venting();
  const skin = new SkinView(signal, { values: "counts", overlays: false });
  Promise.all([call("ModelService/GetModelSet", { modelSet: s.modelSet }), state.skin.modelSet ? call("ModelService/GetModelSet", { modelSet: state.skin.modelSet }) : null])
    .then(([fresh, old]) => {
      put(told, verdictOf(fresh));
      put(figuresAt, compared(fresh, old, ["new", "in use"]));
      put(excluded, excludedTable(fresh, skin));
      skin.excluded = new Set(fresh.taxels.filter((t) => t.status !== "ok").map((t) => t.taxel ?? 0));
    })
    .catch((error) => put(figuresAt, el("p", error.message)));
  const use = button("Use these models", async () => {
    await call("ModelService/ActivateModelSet", { patch: state.patch, modelSet: s.modelSet });
    await loadSkin();
  }, { kind: "primary", id: "activate", done: "The models are in use, also after a restart." });
  const more = button("Add a ramp", async () => show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_START_RAMP" })), { id: "more", title: "After venting: its samples join those of this session" });
  const drop = button("Discard", async () => {
    if (await sure("Discard this session? Its models cannot be used any more; its samples are kept.", "Discard it")) show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_DISCARD" }));
  }, { kind: "danger", id: "discard" });
  return el("div.live",
    el("section.card", el("h2", `Review of session ${s.session}`), vent, told, el("div.row", use, more, drop), el("h3", "Figures"), figuresAt,
      el("h3", "Excluded: point at a line to see where"), excluded, s.reason && el("p.note", s.reason),
      el("p.note", "Point at taxels to see their curves.")),
    el("div.stack", el("section.card", el("h2", "Where the excluded taxels are (colour: change of count now)"), skin.node), taxelCard(signal)));
}

function finished(anew) {
  return el("section.card", el("h2", `The models of session ${state.session.session} are in use`),
    el("p", `Model set ${state.session.modelSet}. Take the bag off. Then tare, and weigh known masses.`),
    el("div.row",
      tareButton(),
      el("a.button", { href: "#validate" }, "Weigh masses"), button("Calibrate again", async () => anew(), { id: "again" })));
}

function ended(now) {
  const s = state.session;
  const again = now === "DISCARDED" ? null : button("Go on with another ramp", async () => show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_START_RAMP" })), { id: "more" });
  const fit = ["INTERRUPTED", "FAILED"].includes(now)
    ? button("Fit what there is", async () => show(await call("CalibrationService/AdvanceSession", { ...session(), action: "SESSION_ACTION_FINISH_RAMP" }))) : null;
  return el("section.card", el("h2", `Session ${s.session} is ${word(s.state, "SESSION_STATE_")}`),
    s.reason && el("p", s.reason), el("p.note", `${s.accepted ?? 0} scans are used so far.`), el("div.row", again, fit));
}
