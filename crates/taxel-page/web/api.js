// The service: calls by POST, streams as server-sent events. README.md beside this crate describes both.

/** Streams that the daemon ended with a reason are opened again after so long. */
const REOPEN_MS = 1000;

/** A refusal, with the service's own words. */
export class Refusal extends Error {
  constructor(code, message, reason = "") {
    super(message);
    this.code = code;
    this.reason = reason;
  }
}

/** A daemon that hangs answers nothing; one that runs tells its health in milliseconds. */
const HEALTH_WITHIN_MS = 3000;

/** The health of the daemon. */
export const health = () => call("SkinService/GetHealth", {}, HEALTH_WITHIN_MS);

/** The forces of the last ten minutes as the daemon kept them: seconds ago, state, total, low and high end. */
export async function history(patch) {
  const answer = await fetch(`/history?${new URLSearchParams({ patch })}`);
  return answer.ok ? answer.json() : [];
}

/** Calls `Service/Method` of taxel.v1 and gives its answer, which has to come `within` so many ms. */
export async function call(method, request = {}, within = undefined) {
  let answer;
  try {
    answer = await fetch(`/taxel.v1.${method}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(request),
      signal: within && AbortSignal.timeout(within),
    });
  } catch {
    throw new Refusal("UNAVAILABLE", "the daemon does not answer");
  }
  const body = await answer.json().catch(() => ({}));
  if (!answer.ok) {
    throw new Refusal(body.code ?? "UNKNOWN", body.message ?? `HTTP status ${answer.status}`, body.reason);
  }
  return body;
}

/** All messages of a stream that ends by itself. */
export function all(method, fields = {}) {
  return new Promise((resolve, reject) => {
    const found = [];
    const close = streams([{ method, fields, message: (message) => found.push(message) }], (end) => {
      close();
      if (end.code === "OK") resolve(found);
      else reject(new Refusal(end.code, end.message));
    });
  });
}

/**
 * Streams on one connection. `calls` is a list of `{ method, fields, message }`. It is opened again by itself when it
 * breaks; `ended(end)` tells of each end that the daemon gave a reason for. Gives what closes it.
 */
export function streams(calls, ended = () => {}) {
  const query = calls
    .map(({ method, fields = {} }) => new URLSearchParams([["call", `taxel.v1.${method}`], ...Object.entries(fields)]))
    .join("&");
  let source;
  let again;
  const open = () => {
    source = new EventSource(`/streams?${query}`);
    for (const { method, message } of calls) {
      const name = calls.length > 1 ? `taxel.v1.${method}` : "message";
      source.addEventListener(name, (event) => message(JSON.parse(event.data)));
    }
    source.addEventListener("end", (event) => {
      const end = JSON.parse(event.data);
      source.close(); // with one of several gone the others go on, and what it showed last would stand
      if (end.code !== "OK" && end.code !== "NOT_FOUND") again = setTimeout(open, REOPEN_MS);
      ended(end);
    });
  };
  open();
  return () => {
    clearTimeout(again);
    source.close();
  };
}
