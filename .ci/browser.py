"""Opens pages of `prehend view` in Chromium and looks at them as a reader does.

browser.py DEMO.html MANY.html MANY.json: the page of the demo, and one of a plan with many grasps, with that plan.
"""

import io
import json
import shutil
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

# What is drawn without a graphics card, and without a sandbox, which root has not.
ARGUMENTS = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader",
             "--enable-unsafe-swiftshader", "--window-size=1100,760"]
PATIENCE_S = 60


def driver():
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or sys.exit("missing: chromium")
    for argument in ARGUMENTS:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver") or sys.exit("missing: chromedriver")))


class Page:
    def __init__(self, browser, path):
        self.browser = browser
        browser.get(Path(path).resolve().as_uri())
        self.wait(lambda: self.root("ready") == "true", "the page is ready")

    def root(self, name):
        return self.browser.execute_script(f"return document.documentElement.dataset.{name}")

    def wait(self, condition, what):
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, f"waited in vain until {what}; console: {self.browser.get_log('browser')}"
            time.sleep(0.05)

    def id(self, name):
        return self.browser.find_element(By.ID, name)

    def picture(self):
        """The scene's pixels, once they no longer change."""
        before = None
        for _ in range(100):
            now = np.asarray(Image.open(io.BytesIO(self.id("scene").screenshot_as_png)).convert("RGB")).astype(int)
            if before is not None and np.array_equal(before, now):
                return now
            before = now
            time.sleep(0.1)
        raise AssertionError("the scene never rests")

    def step(self, wanted):
        """Moves the slider by the keyboard."""
        slider = self.id("step")
        slider.send_keys(Keys.HOME + Keys.ARROW_RIGHT * wanted)
        self.wait(lambda: self.root("step") == str(wanted), f"the hand is at step {wanted}")

    def column(self, number):
        cells = self.browser.find_elements(By.CSS_SELECTOR, f"#grasps tbody td:nth-child({number})")
        return [cell.text for cell in cells]


def changed(a, b):
    """How many pixels differ by more than shades."""
    return int((np.abs(a - b).max(axis=2) > 40).sum())


def check_quiet(browser, requests):
    said = [entry for entry in browser.get_log("browser") if entry["level"] != "WARNING" or entry["source"] != "rendering"]
    assert not said, said
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    urls = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    outside = [url for url in urls if not url.startswith(("file:", "data:", "blob:"))]
    assert not outside, outside
    assert len(urls) >= requests, "the log of requests has not even the page"


def scene(browser, path):
    page = Page(browser, path)
    page.step(24)
    grasp = page.picture()
    # Not blank: object, hand, arm and table are colours of their own, each over more than a speck.
    colours, counts = np.unique(grasp.reshape(-1, 3) // 32, axis=0, return_counts=True)
    assert (counts > 200).sum() >= 6, f"{(counts > 200).sum()} colours in the scene"
    page.step(0)
    approach = page.picture()
    moved = changed(grasp, approach)
    assert moved > 2000, f"{moved} pixels changed from the approach to the grasp"
    page.step(24)
    back = changed(grasp, page.picture())
    assert back < moved / 50, f"{back} pixels differ at the same step"
    assert page.id("stage").text == "grasp"
    page.id("layer-hand").click()
    time.sleep(0.2)
    hidden = changed(grasp, page.picture())
    assert hidden > 2000, f"{hidden} pixels change without the hand"
    for plot in ["margins", "brackets", "tip-forces", "heights"]:
        lines = browser.execute_script(f"return document.querySelectorAll('#{plot} .scatterlayer .trace, #{plot} .barlayer .trace').length")
        assert lines > 0, f"{plot} is empty"
    lacking = browser.find_elements(By.ID, "lacking")
    for plot, words in [("joint-torques", "Joint torques"), ("slip-ratios", "Slip ratio")]:
        drawn = bool(browser.find_elements(By.ID, plot))
        told = any(words in note.text for note in lacking)
        assert drawn != told, f"{plot}: drawn {drawn}, told as lacking {told}"
    # Without a light of its own that a reader has to switch: the system's wish decides, and back.
    page.id("layer-hand").click()
    backs = []
    for scheme in ["light", "dark"]:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
        backs.append(np.median(page.picture().reshape(-1, 3), axis=0).mean())
    assert backs[0] > 200 and backs[1] < 60, f"background in light and dark {backs}"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    check_quiet(browser, 1)
    return moved


def grasps(browser, path, plan):
    planned = json.loads(Path(plan).read_text())["grasps"][:20]
    assert len(planned) > 3, "a plan with several grasps is needed"
    page = Page(browser, path)
    epsilon = [f"{grasp['quality']['epsilon_low']:.4f}" for grasp in planned]
    names = [grasp["candidate"] for grasp in planned]
    assert page.column(3) == epsilon and page.column(2) == names, "best first, as in the plan"
    page.id("sort-2").send_keys(Keys.ENTER)
    assert page.column(3) == sorted(epsilon) != epsilon, "ascending by the keyboard"
    assert browser.switch_to.active_element.get_attribute("id") == "sort-2", "the focus stays"
    page.id("sort-2").click()
    assert page.column(3) == sorted(epsilon, reverse=True), "descending"
    page.id("sort-1").click()
    assert page.column(2) == sorted(names), "by name"
    first = page.picture()
    page.id("grasp-4").send_keys(Keys.ENTER)
    page.wait(lambda: page.root("grasp") == "4", "grasp 4 is shown")
    assert changed(first, page.picture()) > 500, "another grasp looks different"
    forces = browser.find_elements(By.CSS_SELECTOR, "#contacts tr")
    assert len(forces) == 1 + len(planned[3]["contacts"])
    check_quiet(browser, 1)


def phone(browser, path):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True})
    Page(browser, path)
    time.sleep(0.5)
    wide = browser.execute_script("return Math.max(document.documentElement.scrollWidth, document.body.scrollWidth)")
    assert wide <= 360, f"{wide} pixels wide on a phone of 360"
    small = browser.execute_script("return [...document.querySelectorAll('#stages button, #step')].filter(e => e.getBoundingClientRect().height < 30).length")
    assert small == 0, f"{small} controls are too small for a finger"
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    check_quiet(browser, 1)


def main(demo, many, plan):
    browser = driver()
    try:
        moved = scene(browser, demo)
        grasps(browser, many, plan)
        phone(browser, demo)
    finally:
        browser.quit()
    print(f"browser: page drawn without errors or requests, {moved} pixels move with the slider, list sorts, a phone shows it")


if __name__ == "__main__":
    main(*sys.argv[1:])
