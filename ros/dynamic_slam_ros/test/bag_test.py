"""Bags: what make_bag writes, and that bag_runner makes of it what `dynamic_slam run` makes of the images."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time as time_module
import unittest

import walk_film
from walk_film import run

try:
    import rosbag
    import rospy
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

PROGRAM, BUILD = sys.argv.pop(1), sys.argv.pop(1)
FRAMES = 40


def content(*path):
    with open(os.path.join(*path), "rb") as file:
        return file.read()


class BagTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.sequence, cls.bag = walk_film.make(PROGRAM, BUILD, cls.path(), FRAMES)
        cls.detector = ("--detector", f"boxes:{cls.sequence}/boxes.csv")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def path(cls, *names):
        return os.path.join(cls.folder.name, *names)

    @staticmethod
    def tool(name):
        return os.path.join(BUILD, name)

    def test_a_bag_has_the_images_as_they_are_stored(self):
        with open(os.path.join(self.sequence, "rgb.txt"), encoding="utf-8") as lines:
            stored = [line.split() for line in lines if not line.startswith("#")]
        with rosbag.Bag(self.bag) as bag:
            images = [m for _, m, _ in bag.read_messages("/camera/image_raw/compressed")]
            cameras = [m for _, m, _ in bag.read_messages("/camera/camera_info")]
        self.assertEqual(len(images), FRAMES)
        self.assertEqual(len(cameras), FRAMES)
        for (stamp, name), image, camera in zip(stored, images, cameras):
            self.assertAlmostEqual(image.header.stamp.to_sec(), float(stamp), delta=1e-6)
            self.assertEqual(image.data, content(self.sequence, name))
            self.assertEqual(camera.header.stamp, image.header.stamp)

    def test_bag_runner_makes_what_run_makes_of_the_images(self):
        run(PROGRAM, "run", self.sequence, *self.detector, "--out", self.path("images"), "--quiet")
        raw = self.path("raw.bag")
        run(self.tool("make_bag"), self.sequence, raw, "--raw")
        for name, bag in (("once", self.bag), ("twice", self.bag), ("raw", raw)):
            run(self.tool("bag_runner"), bag, *self.detector, "--out", self.path(name))
        wanted = content(self.path("images"), "trajectory.txt")
        self.assertGreater(len(wanted.splitlines()), 0.8 * FRAMES)
        for name in ("once", "twice", "raw"):
            for file in ("trajectory.txt", "keyframes.txt", "map.ply"):
                self.assertEqual(content(self.path(name), file), content(self.path("images"), file), (name, file))

    def expect_refusal(self, bag, *reasons, options=()):
        result = subprocess.run([self.tool("bag_runner"), bag, *options, "--out", self.path("none")],
                                capture_output=True, text=True)
        self.assertEqual(result.returncode, 2, result.stderr)
        for reason in (os.path.basename(bag), *reasons):
            self.assertIn(reason, result.stderr)

    def test_bags_that_are_none_are_refused(self):
        self.expect_refusal(self.path("gone.bag"), "there is no such file")
        self.expect_refusal(os.path.join(self.sequence, "rgb.txt"), "is no bag that can be read")
        cut = self.path("cut.bag")
        with open(cut, "wb") as file:
            file.write(content(self.bag)[:100000])
        self.expect_refusal(cut, "rosbag reindex")

    def test_topics_are_named_where_it_is_not_clear_which_is_meant(self):
        self.expect_refusal(self.bag, "/camera/image_raw/compressed", options=("--topic", "/other"))
        two = self.path("two.bag")
        with rosbag.Bag(self.bag) as bag, rosbag.Bag(two, "w") as out:
            for topic, message, time in bag.read_messages("/camera/image_raw/compressed"):
                out.write("/left", message, time)
                out.write("/right", message, time)
        self.expect_refusal(two, "not clear which topic", "/left, /right", "--topic")
        self.expect_refusal(two, "has no sensor_msgs/CameraInfo", "--camera", options=("--topic", "/left"))

    def test_an_interrupt_keeps_what_there_is(self):
        rounds = 30
        long = self.path("long.bag")
        with rosbag.Bag(self.bag) as bag, rosbag.Bag(long, "w") as out:
            messages = list(bag.read_messages())
            for i in range(rounds):
                for topic, message, time in messages:
                    message.header.stamp += rospy.Duration(0 if i == 0 else 2)
                    out.write(topic, message, time + rospy.Duration(2 * i))
        runner = subprocess.Popen([self.tool("bag_runner"), long, *self.detector, "--out", self.path("interrupted")],
                                  stdout=subprocess.DEVNULL)
        while runner.poll() is None and not os.path.isdir(self.path("interrupted")):
            time_module.sleep(0.01)
        time_module.sleep(1)
        runner.send_signal(signal.SIGINT)
        self.assertEqual(runner.wait(timeout=60), 130)
        with open(self.path("interrupted", "summary.json"), encoding="utf-8") as file:
            summary = json.load(file)
        self.assertTrue(summary["interrupted"])
        self.assertGreater(summary["frames_total"], 0)
        self.assertLess(summary["frames_total"], rounds * FRAMES)
        self.assertTrue(os.path.exists(self.path("interrupted", "trajectory.txt")))

    def test_damaged_messages_cost_one_frame_each(self):
        damaged = self.path("damaged.bag")
        with rosbag.Bag(self.bag) as bag, rosbag.Bag(damaged, "w") as out:
            for i, (topic, message, time) in enumerate(bag.read_messages()):
                if topic.endswith("compressed") and i // 2 % 10 == 3:
                    message.data = message.data[:1000]
                out.write(topic, message, time)
        said = run(self.tool("bag_runner"), damaged, *self.detector, "--out", self.path("damaged"))
        self.assertIn(f"of {FRAMES} images", said)
        with open(self.path("damaged", "summary.json"), encoding="utf-8") as file:
            self.assertEqual(file.read().count("is truncated"), FRAMES // 10)


unittest.main(warnings="ignore")
