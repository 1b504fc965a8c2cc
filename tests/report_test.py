"""report.html in headless Chromium: a clean console, each plot with its data, readable when wide and when narrow.

Skipped (exit code 77) where there is no Chromium.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import browser

PROGRAM = ""
FRAMES = 40
MAX_BYTES = 3_000_000
WIDTHS = (1280, 400)


def run_program(*arguments):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


# Sections of the page by their heading: how many curves, points in them, and other marks they have.
COUNT_PLOTS = """
Object.fromEntries([...document.querySelectorAll("main section")].map((section) => {
  const of = (selector) => [...section.querySelectorAll(selector)];
  return [section.querySelector("h2")?.textContent || section.dataset.type, {
    svgs: of("svg").length,
    curves: of("path.curve").map((path) => path.getTotalLength()),
    tracks: of("path.track").length, truth: of("path.truth").length, colours: of(".colour-bar rect").length,
    states: of("rect.state").length, events: of("rect.event").length, bars: of("rect.bar").length,
    images: of("img").filter((image) => image.complete && image.naturalWidth > 0).length,
    rows: of("tbody tr").length, text: section.textContent,
  }];
}))
"""

# Nothing is cut off or overlaps its neighbour on the page, and no text is too small to read.
FAULTS_OF_LAYOUT = """
[...document.querySelectorAll("svg text, h1, h2, h3, p, .tile, td, figcaption")].flatMap((element) => {
  const box = element.getBoundingClientRect(), faults = [], name = element.textContent.slice(0, 40);
  if (box.width === 0) return [];
  const scrolls = element.closest(".scroll, pre, nav");
  if (!scrolls && (box.left < -1 || box.right > innerWidth + 1)) faults.push(`${name}: ${box.left} to ${box.right} px`);
  if (parseFloat(getComputedStyle(element).fontSize) < 10.5) faults.push(`${name}: too small`);
  return faults;
}).concat(document.documentElement.scrollWidth > innerWidth ? [`page ${document.documentElement.scrollWidth} px wide`] : [])
"""

# Contrast of texts with what is behind them (WCAG 2), the least of all.
LEAST_CONTRAST = """
(() => {
  const parse = (text) => text.match(/[\\d.]+/g).map(Number);
  const luminance = (rgb) => rgb.slice(0, 3).map((c) => c / 255).map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + [0.2126, 0.7152, 0.0722][i] * c, 0);
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const c = parse(getComputedStyle(at).backgroundColor);
      if (c.length === 3 || c[3] > 0) return c;
    }
  };
  return Math.min(...[...document.querySelectorAll("svg text, p, h1, h2, h3, td, .label, .value, figcaption")].filter((e) => e.textContent).map((e) => {
    const style = getComputedStyle(e);
    const [a, b] = [luminance(parse(e.namespaceURI.includes("svg") ? style.fill : style.color)), luminance(behind(e))].sort((x, y) => y - x);
    return (a + 0.05) / (b + 0.05);
  }));
})()
"""


class ReportTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.sequence = os.path.join(cls.shared, "walk")
        run_program("simulate", "office_walk", "--frames", str(FRAMES), "--out", cls.sequence)
        cls.out = os.path.join(cls.shared, "run")
        run_program("run", cls.sequence, "--detector", f"boxes:{cls.sequence}/boxes.csv", "--set", "orb.features=900", "--out", cls.out,
                    "--quiet")
        cls.report = os.path.join(cls.out, "report.html")

    def check(self, file, width, dark=False):
        """The plots of a page whose console is clean and whose layout is sound."""
        self.assertLessEqual(os.path.getsize(file), MAX_BYTES)
        with browser.Page(file, width=width, dark=dark) as page:
            plots = page.evaluate(COUNT_PLOTS)
            self.assertEqual(page.evaluate(FAULTS_OF_LAYOUT), [])
            self.assertGreater(page.evaluate(LEAST_CONTRAST), 3)
            self.assertEqual(page.problems, [])
            if "REPORT_SCREENSHOTS" in os.environ:
                name = f"{os.path.basename(os.path.dirname(file))}_{width}{'_dark' if dark else ''}.png"
                page.screenshot(os.path.join(os.environ["REPORT_SCREENSHOTS"], name))
        return plots

    def test_each_plot_has_its_data(self):
        for width in WIDTHS:
            plots = self.check(self.report, width)
            path = plots["Path"]
            self.assertEqual(path["svgs"], 3, "a colour bar and two views")
            self.assertEqual(path["truth"], 2)
            self.assertGreater(path["tracks"], 4, "colours of the error")
            self.assertGreater(path["colours"], 8)
            self.assertGreater(plots["Time line"]["states"], 1)
            self.assertGreater(plots["Time line"]["events"], 1)
            for name, curves in {"Errors": 3, "Keypoints": 4, "Detector": 3, "Time of the frames": 1, "Map growth": 2}.items():
                self.assertEqual(len(plots[name]["curves"]), curves, name)
                self.assertGreater(min(plots[name]["curves"]), 100, name)
            self.assertEqual(plots["Time of the stages"]["bars"], 4)
            self.assertGreaterEqual(plots["Frames"]["images"], 4)
            self.assertIn("orb.features", plots["Configuration"]["text"])
            self.assertIn("900", plots["Configuration"]["text"])
            self.assertIn("Recall 100.0%", plots["Detector"]["text"])

    def test_dark(self):
        self.check(self.report, 1280, dark=True)

    def test_keys_step_through_time_in_all_plots(self):
        with browser.Page(self.report) as page:
            cursors = "[...document.querySelectorAll('.cursor')].filter((c) => c.getAttribute('display') !== 'none').length"
            self.assertEqual(page.evaluate(cursors), 0)
            page.evaluate("document.querySelector('[data-type=charts] svg').focus()")
            page.press("End")
            self.assertEqual(page.evaluate(cursors), page.evaluate("document.querySelectorAll('.cursor').length"))
            last = page.evaluate("document.querySelector('[data-type=charts] .cursor').getAttribute('d')")
            page.press("ArrowLeft")
            self.assertNotEqual(page.evaluate("document.querySelector('[data-type=charts] .cursor').getAttribute('d')"), last)
            self.assertRegex(page.evaluate("document.querySelector('[data-type=charts] .legend b').textContent"), r"^[\d.]+ m$")
            page.press("Escape")
            self.assertEqual(page.evaluate(cursors), 0)
            self.assertEqual(page.problems, [])

    def test_the_button_changes_light_and_dark_and_paper_is_light(self):
        with browser.Page(self.report, dark=True) as page:
            theme = "document.documentElement.dataset.theme"
            self.assertEqual(page.evaluate(theme), "dark")
            self.assertGreaterEqual(page.pdf_pages(), 2)
            self.assertEqual(page.evaluate(theme), "dark", "as before after printing")
            page.evaluate("document.getElementById('theme').click()")
            self.assertEqual(page.evaluate(theme), "light")

    def test_truth_from_a_file_colours_a_run_without_its_own(self):
        images = os.path.join(self.shared, "images")
        shutil.copytree(self.sequence, images)
        truth = os.path.join(self.shared, "truth.txt")
        shutil.move(os.path.join(images, "groundtruth.txt"), truth)
        out = os.path.join(self.shared, "run_truth")
        self.assertNotIn("APE", run_program("run", images, "--detector", "none", "--out", out, "--quiet"))
        plots = self.check(os.path.join(out, "report.html"), 400)
        self.assertEqual(plots["Path"]["truth"], 0)
        self.assertNotIn("Errors", plots)
        with_truth = ["run", images, "--detector", "none", "--truth", truth, "--out", out, "--quiet"]
        all_live = run_program(*with_truth, "--no-backfill")
        self.assertIn("APE", all_live)
        self.assertNotIn("tracked live", all_live)
        self.assertRegex(run_program(*with_truth), r"APE .*; \d\.\d{4} m over the frames tracked live\n")
        self.assertEqual(self.check(os.path.join(out, "report.html"), 400)["Path"]["truth"], 2)

    def test_a_run_without_a_pose_has_a_report(self):
        out = os.path.join(self.shared, "run_short")
        run_program("run", self.sequence, "--detector", "none", "--max-frames", "2", "--out", out, "--quiet")
        plots = self.check(os.path.join(out, "report.html"), 400)
        self.assertNotIn("Path", plots)
        self.assertIn("never started", plots["tiles"]["text"])

    def test_benchmark(self):
        out = os.path.join(self.shared, "bench")
        run_program("bench", "tum", "--root", self.shared, "--sequences", "walk", "--runs", "1", "--detector",
                    "boxes:{source}/boxes.csv", "--out", out, "--quiet")
        for width in WIDTHS:
            plots = self.check(os.path.join(out, "report.html"), width)
            self.assertEqual(plots["Absolute pose error over all frames"]["bars"], 2)
            self.assertEqual(plots["Table 1: absolute pose error, cm"]["rows"], 8)
            self.assertEqual(plots["Runs"]["rows"], 2)

    def test_demo_and_experiments(self):
        out = os.path.join(self.shared, "demo")
        run_program("demo", "--frames", "30", "--detector", "boxes:{source}/boxes.csv", "--out", out, "--quiet")
        for width in WIDTHS:
            plots = self.check(os.path.join(out, "report.html"), width)
            self.assertEqual(plots["Scenes"]["rows"], 4)
            self.assertGreater(plots["office_walk"]["tracks"], 1)
            self.assertGreater(plots["office_walk: frames"]["images"], 2)
        self.check(os.path.join(out, "office_walk", "with", "report.html"), 1280)
        recall = os.path.join(self.shared, "recall")
        run_program("bench", "recall", self.sequence, "--max-frames", "12", "--detector", f"boxes:{self.sequence}/boxes.csv", "--out",
                    recall, "--quiet")
        plots = self.check(os.path.join(recall, "report.html"), 400)
        self.assertEqual(len(plots["Curves"]["curves"]), 3)
        self.assertEqual(plots["Results"]["rows"], 2)


if __name__ == "__main__":
    if browser.find_chromium() is None:
        print("skipped: no chromium; it is in scripts/packages_test.txt")
        sys.exit(77)
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
