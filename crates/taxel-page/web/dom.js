// Elements, numbers as text, and the questions that are asked before something is lost.

/** An element: `el("p.note", { id: "x", onclick }, "text", child)`. */
export function el(selector, ...rest) {
  const [tag, ...classes] = selector.split(".");
  const node = document.createElement(tag);
  node.className = classes.join(" ");
  const first = rest[0];
  const isProps = first && typeof first === "object" && !(first instanceof Node) && !Array.isArray(first);
  for (const [name, value] of Object.entries(isProps ? rest.shift() : {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name in node && typeof value !== "string") node[name] = value;
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...nodes(rest));
  return node;
}

/** What a node is to hold. In a text, what stands in backquotes is code. */
function nodes(children) {
  const coded = (text) => text.split("`").map((part, i) => (i % 2 ? el("code", part) : part));
  return children.flat(9).filter((child) => child !== null && child !== undefined && child !== false)
    .flatMap((child) => (typeof child === "string" ? coded(child) : child));
}

/** Puts `children` in place of what `node` holds. */
export function put(node, ...children) {
  node.replaceChildren(...nodes(children));
}

/** A number with so many places behind the point, and no minus before a zero; a dash if there is none. */
export function num(value, places = 2) {
  return value === undefined || value === null || !Number.isFinite(Number(value)) ? "–" : Number(value).toFixed(places).replace(/^-(?=[0.]+$)/, "");
}

/** A share as percent. */
export const percent = (share, places = 0) => (share === undefined ? "–" : `${num(100 * share, places)} %`);

/** A time as the reader's clock shows it. */
export const when = (time) => (time ? new Date(time).toLocaleString() : "–");

/** A word of an enumeration without its prefix: FORCE_STATE_TARE_INVALID is `tare invalid`. */
export const word = (value, prefix) => (value ?? "").replace(prefix, "").toLowerCase().replaceAll("_", " ");

/** The middle of some numbers. */
export function median(values) {
  const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : NaN;
}

/** A list of names and values as dt and dd; a third part explains the name on the spot. */
export const facts = (pairs) =>
  el("dl", pairs.filter((pair) => pair && pair[1] !== undefined).map(([name, value, title]) => [el("dt", { title }, name), el("dd", value)]));

/** A table: heads begin with `#` where the column holds numbers. On a phone each row becomes a block, unless `folds` is false. */
export function table(heads, rows, empty = "nothing yet", folds = true) {
  if (!rows.length) return el("p.note", empty);
  const numeric = heads.map((head) => head.startsWith("#"));
  const cell = (tag, content, i) => {
    const node = content instanceof Node && content.nodeName === tag.toUpperCase() ? content : el(numeric[i] ? `${tag}.n` : tag, content);
    node.dataset.head = heads[i].replace("#", "");
    return node;
  };
  return el("div.scroll", el(folds ? "table.folds" : "table",
    el("thead", el("tr", heads.map((head, i) => cell("th", head.replace("#", ""), i)))),
    el("tbody", rows.map((row) => (row instanceof Node ? row : el("tr", row.map((content, i) => cell("td", content, i))))))));
}

/** Tells something for a while; what went wrong stays until it is clicked away. */
export function toast(text, kind = "ok") {
  const node = el(`div.toast.${kind}`, { onclick: () => node.remove(), title: "click to close" }, text);
  const all = document.getElementById("toasts");
  all.append(node);
  while (all.children.length > 4) all.firstChild.remove();
  if (kind === "ok") setTimeout(() => node.remove(), 6000);
}

/** Runs what a button is for: disabled meanwhile, and told if it is refused. */
export function doing(button, work, done) {
  return async (event) => {
    event?.preventDefault();
    button.disabled = true;
    try {
      const answer = await work();
      if (done) toast(typeof done === "function" ? done(answer) : done);
    } catch (error) {
      toast(error.message, "bad");
    } finally {
      button.disabled = false;
    }
  };
}

/** A button that does `work`. */
export function button(text, work, { kind = "", done, ...props } = {}) {
  const node = el(kind ? `button.${kind}` : "button", { type: "button", ...props }, text);
  node.addEventListener("click", doing(node, work, done));
  return node;
}

/** A question with fields and two buttons; gives what `answer()` says, or nothing if it was cancelled. */
function dialogue(content, yes, kind, answer) {
  return new Promise((resolve) => {
    const end = (given) => { dialog.close(); dialog.remove(); resolve(given); };
    const go = el(`button.${kind}`, { id: "sure", type: "submit" }, yes);
    const form = el("form", { onsubmit: (event) => { event.preventDefault(); end(answer()); } }, content,
      el("div.row", go, el("button", { type: "button", onclick: () => end() }, "Cancel")));
    const dialog = el("dialog", form);
    dialog.addEventListener("cancel", () => end());
    window.addEventListener("hashchange", () => end(), { once: true }); // it belongs to the page that asked
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** Asks before something is lost. Gives whether it is wanted. */
export const sure = async (question, yes) => Boolean(await dialogue(el("p", question), yes, "danger", () => true));

/** Asks who confirms that nothing touches the skin, after a refusal. Gives the name, or nothing. */
export function whoConfirms(refused) {
  const name = el("input", { required: true, maxLength: 200, id: "confirmed-by" });
  const content = [el("p", refused.replace(/ If it is unloaded: `taxeld .*$/, "")), el("p", "If nothing touches the skin, confirm it with your name. It is kept in the audit log."), el("label", "Your name", name)];
  return dialogue(content, "Confirm: nothing touches the skin", "primary", () => name.value);
}

/** Saves a text as a file. */
export function download(name, text, type = "application/json") {
  const link = el("a", { download: name });
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
