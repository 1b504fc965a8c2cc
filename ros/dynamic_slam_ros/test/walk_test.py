"""Two people before a hand-held camera, as a bag in real time: poses, their error, and what a far detector costs.

Usage: walk_test.py DYNAMIC_SLAM BUILD [RUNS]. Skipped without DYNAMIC_SLAM_DATA and DYNAMIC_SLAM_MODELS.
"""

import os
import statistics
import subprocess
import sys
import unittest

import ros_graph
from ros_graph import Listener, Network, Relay, pose_tuple

import rospy
from geometry_msgs.msg import PoseStamped

PROGRAM, BUILD = sys.argv.pop(1), sys.argv.pop(1)
RUNS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 3
sys.path += [os.path.join(BUILD, "generated", "python"),
             os.path.join(os.path.dirname(__file__), "..", "..", "..", "tests")]

import horn
from dynamic_slam_ros.msg import Detections
from dynamic_slam_ros.srv import GetTrajectory

SOURCE = os.path.join(os.environ.get("DYNAMIC_SLAM_DATA", "/nowhere"), "tum_fr1_desk_walk")
MODELS = os.environ.get("DYNAMIC_SLAM_MODELS", os.path.join(os.path.dirname(SOURCE), "detectors"))
if not (os.path.isdir(SOURCE) and os.path.isdir(MODELS)):
    print("skipped: set DYNAMIC_SLAM_DATA")
    sys.exit(ros_graph.SKIPPED)


class WalkTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.network = Network()
        cls.graph = ros_graph.Graph(BUILD, "127.0.0.1" if cls.network.problem else cls.network.here)
        cls.bag = cls.graph.path("walk.bag")
        subprocess.run([os.path.join(BUILD, "make_bag"), SOURCE, cls.bag, "--camera", "tum_fr1"], check=True)
        cls.truth = horn.read_tum(os.path.join(SOURCE, "groundtruth.txt"))
        with open(os.path.join(SOURCE, "rgb.txt"), encoding="utf-8") as lines:
            cls.stamps = [float(line.split()[0]) for line in lines if not line.startswith("#")]
        cls.networks = ["_detector:=yolo_fastest", f"_models:={MODELS}"]

    @classmethod
    def tearDownClass(cls):
        cls.graph.end()
        cls.network.end()

    def play(self, *parameters, wait_for_detector=False):
        """(share of the frames since the first pose that had one at once, error of the trajectory at the end in m)."""
        self.graph.start("slam_node", "image:=/camera/image_raw", "camera_info:=/camera/camera_info",
                         "_compressed:=true", *parameters)
        if wait_for_detector:
            self.graph.wait_for_detector()
        poses = Listener("/slam_node/pose", PoseStamped)
        try:
            self.assertEqual(self.graph.play(self.bag).wait(), 0)
            main = rospy.ServiceProxy("/slam_node/get_trajectory", GetTrajectory)().parts[0]
        finally:
            poses.stop()
            self.graph.stop_nodes()
        self.assertGreater(len(poses), 0.5 * len(self.stamps))
        first = poses.messages[0].header.stamp.to_sec()
        coverage = len(poses) / sum(stamp >= first - 1e-5 for stamp in self.stamps)
        pairs, _ = horn.align(horn.match(self.truth, [pose_tuple(m) for m in main.poses]))
        error = horn.rmse(horn.absolute_errors(pairs))
        print(f"{len(poses)} poses, {coverage:.3f} since the first; APE {error:.4f} m of {len(pairs)}", flush=True)
        return coverage, error

    @staticmethod
    def medians(results):
        return [statistics.median(values) for values in zip(*results)]

    def test_a_detector_far_away_costs_little(self):
        coverage, error = self.medians([self.play(*self.networks) for _ in range(RUNS)])
        self.assertGreaterEqual(coverage, 0.95)
        self.assertLessEqual(error, 0.03)
        if self.network.problem:
            self.skipTest(f"no network namespace: {self.network.problem}")
        results = []
        for run in range(RUNS):
            self.graph.start("detector_node", *self.networks, "detector/detections:=/far/detections",
                             network=self.network)
            relay = Relay(Detections, "/far/detections", "/detector/detections", delay_s=0.08, lost=0.05, seed=run)
            try:
                results.append(self.play("_detector:=ros", wait_for_detector=True))
            finally:
                relay.end()
            self.assertGreater(relay.dropped, 0)
        _, far_error = self.medians(results)
        self.assertLessEqual(far_error, 1.3 * error)


unittest.main(warnings="ignore")
