// What the page knows: newest values, when they came, and how old they are now by this browser's clock.

import { call, health as askHealth, history, streams } from "./api.js";
import { delay, forget } from "./clock.js";
import { judge } from "./judge.js";
import { unroll } from "./unroll.js";

/** The daemon sends thirty times a second: when nothing comes for so long, it is not heard. */
const SILENT_S = 0.5;

/** Values a second that are asked for: what an eye and a screen can use. */
const RATE_HZ = 30;

/** How much of the force over time is shown, and how often this page keeps a point at most, in s. */
export const COURSE_S = 600;
const COURSE_EVERY_S = 0.1;

/** Between points that are farther apart nothing is known, in s: the daemon keeps two a second. */
export const GAP_S = 1.2;

/** Points that are kept of a ramp for each taxel. */
const RAMP_POINTS = 3000;

/** While forces come late the streams are opened anew, at most so often, in ms: nothing waits in a new connection. */
const REOPEN_EVERY_MS = 5000;

export const state = {
  patch: "", patches: [], skin: null, layout: null, force: null, taxels: null, session: null, modelSet: null,
  course: [], recorded: null, shown: null, selected: null, ramp: null,
};

const listeners = new Map();

/** Calls `listener` at each event of this name until the signal ends it. */
export function on(name, listener, signal) {
  if (!listeners.has(name)) listeners.set(name, new Set());
  listeners.get(name).add(listener);
  signal?.addEventListener("abort", () => listeners.get(name).delete(listener));
}

export function emit(name) {
  for (const listener of listeners.get(name) ?? []) listener();
}

let close = () => {};
let closeSession = () => {};
/** When the newest force came, by this browser's two clocks, in ms, and how long it was on its way. */
let received = { at: -Infinity, wall: -Infinity, late: 0 };
let openedAt = -Infinity;

/** How long the newest force has been here, in ms. The page's own clock may stand still while this machine is suspended, and the
 * wall clock may be set: the longer time counts. */
const held = () => Math.max(performance.now() - received.at, Date.now() - received.wall);

/** Time since the newest force was sent, in s. */
const waited = () => (received.late + held()) / 1000;

/** Age of the newest force now, in s: what the daemon said, its time on the way, and the time since. */
export function age() {
  if (!state.force || state.force.ageS === undefined) return undefined;
  return state.force.ageS + waited();
}

const isSilent = () => held() > SILENT_S * 1000;

/** A force older than this is not shown as one: the daemon says so with each. */
const maxAge = () => state.force?.maxAgeS ?? 0;

/** Whether nothing comes from the daemon, or comes so late, that what is known is not what is. */
export const isOld = () => isSilent() || !(age() <= maxAge());

/** How far the force may be trusted, judged here and now: `{ word, kind, shown, reasons }`. */
export function verdict() {
  const force = state.force;
  if (!force) return { word: "NO DATA", kind: "bad", shown: false, reasons: ["nothing has come from the daemon yet"] };
  if (isSilent()) {
    return { word: "STALE", kind: "bad", shown: false, reasons: [`nothing has come from the daemon for ${(held() / 1000).toFixed(1)} s`] };
  }
  const name = (force.state ?? "").replace("FORCE_STATE_", "");
  const judged = judge(name, force.totalN, force.ageS, waited(), maxAge());
  if (judged === "TOO_OLD") {
    const reasons = [`the newest frame is ${age().toFixed(1)} s old`, ...(force.reasons ?? [])];
    return { word: "STALE", kind: "bad", shown: false, reasons };
  }
  const shown = judged === "FORCE";
  const kind = name === "OK" ? "ok" : shown ? "warn" : "bad";
  return { word: name.replaceAll("_", " ") || "UNKNOWN", kind, shown, reasons: force.reasons ?? [] };
}

/** Forces come late: they wait somewhere on their way, or one of the two clocks was set. */
function comesLate() {
  if (performance.now() > openedAt + REOPEN_EVERY_MS) open();
}

function takeForce(force) {
  if (force.patch !== state.patch) return; // of the one that was shown before
  const [now, wall] = [performance.now(), Date.now()];
  const newModels = state.force && state.force.modelSet !== force.modelSet;
  received = { at: now, wall, late: force.sent === undefined ? Infinity : delay(wall, Date.parse(force.sent)) };
  state.force = force;
  if (received.late > (force.maxAgeS ?? 0) * 1000) comesLate();
  const { word, shown } = verdict();
  const last = state.course.at(-1);
  // Of the values of a tenth of a second the greatest is kept; one that is no force is never hidden by one that is.
  const point = { t: now / 1000, n: shown ? force.totalN : NaN, low: shown ? force.lowN : NaN, high: shown ? force.highN : NaN, word };
  if (!last || last.t < point.t - COURSE_EVERY_S || (shown !== Number.isFinite(last.n))) state.course.push(point);
  else if (point.n > last.n) Object.assign(last, point, { t: last.t });
  while (state.course[0].t < now / 1000 - COURSE_S) state.course.shift();
  if (newModels) loadSkin().catch(() => {});
  emit("force");
}

