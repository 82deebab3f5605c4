#!/usr/bin/env python3
"""The moving picture of the page in README.md: a load comes and goes on the demo's skin, flat and in space.

    tests/page/picture.py TAXELD crates/taxel-page/doc/page.webp

Needs what tests/page/run.py needs, and Pillow.
"""

import io
import pathlib
import sys
import tempfile
import time

from PIL import Image
from run import Page, demo, newtons
from selenium.webdriver.common.action_chains import ActionChains

SECONDS, EVERY_S = 10, 0.25
SIZE = {"width": 1060, "height": 700, "deviceScaleFactor": 1, "mobile": False}
SHOWN = (848, 560)
TURNS_PX = [-14] * 8 + [14] * 8  # to one side and back, while the load lies there


def film(page):
    """Frames with the time of each: the load's whole period, then the skin in space, turned by hand."""
    frames = []

    def frame():
        frames.append((time.monotonic(), Image.open(io.BytesIO(page.browser.get_screenshot_as_png())).convert("RGB").resize(SHOWN)))
        time.sleep(max(0, frames[-1][0] + EVERY_S - time.monotonic()))

    loaded = lambda: (newtons(page.text("#force")) or 0) > 3
    page.until("the load goes", loaded) and page.until("it is gone", lambda: not loaded())
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        frame()
    page.until("the load", loaded)
    page.click("#solid")
    ActionChains(page.browser, duration=20).move_to_element(page.find("canvas.skin")).click_and_hold().perform()
    for right in TURNS_PX:
        ActionChains(page.browser, duration=20).move_by_offset(right, 0).perform()
        frame()
    return frames


def main():
    out = pathlib.Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as scratch, demo(sys.argv[1], pathlib.Path(scratch), bare=False) as (address, _):
        page = Page(address, pathlib.Path(scratch))
        try:
            page.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SIZE)
            page.browser.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
            frames = film(page)
        finally:
            page.browser.quit()
    times = [at for at, _ in frames]
    lasts = [min(600, round(1000 * (b - a))) for a, b in zip(times, times[1:])] + [1500]
    first, *others = [picture for _, picture in frames]
    first.save(out, save_all=True, append_images=others, duration=lasts, loop=0, quality=45, method=6)
    size = out.stat().st_size
    assert size <= 700_000, f"{size} bytes: lower the quality"
    print(f"{out}: {len(frames)} frames, {sum(lasts) / 1000:.0f} s, {size // 1000} kB")


if __name__ == "__main__":
    main()
