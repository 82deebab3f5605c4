#!/usr/bin/env python3
"""The page in a browser: a whole calibration and validation of the demo's skin, clicked through.

    tests/page/run.py TAXELD SCRATCH

Needs chromium, chromedriver and the Python package selenium. Screenshots are left in SCRATCH.
"""

import contextlib
import csv
import pathlib
import re
import signal
import subprocess
import sys
import time

from selenium import webdriver
from selenium.common.exceptions import ElementClickInterceptedException, NoSuchElementException, StaleElementReferenceException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
# The demo's ramp alone takes 37 s; a busy machine may need several times as long.
PATIENCE_S = 300


class Page:
    def __init__(self, address, scratch):
        options = webdriver.ChromeOptions()
        for argument in ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,1000"]:
            options.add_argument(argument)
        options.add_experimental_option("prefs", {"download.default_directory": str(scratch.resolve())})
        options.binary_location = "/usr/bin/chromium"
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.browser = webdriver.Chrome(options, webdriver.ChromeService("/usr/bin/chromedriver"))
        self.address, self.scratch = address, scratch
        self.browser.get(address)

    def go(self, view):
        self.browser.get(f"{self.address}#{view}")

    def find(self, selector):
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector):
        try:
            return self.find(selector).text
        except (NoSuchElementException, StaleElementReferenceException):
            return ""

    def until(self, what, condition, limit_s=PATIENCE_S):
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            try:
                found = condition()
            except (NoSuchElementException, StaleElementReferenceException):
                found = None
            if found:
                return found
            time.sleep(0.05)
        self.shot("failed")
        raise AssertionError(f"{what}: not within {limit_s} s; the page says: {self.text('body')[:3000]}")

    def click(self, selector):
        self.until(f"{selector} can be clicked", lambda: self.find(selector).is_enabled())
        self.find(selector).click()

    def toasts(self):
        """What was told since the last look; closes it."""
        texts = []
        for toast in self.browser.find_elements(By.CSS_SELECTOR, ".toast"):
            texts.append(toast.text)
            self.browser.execute_script("arguments[0].remove()", toast)
        return " | ".join(texts)

    def press_until(self, selector, wanted):
        """Presses a button until it is not refused: in the demo a mass lies on the skin half of the time."""
        def pressed():
            self.toasts()
            if not self.text("dialog"):
                if not self.find(selector).is_enabled():
                    return None  # it works on the press before, whose answer was taken for another's
                try:
                    self.find(selector).click()
                except ElementClickInterceptedException:
                    return None  # the dialog of that press has opened
            told = self.until("an answer", lambda: self.toasts() or self.text("dialog"))
            if self.text("dialog"):  # it asks who confirms that the skin is unloaded: nobody does
                self.click("dialog button[type=button]")
            return told if re.search(wanted, told) else time.sleep(0.3)

        return self.until(f"{selector} answers {wanted}", pressed)

    def step(self):
        return self.text("li[aria-current=step]")

    def shot(self, name, width=1400, height=1000, dark=False):
        self.browser.set_window_size(width, height)
        self.browser.execute_script("document.documentElement.dataset.theme = arguments[0]", "dark" if dark else "light")
        self.browser.execute_script("return import('/store.js').then((store) => store.emit('theme'))")
        if width < 600:  # a window of Chromium cannot be so narrow; its screen can
            metrics = {"width": width, "height": height, "deviceScaleFactor": 2, "mobile": True}
            self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        time.sleep(0.6)
        self.browser.save_screenshot(str(self.scratch / f"{name}.png"))
        wide = self.browser.execute_script("return document.documentElement.scrollWidth - window.innerWidth")
        self.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        self.browser.set_window_size(1400, 1000)
        assert wide <= 1, f"{name}: the page is {wide} px wider than the screen"

    def faults(self):
        """What the browser holds against the page."""
        entries = self.browser.get_log("browser")
        # A daemon that is stopped or refuses is not the page's fault.
        return [e["message"] for e in entries if "the server responded with a status of" not in e["message"] and "ERR_" not in e["message"]]


def newtons(text):
    found = re.search(r"([\d.]+) N\s", text)
    return float(found.group(1)) if found else None


