// Whether a force may be acted on: the rule that the daemon and all its readers share.

/**
 * "FORCE", or why a sample is none: "STATE" or "TOO_OLD". It is one while its state is OK or DEGRADED, its total is a number
 * and its age has not passed the daemon's limit or the reader's own, if that is stricter. Times in s; `ageS`: when it was sent,
 * `waitedS`: since then.
 */
export function judge(state, totalN, ageS, waitedS, maxAgeS, ownS = Infinity) {
  if (!["OK", "DEGRADED"].includes(state) || !Number.isFinite(totalN) || typeof ageS !== "number" || Number.isNaN(ageS)) return "STATE";
  const daemons = Number.isFinite(maxAgeS) && maxAgeS > 0 ? maxAgeS : 0;
  return ageS >= 0 && ageS + waitedS <= Math.min(daemons, ownS) ? "FORCE" : "TOO_OLD";
}
