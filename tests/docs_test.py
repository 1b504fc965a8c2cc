"""Every command of dynamic_slam on the pages for users is run, page by page, as it is written there.

Usage: docs_test.py PROGRAM
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy

SOURCE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROGRAM = ""
FOCAL_PX, SIZE = 535.4, (640, 480)


def run_program(*arguments, cwd=None):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, cwd=cwd)


def board_image(u, v, tilt_x, tilt_y, turn):
    """A board of 10 by 7 squares of 25 mm, its centre at (u, v) of the image, 0.62 m away, turned by angles in deg."""
    scale, margin = 40, 40  # px of the flat picture
    flat = numpy.full((7 * scale + 2 * margin, 10 * scale + 2 * margin), 230, numpy.uint8)
    for row in range(7):
        for column in range(10):
            if (row + column) % 2 == 0:
                top, left = margin + row * scale, margin + column * scale
                flat[top:top + scale, left:left + scale] = 25
    K = numpy.array([[FOCAL_PX, 0, 320], [0, FOCAL_PX, 240], [0, 0, 1]])
    R = cv2.Rodrigues(numpy.radians([tilt_x, tilt_y, 0]))[0] @ cv2.Rodrigues(numpy.radians([0, 0, turn]))[0]
    center = 0.62 * numpy.linalg.inv(K) @ [u * SIZE[0], v * SIZE[1], 1]
    metres = 0.025 / scale
    flat_to_board = numpy.array([[metres, 0, -metres * flat.shape[1] / 2], [0, metres, -metres * flat.shape[0] / 2],
                                 [0, 0, 1]])
    H = K @ numpy.column_stack([R[:, 0], R[:, 1], center]) @ flat_to_board
    image = cv2.warpPerspective(flat, H, SIZE, flags=cv2.INTER_AREA, borderValue=120)
    return cv2.GaussianBlur(image, (0, 0), 0.6)


def board_images():
    for v in (0.24, 0.5, 0.76):
        for u in (0.2, 0.5, 0.8):
            tilt_y, tilt_x = (35 if u < 0.4 else -35 if u > 0.6 else 25), (-30 if v < 0.4 else 30 if v > 0.6 else 0)
            yield from (board_image(u, v, 0, 0, 3), board_image(u, v, tilt_x, tilt_y, -10),
                        board_image(u, v, -tilt_x, -tilt_y, 80))


def write_video(path, images, repeat=1):
    codec = "mp4v" if path.endswith(".mp4") else "MJPG"
    video = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*codec), 30, SIZE)
    for image in images:
        for _ in range(repeat):
            video.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image)
    video.release()


class DocsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """The files that the pages speak of."""
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        for arguments in (["room", "--frames", "100", "--out", "room"],
                          ["street_short", "--set", "frames=120", "--out", "street"],
                          ["office_walk", "--set", "frames=40", "--out", "office"]):
            result = run_program("simulate", *arguments, cwd=cls.folder)
            assert result.returncode == 0, result.stderr
        rgb = os.path.join(cls.folder, "room/rgb")
        write_video(os.path.join(cls.folder, "video.mp4"),
                    [cv2.imread(os.path.join(rgb, name)) for name in sorted(os.listdir(rgb))])
        write_video(os.path.join(cls.folder, "board.mp4"), board_images(), repeat=2)
        shutil.copy(os.path.join(cls.folder, "room/camera.yaml"), os.path.join(cls.folder, "my_camera.yaml"))
        config = os.path.join(SOURCE, "config/detectors/builtin.yaml")
        with open(config) as file, open(os.path.join(cls.folder, "my_detector.yaml"), "w") as copy:
            copy.write(file.read().replace("../../models", os.path.join(SOURCE, "models")))

    def run_page(self, name, at_least, folder=None):
        with open(os.path.join(SOURCE, "docs", name)) as file:
            commands = re.findall(r"^    dynamic_slam (.*)$", file.read(), re.MULTILINE)
        self.assertGreaterEqual(len(commands), at_least)
        outputs = []
        for command in commands:
            arguments = shlex.split(command)
            result = run_program(*arguments, cwd=folder or self.folder)
            outputs.append(result.stdout)
            if "camera:0" in command or "rtsp://" in command:  # what is not here is missed by its name
                self.assertEqual(result.returncode, 2, command)
                self.assertIn("cannot be opened", result.stderr, command)
            else:
                self.assertEqual(result.returncode, 0, f"{command}: {result.stderr}")
        return outputs

    def test_first_run(self):
        with tempfile.TemporaryDirectory() as folder:  # it begins with nothing
            doctor = self.run_page("first_run.md", 5, folder)[-1]
        self.assertIn("Nothing stands in the way of a run.", doctor)

    def test_your_camera(self):
        outputs = self.run_page("your_camera.md", 8)
        focal = float(re.search(r"^fx fy +(\S+)", outputs[0], re.MULTILINE).group(1))
        self.assertLess(abs(focal / FOCAL_PX - 1), 0.01)
        self.assertEqual(sum("results are in metres" in output for output in outputs), 3)

    def test_your_detector(self):
        self.run_page("your_detector.md", 5)

    def test_tuning(self):
        self.run_page("tuning.md", 6)

    def test_calibrate_refuses_a_board_that_is_only_in_the_middle_and_draws_what_is_missing(self):
        video, camera = os.path.join(self.folder, "middle.avi"), os.path.join(self.folder, "middle.yaml")
        write_video(video, [board_image(u, v, 80 * (v - 0.5), 80 * (u - 0.5), turn) for u in (0.4, 0.5, 0.6)
                            for v in (0.4, 0.5, 0.6) for turn in (0, 40)])
        result = run_program("calibrate", video, "--board", "9x6", "--square", "0.025", "--out", camera)
        self.assertEqual(result.returncode, 2)
        self.assertIn("the upper left corner", result.stderr)
        self.assertIn("middle_coverage.png", result.stderr)
        self.assertFalse(os.path.exists(camera))
        picture = cv2.imread(os.path.join(self.folder, "middle_coverage.png"))
        self.assertEqual(picture.shape, (SIZE[1], SIZE[0], 3))
        self.assertEqual(picture[20, 20].tolist(), [170, 170, 255])

    def test_calibrate_refuses_a_film_that_is_too_short_before_it_looks(self):
        video = os.path.join(self.folder, "short.avi")
        write_video(video, [board_image(0.5, 0.5, 0, 0, 0)] * 7)
        result = run_program("calibrate", video, "--board", "9x6", "--square", "0.025", "--out", "unused.yaml")
        self.assertEqual(result.returncode, 2)
        self.assertIn("gives 7 images", result.stderr)
        self.assertNotIn("searched", result.stdout)

    def test_calibrate_names_the_images_that_cannot_be_read(self):
        folder = os.path.join(self.folder, "photos")
        os.makedirs(folder)
        for i, image in enumerate(board_images()):
            cv2.imwrite(os.path.join(folder, f"{i:02}.png"), image)
        for name in ("00.png", "05.png"):
            os.truncate(os.path.join(folder, name), 1000)
        camera = os.path.join(self.folder, "photos.yaml")
        result = run_program("calibrate", folder, "--board", "9x6", "--square", "0.025", "--out", camera)
        self.assertEqual(result.returncode, 0, result.stderr)
        skipped = [line for line in result.stdout.splitlines() if line.startswith("skipped")]
        self.assertEqual(len(skipped), 2, result.stdout)
        self.assertIn("00.png", skipped[0])
        self.assertTrue(os.path.exists(camera))

    def test_a_scale_that_says_nothing_is_refused_before_the_run(self):
        result = run_program("run", "room", "--scale-from", "height:1.6", cwd=self.folder)
        self.assertEqual(result.returncode, 2)
        self.assertIn("camera-height:METRES", result.stderr)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
