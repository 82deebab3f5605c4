#!/usr/bin/env python3
"""How many pictures of the skin a second the page draws, and what one costs.

    cargo run --release -p taxel-page --example thousand_taxels -- 127.0.0.1:8090 &
    tests/page/frames.py http://127.0.0.1:8090/ SCRATCH

Needs what tests/page/run.py needs. Nothing is judged here: a time says something of the machine, too.
"""

import pathlib
import sys
import time

from run import Page

SECONDS = 10

MEASURE = """
const done = arguments[arguments.length - 1];
Promise.all([import('/skin.js'), import('/store.js')]).then(([{ SkinView }, { state }]) => {
  const times = [];
  const draw = SkinView.prototype.draw;
  SkinView.prototype.draw = function () { const t = performance.now(); draw.call(this); times.push(performance.now() - t); };
  const [frames, begun] = [state.frames, performance.now()];
  setTimeout(() => {
    SkinView.prototype.draw = draw;
    const seconds = (performance.now() - begun) / 1000;
    times.sort((a, b) => a - b);
    done({ taxels: state.skin.taxels.length, drawn: times.length / seconds, received: (state.frames - frames) / seconds,
      median: times[times.length >> 1], worst: times.at(-1) });
  }, arguments[0] * 1000);
});
"""


def main():
    scratch = pathlib.Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    page = Page(sys.argv[1], scratch)
    try:
        page.until("a force", lambda: page.text("#verdict") == "OK")
        time.sleep(1)
        page.browser.set_script_timeout(SECONDS + 30)
        found = page.browser.execute_async_script(MEASURE, SECONDS)
        print(f"{found['taxels']} taxels: {found['received']:.1f} samples/s received, {found['drawn']:.1f} pictures/s drawn, "
              f"{found['median']:.1f} ms each in the median, {found['worst']:.1f} ms at most")
        page.shot("thousand")
    finally:
        page.browser.quit()


if __name__ == "__main__":
    main()
