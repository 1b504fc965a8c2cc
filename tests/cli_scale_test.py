"""`run --scale-from` on a simulated car: results in metres, within the error that is stated."""

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import horn

PROGRAM = ""
HEIGHT_M = 1.6
FRAMES = 150
SIZE = (640, 480)


def run_program(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


class CliScaleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.street = os.path.join(cls.folder, "street")
        result = run_program("simulate", "street_short", "--set", f"frames={FRAMES}", "--set",
                             f"camera.height_m={HEIGHT_M}", "--out", cls.street)
        assert result.returncode == 0, result.stderr
        cls.truth = horn.read_tum(os.path.join(cls.street, "groundtruth.txt"))

    def drive(self, scale_from, *more):
        """The scale of summary.json, or None, the trajectory and what was printed."""
        out = os.path.join(self.folder, "out")
        result = run_program("run", self.street, "--quiet", "--out", out, "--scale-from", scale_from, *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(os.path.join(out, "summary.json")) as file:
            return json.load(file).get("scale"), horn.read_tum(os.path.join(out, "trajectory.txt")), result.stdout

    def true_factor(self, trajectory):
        """By which the trajectory must be multiplied to fit the truth: 1 when it is in metres."""
        pairs = horn.match(self.truth, trajectory)
        self.assertGreater(len(pairs), FRAMES // 2)
        return horn.align(pairs)[1]

    def test_the_height_of_the_camera(self):
        scale, trajectory, printed = self.drive(f"camera-height:{HEIGHT_M}")
        self.assertIn("results are in metres", printed)
        self.assertLess(abs(self.true_factor(trajectory) - 1), 0.03)
        self.assertTrue(0 < scale["relative_error"] < 0.05)

    def test_a_distance(self):
        (first, a, _), (last, b, _) = self.truth[40], self.truth[120]
        scale, trajectory, _ = self.drive(f"distance:{first},{last},{math.dist(a, b)}")
        self.assertLess(abs(self.true_factor(trajectory) - 1), 0.03)
        self.assertLess(scale["relative_error"], 0.02)

    def test_a_trajectory_in_metres(self):
        scale, trajectory, _ = self.drive("file:" + os.path.join(self.street, "groundtruth.txt"))
        self.assertLess(abs(self.true_factor(trajectory) - 1), 0.005)
        self.assertLess(scale["relative_error"], 0.02)

    def test_where_the_ground_is_not_visible_it_says_so(self):
        mask = os.path.join(self.folder, "mask.pgm")  # the lower half is ignored
        with open(mask, "wb") as file:
            file.write(b"P5 %d %d 255\n" % SIZE + bytes([255]) * (SIZE[0] * SIZE[1] // 2) +
                       bytes(SIZE[0] * SIZE[1] // 2))
        scale, _, printed = self.drive(f"camera-height:{HEIGHT_M}", "--set", f"image.mask={mask}")
        self.assertIsNone(scale)
        self.assertIn("the ground is not visible", printed)
        self.assertIn("units of the map", printed)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