def calibrate(page):
    page.go("calibrate")
    page.until("the checks are there", lambda: "every module sends" in page.text("ul.checks"))
    assert "the zero is invalid: the session takes its own" in page.text("ul.checks"), page.text("ul.checks")
    page.until("the gauge's reading", lambda: re.search(r"the gauge reads -?[\d.]+ kPa", page.text("ul.checks")))
    page.shot("check")
    page.click("#start")
    page.until("the pump", lambda: page.step() == "Pump")
    half = lambda: re.search(r"(3[5-9]|[4-6]\d)\.\d of 70", page.text("main"))
    page.until("half of the range, and advice to go on", lambda: half() and "Go on like this" in page.text("#advice"))
    page.shot("pump")
    page.shot("pump-phone", 390, 844)
    page.until("the review", lambda: page.step() == "Review")
    page.until("its figures", lambda: "fit error, kPa" in page.text("main"))
    page.until("a verdict", lambda: page.text("#verdict-of-set").startswith("Good"))
    page.until("the bag is vented", lambda: not page.find("#vent").is_displayed())
    usable = int(re.search(r"usable taxels (\d+)", page.text("main")).group(1))
    assert usable >= 200, f"{usable} usable taxels"
    page.browser.execute_script("return import('/store.js').then((store) => store.select(100))")
    page.until("the curve", lambda: page.find("#taxel canvas").is_displayed())
    page.shot("review", height=1300)
    page.click("#activate")
    page.until("the models are in use", lambda: "are in use" in page.text("main h2"))
    page.press_until("#tare", "zero taken")
    print(f"calibrated: {usable} usable taxels", flush=True)


def feel(page):
    """Waits for the force of the mass. A zero that was taken while the bag still let go is found out, and taken again."""
    def felt():
        if page.text("#verdict") == "TARE INVALID":
            page.press_until("#tare", "zero taken")
        return page.text("#verdict") in ("OK", "DEGRADED") and (newtons(page.text("#force")) or 0) > 3

    page.until("a force under the mass", felt)


def watch(page):
    page.go("live")
    good = lambda: page.text("#verdict") in ("OK", "DEGRADED")
    feel(page)
    page.browser.execute_script("return import('/store.js').then((store) => store.select(100))")
    page.until("the curve", lambda: page.find("#taxel canvas").is_displayed())
    time.sleep(12)  # so that the minute's course has a load in it, in the picture
    feel(page)
    page.click("#why")
    page.until("what the interval is made of", lambda: re.search(r"[\d.]+ N", page.text("#budget")))
    page.shot("live", height=1500)
    feel(page)
    page.click("#why")
    feel(page)
    page.shot("live-dark", height=1500, dark=True)
    feel(page)
    page.shot("live-phone", 390, 844)
    page.shot("live-phone-dark", 390, 1800, dark=True)
    force = newtons(page.until("a force", lambda: good() and page.text("#force")))
    print(f"live: {page.text('#verdict')}, {force} N", flush=True)
    assert page.text("#simulated") == "simulated"
    keyboard(page)
    in_space(page)
    recorded(page)
    remembered(page)


def in_space(page):
    """The skin in space is turned by a drag, has its force, and is laid flat again."""
    page.click("#solid")
    page.until("the way back", lambda: page.text("#solid") == "Flat")
    feel(page)
    page.shot("solid")
    page.shot("solid-phone-dark", 390, 1500, dark=True)
    skin = page.find("canvas.skin")
    hand = lambda: ActionChains(page.browser).move_to_element(skin)
    hand().click().perform()
    middle = page.until("the taxel in the middle", lambda: page.text("#taxel dd"))
    hand().click_and_hold().move_by_offset(150, 0).release().perform()
    hand().click().perform()
    page.until("another taxel in the middle", lambda: page.text("#taxel dd") not in ("", middle))
    page.shot("solid-turned")
    page.click("#solid")
    # What is in front goes with the hand.
    moved = page.browser.execute_script("""return Promise.all([import('/solid.js'), import('/store.js')]).then(([{ Solid }, { state }]) => {
        const solid = new Solid(state.skin);
        solid.fit(400, 400);
        const before = solid.seen();
        solid.turn(20, 10);
        const moved = solid.seen().map(({ at: [u, v] }, t) => [before[t].near, [u - before[t].at[0], v - before[t].at[1]]]);
        return moved.sort((a, b) => b[0] - a[0]).slice(0, 20).map(([, by]) => by); })""")
    assert len(moved) == 20 and all(right > 0 and down > 0 for right, down in moved), moved


