// The page: which view is shown, light or dark, and that nothing streams to a page that nobody looks at.

import { calibrate } from "./calibrate.js";
import { el, put, toast } from "./dom.js";
import { health } from "./health.js";
import { live } from "./live.js";
import { models } from "./models.js";
import { sessions } from "./sessions.js";
import { begin, emit, findSession, isOld, on, open, shut, state, verdict } from "./store.js";
import { validate } from "./validate.js";

const VIEWS = { live: ["Live", live], calibrate: ["Calibrate", calibrate], validate: ["Validate", validate], models: ["Models", models], sessions: ["Sessions", sessions], health: ["Health", health] };

/** How often sessions that others begin are looked for, and a daemon that is gone is tried again, in ms. */
const LOOK_EVERY_MS = 2000;

const at = (id) => document.getElementById(id);
let leave = new AbortController();
let begun = false;

function show() {
  leave.abort();
  leave = new AbortController();
  const name = VIEWS[location.hash.slice(1)] ? location.hash.slice(1) : "live";
  put(at("tabs"), Object.entries(VIEWS).map(([key, [text]]) => el("a", { href: `#${key}`, "aria-current": key === name ? "page" : false }, text)));
  document.title = `${VIEWS[name][0]}: taxeld`;
  if (begun) put(at("view"), VIEWS[name][1](leave.signal));
}

let old = false;

function pill() {
  const now = verdict();
  if (old !== isOld()) {
    old = !old;
    for (const shown of ["selected", "session"]) emit(shown); // of one taxel and of a ramp: it is old now, or new again
  }
  at("pill").className = `pill ${now.kind}`;
  at("pill").title = now.reasons.join("; ");
  if (at("pill").textContent !== now.word) at("pill").textContent = now.word;
}

function theme() {
  let chosen = null;
  try { chosen = localStorage.getItem("theme"); } catch { /* a browser that keeps nothing */ }
  const system = matchMedia("(prefers-color-scheme: dark)");
  const set = () => {
    document.documentElement.dataset.theme = chosen ?? (system.matches ? "dark" : "light");
    emit("theme");
  };
  system.addEventListener("change", set);
  at("theme").addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("theme", chosen); } catch { /* then it is asked again next time */ }
    set();
  });
  set();
}

async function start(patch) {
  try {
    await begin(patch);
    begun = true;
    const select = at("patch");
    select.hidden = state.patches.length < 2;
    put(select, state.patches.map((name) => el("option", { value: name, selected: name === state.patch }, name)));
    show();
  } catch (error) {
    put(at("view"), el("section.card.noforce", el("h2", "There is no daemon to show"), el("p", error.message)));
    setTimeout(() => start(patch), LOOK_EVERY_MS);
  }
}

theme();
show();
addEventListener("hashchange", show);
addEventListener("error", (event) => toast(`This page has a fault: ${event.message}`, "bad"));
at("patch").addEventListener("change", (event) => start(event.target.value));
document.addEventListener("visibilitychange", () => {
  if (!begun) return;
  if (document.hidden && !state.recorded) shut();
  else if (!document.hidden) { open(); findSession().catch(() => {}); }
});
on("force", pill);
setInterval(pill, 200);
setInterval(() => { if (begun && !document.hidden) findSession().catch(() => {}); }, LOOK_EVERY_MS);
start("");
