"""`dynamic_slam detect` and `models` as a user meets them; no network is needed."""

import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = ""


def run_program(*arguments, **environment):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, env={**os.environ, **environment})


class CliDetectTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.images = self.path("images")
        os.makedirs(self.images)
        for i, (width, height) in enumerate([(64, 48), (64, 48), (80, 60), (64, 48)]):  # grey, of two sizes
            with open(os.path.join(self.images, f"{i}.pgm"), "wb") as file:
                file.write(b"P5 %d %d 255\n" % (width, height) + bytes([100]) * (width * height))

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w") as file:
            file.write(text)
        return self.path(name)

    def assert_input_error(self, arguments, *parts):
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 2, result)
        for part in parts:
            self.assertIn(part, result.stderr)

    def test_boxes_and_pictures_of_all_images_whatever_their_size(self):
        rows = ["0.0,person,0.9,-5,10,30,20", "0.066666667,car,0.5,70,0,30,20"]
        boxes = self.write("in.csv", "timestamp,class,score,x,y,w,h\n" + "\n".join(rows) + "\n")
        result = run_program("detect", self.images, "--detector", "boxes:" + boxes, "--out", self.path("out.csv"),
                             "--images", self.path("pictures"))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("2 boxes in 4 images", result.stdout)
        self.assertIn("ms an image (median)", result.stdout)
        with open(self.path("out.csv")) as file:
            lines = [line.strip().split(",") for line in file]
        self.assertEqual(lines[0], "timestamp class score x y w h".split())
        self.assertEqual([(line[1], *map(float, line[2:])) for line in lines[1:]],
                         [("person", 0.9, 0, 10, 25, 20), ("car", 0.5, 70, 0, 10, 20)], "clipped to the image")
        self.assertEqual(sorted(os.listdir(self.path("pictures"))), [f"{i:06}.jpg" for i in range(4)])

    def test_every_second_image(self):
        result = run_program("detect", self.images, "--detector", "hog", "--out", self.path("out.csv"), "--every", "2")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("0 boxes in 2 images", result.stdout)

    def test_compares_with_the_truth_before_and_after_compensation(self):
        # One person in all of 12 images; the detector misses it in the last.
        images = self.path("many")
        os.makedirs(images)
        for i in range(12):
            with open(os.path.join(images, f"{i:02}.pgm"), "wb") as file:
                file.write(b"P5 64 48 255\n" + bytes([100]) * (64 * 48))
        stamps = [f"{i / 30:.9f}" for i in range(12)]
        truth = self.write("truth.csv", "timestamp,actor,x,y,w,h,visible\n"
                           + "".join(f"{t},0,10,10,20,30,1\n" for t in stamps))
        boxes = self.write("in.csv", "timestamp,class,score,x,y,w,h\n"
                           + "".join(f"{t},person,0.9,10,10,20,30\n" for t in stamps[:11]))
        arguments = ["detect", images, "--detector", "boxes:" + boxes, "--out", self.path("out.csv"),
                     "--truth", truth]
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("12 true boxes of persons in 12 frames", result.stdout)
        self.assertRegex(result.stdout, r"detector +0.917 +1.000 +0.083 +0.917 +0.917\n")
        self.assertNotIn("tracker", result.stdout)
        for method in "paper", "tracker":
            filled = self.path(method + ".csv")
            result = run_program(*arguments, "--compensation", method, "--out-compensated", filled)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertRegex(result.stdout, method + r" +1.000 +1.000 +0.000 +1.000 +1.000\n")
            with open(filled) as file:
                self.assertEqual(len(file.readlines()), 13)
        # 100 ms later: every third image is asked about, and the answer comes with the next one that is. So the first
        # three images are without boxes, all others have them.
        result = run_program(*arguments, "--compensation", "tracker", "--detector-latency-ms", "100")
        self.assertRegex(result.stdout, r"tracker +0.750 +1.000 +0.250 +0.750 +0.750\n")

    def test_asks_a_slow_detector_about_one_image_at_a_time(self):
        # 500 ms are 15 images: asked about are 0, 15, 30 and 45. A person who is there only in image 20 is never found;
        # one from image 15 on is from image 30 on.
        images = self.path("many")
        os.makedirs(images)
        for i in range(60):
            with open(os.path.join(images, f"{i:02}.pgm"), "wb") as file:
                file.write(b"P5 64 48 255\n" + bytes([100]) * (64 * 48))
        stamps = [f"{i / 30:.9f}" for i in range(60)]
        rows = [f"{stamps[20]},person,0.9,0,0,9,9\n"] + [f"{t},person,0.9,10,10,20,30\n" for t in stamps[15:]]
        boxes = self.write("in.csv", "timestamp,class,score,x,y,w,h\n" + "".join(rows))
        result = run_program("detect", images, "--detector", "boxes:" + boxes, "--out", self.path("out.csv"),
                             "--compensation", "tracker", "--out-compensated", self.path("late.csv"),
                             "--detector-latency-ms", "500")
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(self.path("late.csv")) as file:
            late = [line.split(",") for line in file][1:]
        self.assertEqual([round(float(row[0]) * 30) for row in late], list(range(30, 60)))
        self.assertEqual({tuple(round(float(x)) for x in row[3:]) for row in late}, {(10, 10, 20, 30)})

    def test_ctrl_c_writes_the_boxes_so_far(self):
        images = self.path("many")
        os.makedirs(images)
        for i in range(20000):
            os.link(os.path.join(self.images, "0.pgm"), os.path.join(images, f"{i:05}.pgm"))
        boxes = self.write("in.csv", "timestamp,class,score,x,y,w,h\n"
                           + "".join(f"{i / 30:.9f},person,0.9,10,10,20,30\n" for i in range(20000)))
        process = subprocess.Popen([PROGRAM, "detect", images, "--detector", "boxes:" + boxes, "--out",
                                    self.path("out.csv"), "--images", self.path("pictures"), "--compensation", "tracker",
                                    "--out-compensated", self.path("filled.csv")],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not os.path.exists(self.path("pictures/000001.jpg")):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130, stderr)
        pictures = len(os.listdir(self.path("pictures")))
        self.assertLess(pictures, 20000)
        self.assertIn(f"{pictures} boxes in {pictures} images", stdout)
        for name in "out.csv", "filled.csv":
            with open(self.path(name)) as file:
                self.assertEqual(len(file.readlines()), pictures + 1, name)

    def test_latency_needs_a_compensation(self):
        self.assert_input_error(["detect", self.images, "--detector", "hog", "--out", self.path("out.csv"),
                                 "--detector-latency-ms", "100"], "--compensation tracker")

    def test_errors_come_before_the_first_image(self):
        out = ["--out", self.path("out.csv")]
        self.assert_input_error(["detect", self.images, "--detector", "yolox_nan", *out], "Did you mean 'yolox_nano'?")
        self.assert_input_error(["detect", self.images, "--detector", "none", *out], "detects nothing", "hog")
        self.assert_input_error(["detect", self.path("none"), "--detector", "hog", *out], "there is no such file")
        detector = self.write("mine.yaml", "framework: onnx\nmodel: {file: mine.onnx}\nclasses: a, b\n"
                                           "input: {width: 32, height: 32}\noutput: {decoding: yolox}\n"
                                           "origin: https://example.org\n")
        self.assert_input_error(["detect", self.images, "--detector", detector, *out],
                                "mine.onnx", "Get it from https://example.org", "--models")
        self.write("mine.onnx", "nonsense")
        self.assert_input_error(["detect", self.images, "--detector", detector, *out],
                                "mine.onnx", "cannot be read as a network of onnx", "https://example.org")
        self.assertFalse(os.path.exists(self.path("out.csv")))

    def test_models_says_what_is_there_and_where_to_get_the_rest(self):
        models = self.path("models")
        os.makedirs(models)
        result = run_program("models", XDG_DATA_HOME=self.folder, DYNAMIC_SLAM_MODELS="")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stdout, r"yolox_nano +missing .*\n +model +yolox_nano_coco.onnx: missing\n"
                                        r" +licence +Apache-2.0\n +get from +https://github.com/Megvii")
        self.write("models/yolox_nano_coco.onnx", "nonsense")
        result = run_program("models", "yolox_nano", "--models", models)
        self.assertRegex(result.stdout, r"yolox_nano +ready ")
        self.assertIn("another file than expected: its SHA-256 is", result.stdout)
        self.assertNotIn("yolo_fastest", result.stdout)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
