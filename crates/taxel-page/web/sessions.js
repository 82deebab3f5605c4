// Sessions: what was gathered, and what became of it.

import { all, call } from "./api.js";
import { button, download, el, num, percent, put, sure, table, toast, when, word } from "./dom.js";
import { on, state, watch } from "./store.js";

export function sessions(signal) {
  const list = el("div");
  const more = el("div.row");
  let found = [];
  const show = (next) => {
    if (signal.aborted) return;
    const heads = ["#session", "began", "state", "#ramps", "#scans", "covered", "model set", "why", ""];
    put(list, table(heads, found.map((one) => row(one, update)), "no session yet"));
    put(more, next && button("Older ones", () => load(next)));
  };
  const load = async (before = 0) => {
    const { sessions = [] } = await call("CalibrationService/ListSessions", { patch: state.patch, most: 50, before });
    found = before ? [...found, ...sessions] : sessions;
    show(sessions.length === 50 && sessions[49].session);
  };
  const update = () => load().catch((error) => toast(error.message, "bad"));
  let last = "";
  on("session", () => {
    const now = `${state.session?.session}/${state.session?.state}`;
    if (now !== last) { last = now; update(); }
  }, signal);
  update();
  return el("section.card", el("h2", "Sessions"), list, more);
}

function row(one, update) {
  const request = { session: one.session };
  const now = word(one.state, "SESSION_STATE_");
  const goOn = ["review", "interrupted", "failed", "aborted"].includes(now) && button("Add a ramp", async () => {
    watch(await call("CalibrationService/AdvanceSession", { ...request, action: "SESSION_ACTION_START_RAMP" }));
    location.hash = "#calibrate";
  });
  const open = !["active", "discarded", "aborted", "failed"].includes(now) && el("a.button", { href: "#calibrate" }, "Open");
  const discard = ["review", "interrupted"].includes(now) && button("Discard", async () => { await call("CalibrationService/AdvanceSession", { ...request, action: "SESSION_ACTION_DISCARD" }); await update(); });
  const remove = ["active", "discarded", "aborted", "failed", "review", "interrupted"].includes(now) && button("Delete", async () => {
    if (!(await sure(`Delete session ${one.session} with its samples for good?`, "Delete it"))) return;
    await call("CalibrationService/DeleteSession", request);
    await update();
  }, { kind: "danger" });
  const save = one.accepted && button("Export", async () => download(`session-${one.session}.csv`, (await all("CalibrationService/ExportSamples", request)).map((piece) => piece.text ?? "").join(""), "text/csv"));
  return [one.session, when(one.started), now, one.ramps ?? 0, one.accepted ?? 0, `${percent(one.coverage ?? 0)} of ${num(one.targetKpa, 0)} kPa`,
    one.modelSet ?? "", el("td.wrap", one.reason ?? ""), el("td", el("div.row", open, goOn, save, discard, remove))];
}
