"""`dynamic_slam simulate` as a user meets it: files, repeatability, messages and exit codes."""

import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""


def read(*path):
    with open(os.path.join(*path), "rb") as file:
        return file.read()


class CliSimulateTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def simulate(self, *arguments):
        return subprocess.run([PROGRAM, "simulate", *arguments], cwd=self.folder, capture_output=True, text=True)

    def assert_fails(self, arguments, *parts):
        result = self.simulate(*arguments.split())
        self.assertEqual(result.returncode, 2, result)
        for part in parts:
            self.assertIn(part, result.stderr)

    def test_writes_a_sequence_that_repeats_with_its_seed(self):
        for out, seed in (("a", "3"), ("b", "3"), ("c", "4")):
            result = self.simulate("room", "--seed", seed, "--frames", "3", "--out", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(f"{out}: 3 frames", result.stdout)
        images = sorted(os.listdir(os.path.join(self.folder, "a", "rgb")))
        self.assertEqual(images, ["0.000000.jpg", "0.033333.jpg", "0.066667.jpg"])
        for name in ["rgb.txt", "groundtruth.txt", "camera.yaml"] + ["rgb/" + image for image in images]:
            self.assertEqual(read(self.folder, "a", name), read(self.folder, "b", name), name)
        self.assertNotEqual(read(self.folder, "a", "groundtruth.txt"), read(self.folder, "c", "groundtruth.txt"))
        self.assertNotEqual(read(self.folder, "a", "rgb", images[0]), read(self.folder, "c", "rgb", images[0]))

    def test_truth_fits_itself_and_takes_a_camera(self):
        self.assertEqual(self.simulate("room", "--frames", "9", "--out", "a", "--camera", "tum_fr1").returncode, 0)
        self.assertIn(b"517.306408", read(self.folder, "a", "camera.yaml"))
        truth = os.path.join(self.folder, "a", "groundtruth.txt")
        result = subprocess.run([PROGRAM, "eval", "ape", truth, truth], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stdout, r"rmse +0\.000000")

    def test_a_scene_brings_the_truth_of_its_objects(self):
        result = self.simulate("office", "--frames", "3", "--out", "a", "--set", "people.count=1", "--depth")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(sorted(os.listdir(os.path.join(self.folder, "a"))),
                         ["boxes.csv", "camera.yaml", "depth", "depth.txt", "groundtruth.txt", "masks", "rgb", "rgb.txt",
                          "scene.yaml"])
        boxes = read(self.folder, "a", "boxes.csv").decode().splitlines()
        self.assertEqual(boxes[0], "timestamp,actor,class,x,y,w,h,visible,moving")
        self.assertIn("chair", {line.split(",")[2] for line in boxes[1:]})
        # The scene beside the images gives them again.
        self.assertEqual(self.simulate("a/scene.yaml", "--out", "b").returncode, 0)
        for name in os.listdir(os.path.join(self.folder, "a", "rgb")):
            self.assertEqual(read(self.folder, "a", "rgb", name), read(self.folder, "b", "rgb", name))

    def test_does_not_replace_a_sequence_unasked(self):
        self.assertEqual(self.simulate("room", "--frames", "1", "--out", "a").returncode, 0)
        self.assert_fails("room --frames 1 --out a", "holds a sequence already", "--force")
        self.assertEqual(self.simulate("room", "--frames", "1", "--out", "a", "--force").returncode, 0)

    def test_input_errors(self):
        self.assert_fails("room --out a --frames 0", "--frames")
        self.assert_fails("room --out a --noise -1", "--noise")
        self.assert_fails("room", "--out is required")
        self.assert_fails("moon --out a", "scene 'moon'", "room", "office")
        self.assert_fails("office --out a --set people.cuont=1", "people.count")
        self.assert_fails("office --out a --set camera.motion=path", "camera.motion", "xyz")
        self.assert_fails("room --out a --set people.count=1", "no --set")
        self.assert_fails("room --out a --camera no_such_camera", "no_such_camera", "tum_fr1")
        self.assert_fails("room --out /dev/null/a --frames 1", "/dev/null/a")
        self.assertEqual(os.listdir(self.folder), [])


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