def recorded(page):
    """The forces that came while it recorded are a table."""
    (page.scratch / "force-left_forearm.csv").unlink(missing_ok=True)
    page.click("#save-force")
    page.until("twenty forces", lambda: int(re.search(r"\d+|$", page.text("#save-force")).group() or 0) >= 20)
    page.click("#save-force")
    rows = page.until("the file", lambda: list(csv.DictReader((page.scratch / "force-left_forearm.csv").open()))
                      if (page.scratch / "force-left_forearm.csv").exists() else None)
    assert len(rows) >= 20 and all(row["patch"] == "left_forearm" and row["state"] and float(row["age_s"]) < 5 for row in rows), rows[:3]
    assert page.text("#save-force") == "Record"


def remembered(page):
    """A page that is opened anew has the forces before it from the daemon, and those that were none as none."""
    page.browser.refresh()
    kept = page.until("the forces of before", lambda: page.browser.execute_script(
        """return import('/store.js').then(({ state }) => state.course.filter(({ t }) => t < -3)
            .map(({ n, low, word }) => [Number.isFinite(n) && Number.isFinite(low), n, word]))"""))
    shown = {word: [is_shown for is_shown, _, of in kept if of == word] for _, _, word in kept}
    assert len(kept) > 60 and any(n > 3 for is_shown, n, _ in kept if is_shown), kept
    assert all(shown["OK"]) and not any(shown["UNCALIBRATED"]), shown
    page.until("a force", lambda: page.text("#verdict") in ("OK", "DEGRADED"))
    page.find("option[value='600']").click()
    page.shot("remembered")


def keyboard(page):
    skin = page.find("canvas.skin")
    page.browser.execute_script("arguments[0].focus()", skin)
    before = page.text("#taxel dd")
    skin.send_keys(Keys.ARROW_RIGHT)
    page.until("the arrow key goes to another taxel", lambda: page.text("#taxel dd") not in ("", before))
    page.browser.find_element(By.ID, "counts").send_keys(Keys.ENTER)
    page.until("counts fill the skin", lambda: "counts" in page.find(".legend canvas").get_attribute("aria-label"))


def validate(page):
    page.go("validate")
    for load in range(3):
        page.until("the form", lambda: page.find("#amount"))
        for field, text in [("amount", "0.5"), ("by", "Ada"), ("note", f"disc {load}")]:
            box = page.find(f"#{field}")
            box.clear()
            box.send_keys(text)
        told = page.press_until("#record", r"read [\d.]+ N of 4\.90 N")
        print(f"load {load}: {told}", flush=True)
    page.until("the table", lambda: len(page.browser.find_elements(By.CSS_SELECTOR, "tbody tr")) >= 3)
    error = float(re.search(r"mean absolute error\s*([\d.]+) %", page.text("main")).group(1))
    assert error < 15, f"{error} % off"
    page.shot("validate")
    page.shot("validate-dark", dark=True)


def look_around(page):
    page.go("models")
    page.until("the set in use", lambda: "in use" in page.text("tbody"))
    page.shot("models", height=1300)
    page.go("sessions")
    page.until("the session", lambda: "active" in page.text("tbody"))
    page.shot("sessions")
    page.go("health")
    page.until("a place beside a taxel", lambda: re.search(r"board \d+ module \d+: taxel \d+", page.text("main")))
    page.until("the boards", lambda: page.text("main").count("verified") >= 2)
    page.until("the gauge", lambda: re.search(r"gauge\s+-?[\d.]+ kPa", page.text("main")))
    page.until("the events", lambda: "activated" in page.text("main"))
    page.shot("health")
    page.shot("health-phone", 390, 844)