function takeTaxels(sample) {
  if (sample.patch !== state.patch) return;
  state.taxels = sample;
  keepOfRamp(sample);
  emit("taxels");
}

/** Count against pressure while a ramp runs, for the samples under a curve. As this page saw them: the session's own
 * samples are paired by the daemon's clock. */
function keepOfRamp(sample) {
  const { session } = state;
  if (session?.state !== "SESSION_STATE_RAMPING" || session.pressureKpa === undefined) return;
  if (state.ramp?.session !== session.session) state.ramp = { session: session.session, sequence: "", at: [], kpa: [], counts: [] };
  if (state.ramp.sequence === sample.sequence || state.ramp.kpa.length >= RAMP_POINTS) return;
  state.ramp.sequence = sample.sequence;
  state.ramp.at.push(performance.now() / 1000);
  state.ramp.kpa.push(session.pressureKpa);
  state.ramp.counts.push(Uint8Array.from(sample.taxels, (taxel) => taxel.count ?? 0));
}

/** Taxels of the patch by their number, with the board and module that they are on. */
export function places(taxels) {
  const modules = new Map();
  for (const taxel of taxels) {
    const name = state.layout?.moduleOf[taxel]?.name ?? "";
    modules.set(name, [...(modules.get(name) ?? []), taxel]);
  }
  return [...modules].map(([name, all]) => `${name && `${name}: `}taxel ${all.join(", ")}`).join("; ");
}

/** Layout and models of the patch. */
export async function loadSkin() {
  const { patch } = state;
  const skin = await call("SkinService/GetSkin", { patch });
  const modelSet = skin.modelSet ? await call("ModelService/GetModelSet", { modelSet: skin.modelSet }) : null;
  if (patch !== state.patch) return; // another one was chosen meanwhile
  Object.assign(state, { skin, layout: unroll(skin), modelSet });
  emit("skin");
}

/** Fills what this page did not see with what the daemon kept. */
async function recall() {
  const { patch } = state;
  const kept = await history(patch).catch(() => []);
  if (patch !== state.patch) return;
  const now = performance.now() / 1000;
  const points = kept.map(([ago, word, n, low, high]) => ({ t: now - ago, n: n ?? NaN, low: low ?? NaN, high: n === null ? NaN : high ?? undefined, word }));
  const isNew = ({ t }) => !state.course.some((own) => Math.abs(own.t - t) < GAP_S / 2);
  state.course = [...state.course, ...points.filter(isNew)].sort((a, b) => a.t - b.t);
}

/** Opens the streams of the patch. */
export function open() {
  close();
  forget();
  openedAt = performance.now();
  recall();
  const fields = { patch: state.patch, rateHz: RATE_HZ };
  close = streams([
    { method: "ForceService/StreamForce", fields, message: takeForce },
    { method: "SkinService/StreamTaxels", fields, message: takeTaxels },
  ]);
}

/** Closes everything, for a page that nobody looks at. */
export function shut() {
  close();
  closeSession();
  watched = null;
}

let watched = null;

/** Follows this session from now on. */
export function watch(session) {
  state.session = session;
  emit("session");
  if (watched === session.session) return;
  watched = session.session;
  closeSession();
  const message = (newest) => { state.session = newest; emit("session"); };
  const ended = () => { watched = null; };
  closeSession = streams([{ method: "CalibrationService/WatchSession", fields: { session: session.session }, message }], ended);
}

/** Looks whether somebody began a session, here or elsewhere. */
export async function findSession() {
  const { sessions = [] } = await call("CalibrationService/ListSessions", { patch: state.patch, most: 1 });
  const newest = sessions[0];
  if (!newest) {
    if (state.session) { state.session = null; emit("session"); }
    return;
  }
  if (newest.session !== state.session?.session || (newest.state !== state.session.state && watched === null)) watch(newest);
}

/** Shows this taxel. */
export function select(taxel) {
  state.selected = taxel;
  emit("selected");
}

/** Begins with this patch, or the first one. */
export async function begin(patch) {
  state.patches = (await call("SkinService/GetSkin", { patch }).catch(async (refused) => {
    // Several patches and no name: the refusal names them all.
    const health = await askHealth();
    const names = (health.patches ?? []).map((p) => p.patch);
    if (!names.length) throw refused;
    return { patches: names, patch: names[0] };
  })).patches ?? [];
  close();
  state.patch = state.patches.includes(patch) ? patch : state.patches[0];
  Object.assign(state, { force: null, taxels: null, session: null, course: [], shown: null, selected: null, ramp: null });
  await loadSkin();
  open();
  await findSession();
}
