// How long messages of the daemon are on their way, though its wall clock and this browser's may differ. All times are in ms.

/** Two clocks part by so much at most, in ms a second. */
const DRIFT = 0.2;

/** This browser's clock less the daemon's, by the quickest message of this connection, and when that came. */
let quickest = { way: Infinity, at: 0 };

/** The connection is a new one: nothing waits in it. */
export function forget() {
  quickest = { way: Infinity, at: 0 };
}

/** How much longer than the quickest a message was on its way that came at `at` and was `sent` by the daemon's clock. */
export function delay(at, sent) {
  const way = at - sent;
  quickest = { way: Math.min(way, quickest.way + (DRIFT * Math.max(0, at - quickest.at)) / 1000), at };
  return way - quickest.way;
}