def freshness(page, daemon):
    """A daemon that hangs is told by the browser's own clock, unmistakably; and what comes after it is good again."""
    page.go("live")
    # A load that goes meanwhile takes the zero with it, until somebody confirms another.
    page.until("a force of nothing", lambda: page.text("#verdict") == "OK" and page.text("#force").startswith("0.0"))
    daemon.send_signal(signal.SIGSTOP)
    try:
        page.until("STALE", lambda: page.text("#verdict") == "STALE" and page.text("#force") == "no force", 20)
        # At first the last sample is too old; when several are due, the page says that none comes.
        page.until("the reason", lambda: "nothing has come" in page.text("#reasons"), 20)
        page.until("the taxels are silent", lambda: page.browser.execute_script(
            "return import('/skin.js').then((skin) => import('/store.js').then(({ state }) =>"
            " state.taxels.taxels.every((taxel, t) => skin.kindOf(taxel, state.skin.taxels[t]) === 'silent')))"), 5)
        assert "noforce" in page.find("#force-card").get_attribute("class")
        page.browser.execute_script("import('/store.js').then((store) => store.select(5))")
        page.until("nothing of one taxel", lambda: "silent" in page.text("#taxel") and "kPa" not in page.text("#taxel"), 5)
        page.shot("stale")
        # Nor does a ramp that was under way look as if it went on, with a pump that does.
        page.browser.execute_script(
            "import('/store.js').then(({ state, emit }) => {"
            " state.session = { session: '99', state: 'SESSION_STATE_RAMPING', pressureKpa: 63.2, targetKpa: 70, rateKpaPerS: 1 };"
            " location.hash = 'calibrate'; emit('session'); })")
        page.until("a word of warning", lambda: page.text("#advice").startswith("Stop: nothing new comes"), 5)
        assert "63.2" not in page.text("#view"), page.text("#view")
        page.shot("stale-ramp")
    finally:
        daemon.send_signal(signal.SIGCONT)
    page.go("live")
    page.until("an answer again", lambda: page.text("#verdict") not in ("", "STALE"))
    print("stale while the daemon hangs, and not after", flush=True)
    # The machine of the browser is suspended, or its clock is set: the force from before is old, and a new connection has a new one.
    page.until("a force", lambda: page.text("#verdict") in ("OK", "DEGRADED"))
    page.browser.execute_script(
        "const day = Date.now.bind(Date); Date.now = () => day() + 30000; window.woken = performance.now() / 1000")
    page.until("a force that is taken for old at first", lambda: page.browser.execute_script(
        "return import('/store.js').then(({ state }) => state.course.some(({ t, word }) => t >= woken && word === 'STALE'))"), 20)
    page.until("a force after it", lambda: page.text("#verdict") in ("OK", "DEGRADED"), 20)
    print("as fresh as before after a suspend of the browser's machine", flush=True)


def judged(page):
    """The page judges each case of the table as the daemon does."""
    for case in csv.DictReader((REPOSITORY / "crates/taxel-proto/src/judge.csv").open()):
        figure = lambda name: {"": "undefined", "nan": "NaN", "inf": "Infinity"}.get(case[name], case[name])
        call = ", ".join([f"'{case['state']}'", *map(figure, ("total_n", "age_s", "waited_s", "max_age_s", "own_s"))])
        said = page.browser.execute_script(f"return import('/judge.js').then(({{ judge }}) => judge({call}))")
        assert said == case["verdict"], (case, said)
    print("the page judges as the daemon does", flush=True)


@contextlib.contextmanager
def demo(taxeld, scratch, bare=True):
    """A demo that runs: the address of its page, and its process."""
    scratch.mkdir(parents=True, exist_ok=True)
    log = open(scratch / "demo.log", "w+")
    daemon = subprocess.Popen([taxeld, "demo", *(["--bare"] if bare else [])], stdout=log, stderr=subprocess.STDOUT)
    try:
        end = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"http://127\.0\.0\.1:\d+/", (scratch / "demo.log").read_text())):
            assert daemon.poll() is None, "the demo ended"
            assert time.monotonic() < end, "the demo printed no address"
            time.sleep(0.1)
        yield found.group(0), daemon
    finally:
        daemon.terminate()
        daemon.wait(30)


def main():
    taxeld, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
    page = None
    with demo(taxeld, scratch) as (address, daemon):
        try:
            page = Page(address, scratch)
            page.until("no force before a calibration", lambda: page.text("#verdict") == "UNCALIBRATED" and page.text("#force") == "no force")
            assert re.search(r"0 silent; without a force", page.text("#force-card")), page.text("#force-card")
            page.shot("uncalibrated")
            page.go("health")
            page.until("why there is no force", lambda: "the zero is invalid: no model set is in use" in page.text("#problems"))
            page.shot("health-uncalibrated")
            calibrate(page)
            watch(page)
            validate(page)
            look_around(page)
            freshness(page, daemon)
            judged(page)
            faults = page.faults()
            assert not faults, faults
            print("the page holds")
        finally:
            if page:
                page.browser.quit()


if __name__ == "__main__":
    main()
