// How long messages of the daemon are on their way, though it has a clock of its own. All times are in ms.

/** The clock of the daemon may run faster than this browser's by so much, in ms a second. */
const DRIFT = 0.2;

/** The quickest message so far: this browser's clock less the daemon's, and when it came. */
let quickest = { way: Infinity, at: 0 };

/** The quickest before the daemon's clock was found to have stood still, for what was sent before `until` by that clock. */
let before = null;

/** Answers to questions that left before this tell nothing of the clocks as they are. */
let since = -Infinity;

/** Nothing is known of the daemon's clock: it may be another daemon. */
export function forget() {
  quickest = { way: Infinity, at: 0 };
  before = null;
}

/** This browser's clock stood still until `at`, as in a sleep of its machine: how late messages are is not known until an answer tells. */
export function doubt(at) {
  since = at;
  quickest = { way: -Infinity, at: 0 };
  before = null;
}

/** How much longer than the quickest a message was on its way that came at `at` and was `sent` by the daemon's clock. */
export function delay(at, sent) {
  const way = at - sent;
  quickest = { way: Math.min(way, quickest.way + (DRIFT * (at - quickest.at)) / 1000), at };
  return way - (before && sent < before.until ? before.way : quickest.way);
}

/**
 * A question left at `left`, and its answer was `sent` later than that. No message is quicker than this allows, unless the
 * daemon's clock has stood still since, as in a sleep of its machine.
 */
export function asked(left, sent) {
  const least = left - sent;
  if (left < since || least <= quickest.way) return;
  before = { way: quickest.way, until: sent };
  quickest = { way: least, at: left };
}
