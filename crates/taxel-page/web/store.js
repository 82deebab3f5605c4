// What the page knows: newest values, when they came, and how old they are now by this browser's clock.

import { call, health as askHealth, streams } from "./api.js";
import { asked, delay, doubt, forget } from "./clock.js";
import { unroll } from "./unroll.js";

/** The daemon sends thirty times a second: when nothing comes for so long, it is not heard. */
const SILENT_S = 0.5;

/** Values a second that are asked for: what an eye and a screen can use. */
const RATE_HZ = 30;

/** How long the course of the force is kept. */
const COURSE_S = 60;

/** Points that are kept of a ramp for each taxel. */
const RAMP_POINTS = 3000;

/** While forces come late the daemon is asked so often, in ms, whether its clock has stood still. */
const ASK_EVERY_MS = 1000;

export const state = {
  patch: "", patches: [], skin: null, layout: null, force: null, taxels: null, session: null, modelSet: null,
  course: [], selected: null, ramp: null, frames: 0,
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
let received = 0;
let late = 0;
let askedAt = -Infinity;

/** The wall clock goes on while this machine sleeps, and a page's own may not: by more than this, in ms, they part in no other way
 * but a clock that is set. */
const ASLEEP_MS = 250;
const wall = () => Date.now() - performance.now();
let parted = wall();

/** Whether this machine has slept since the last look: then nothing is known of what came before, or was on its way. */
function hasSlept() {
  const now = wall();
  const apart = Math.abs(now - parted);
  parted = now;
  if (apart < ASLEEP_MS) return false;
  [received, askedAt] = [-Infinity, -Infinity];
  doubt(performance.now());
  [state.course, state.ramp] = [[], null]; // when that was nobody knows any more
  return true;
}

/** Age of the newest force now, in s: what the daemon said, its time on the way, and the time since. */
export function age() {
  if (!state.force || state.force.ageS === undefined) return undefined;
  return state.force.ageS + (late + performance.now() - received) / 1000;
}

const isSilent = () => hasSlept() || performance.now() - received > SILENT_S * 1000;

/** A force older than this is not shown as one: the daemon says so with each. */
const maxAge = () => state.force?.maxAgeS ?? 0;

/** Whether nothing comes from the daemon, or comes so late, that what is known is not what is. */
export const isOld = () => isSilent() || !(age() <= maxAge());

/** How far the force may be trusted, judged here and now: `{ word, kind, shown, reasons }`. */
export function verdict() {
  const force = state.force;
  if (!force) return { word: "NO DATA", kind: "bad", shown: false, reasons: ["nothing has come from the daemon yet"] };
  if (isSilent()) {
    const silent = (performance.now() - received) / 1000;
    const since = Number.isFinite(silent) ? `for ${silent.toFixed(1)} s` : "since this machine slept";
    return { word: "STALE", kind: "bad", shown: false, reasons: [`nothing has come from the daemon ${since}`] };
  }
  const old = age();
  if (old > maxAge()) {
    const text = Number.isFinite(old) ? `${old.toFixed(1)} s` : "nobody knows how";
    return { word: "STALE", kind: "bad", shown: false, reasons: [`the newest frame is ${text} old`, ...(force.reasons ?? [])] };
  }
  const name = (force.state ?? "").replace("FORCE_STATE_", "").replaceAll("_", " ");
  const shown = force.totalN !== undefined;
  const kind = name === "OK" ? "ok" : shown ? "warn" : "bad";
  return { word: name || "UNKNOWN", kind, shown, reasons: force.reasons ?? [] };
}

/** When a force was sent, in ms of the daemon's clock; undefined while no frame has come. */
function sentAt(force) {
  if (force.monotonicNs === undefined || force.ageS === undefined) return undefined;
  return Number(force.monotonicNs) / 1e6 + force.ageS * 1000;
}

/** Messages that come late were long on their way, or the daemon's clock has stood still: an answer tells which. */
async function askClock(now) {
  if (now < askedAt + ASK_EVERY_MS) return;
  askedAt = now;
  const answer = await call("ForceService/GetForce", { patch: state.patch }).catch(() => ({}));
  const sent = sentAt(answer);
  if (sent !== undefined) asked(now, sent);
}

function takeForce(force) {
  if (force.patch !== state.patch) return; // of the one that was shown before
  hasSlept();
  const now = performance.now();
  const sent = sentAt(force);
  if (sent !== undefined) late = delay(now, sent);
  if (late + 1000 * (force.ageS ?? 0) > (force.maxAgeS ?? 0) * 1000) askClock(now);
  const newModels = state.force && state.force.modelSet !== force.modelSet;
  received = now;
  state.force = force;
  const { word, shown } = verdict();
  state.course.push({ t: now / 1000, n: shown ? force.totalN : NaN, s: force.totalSigmaN ?? NaN, word });
  while (state.course[0].t < now / 1000 - COURSE_S) state.course.shift();
  if (newModels) loadSkin().catch(() => {});
  emit("force");
}

function takeTaxels(sample) {
  if (sample.patch !== state.patch) return;
  state.taxels = sample;
  state.frames += 1;
  keepOfRamp(sample);
  emit("taxels");
}

/** Count against pressure while a ramp runs, for the samples under a curve. As this page saw them: the session's own
 * samples are paired by the daemon's clock. */
function keepOfRamp(sample) {
  const { session } = state;
  if (session?.state !== "SESSION_STATE_RAMPING" || session.pressureKpa === undefined) return;
  if (state.ramp?.session !== session.session) state.ramp = { session: session.session, sequence: "", kpa: [], counts: [] };
  if (state.ramp.sequence === sample.sequence || state.ramp.kpa.length >= RAMP_POINTS) return;
  state.ramp.sequence = sample.sequence;
  state.ramp.kpa.push(session.pressureKpa);
  state.ramp.counts.push(Uint8Array.from(sample.taxels, (taxel) => taxel.count ?? 0));
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

/** Opens the streams of the patch. */
export function open() {
  close();
  forget();
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
  const { sessions = [] } = await call("CalibrationService/ListSessions", { patch: state.patch, pageSize: 1 });
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
  Object.assign(state, { force: null, taxels: null, session: null, course: [], selected: null, ramp: null });
  await loadSkin();
  open();
  await findSession();
}
