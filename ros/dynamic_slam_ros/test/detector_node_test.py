"""The detector in a node, and a network, of its own: delayed, lost, killed and started again."""

import collections
import os
import sys
import unittest

import ros_graph
import walk_film
from ros_graph import Listener, Network, Relay, pose_tuple, wait_until

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped

PROGRAM, BUILD = sys.argv.pop(1), sys.argv.pop(1)
sys.path += [os.path.join(BUILD, "generated", "python"),
             os.path.join(os.path.dirname(__file__), "..", "..", "..", "tests")]

import horn
from dynamic_slam_ros.msg import Detections, Objects

FRAMES = 200
GRAPH = None
SEQUENCE, BAG = "", ""


def setUpModule():
    global GRAPH, NETWORK, SEQUENCE, BAG
    NETWORK = Network()
    GRAPH = ros_graph.Graph(BUILD, "127.0.0.1" if NETWORK.problem else NETWORK.here)
    SEQUENCE, BAG = walk_film.make(PROGRAM, BUILD, GRAPH.path(), FRAMES)


def tearDownModule():
    GRAPH.end()
    NETWORK.end()


class DetectorNodeTest(unittest.TestCase):
    def tearDown(self):
        GRAPH.stop_nodes()

    def listen(self, topic, kind):
        listener = Listener(topic, kind)
        self.addCleanup(listener.stop)
        return listener

    @staticmethod
    def start_slam(*arguments):
        return GRAPH.start("slam_node", "image:=/camera/image_raw", "camera_info:=/camera/camera_info",
                           "_compressed:=true", "_detector:=ros", *arguments)

    @staticmethod
    def start_detector(*arguments, network=None):
        return GRAPH.start("detector_node", f"_detector:=boxes:{SEQUENCE}/boxes.csv", *arguments, network=network)

    def check_run(self, objects, poses):
        """What a run with a good detector has: nearly all poses, of a small error, and its objects."""
        truth = horn.read_tum(os.path.join(SEQUENCE, "groundtruth.txt"))
        estimate = [pose_tuple(m) for m in poses.messages]
        self.assertGreater(len(estimate), 0.3 * FRAMES)
        since_start = sum(stamp >= estimate[0][0] - 1e-6 for stamp, *_ in truth)
        self.assertGreaterEqual(len(estimate), 0.95 * since_start)
        pairs, _ = horn.align(horn.match(truth, estimate))
        self.assertLess(horn.rmse(horn.absolute_errors(pairs)), 0.05)
        people = [m for m in objects.messages if any(o.detection.class_name == "person" for o in m.objects)]
        self.assertGreater(len(people), 0.5 * FRAMES)

    def play_and_check(self):
        objects, poses = self.listen("/slam_node/objects", Objects), self.listen("/slam_node/pose", PoseStamped)
        GRAPH.wait_for_detector()
        self.assertEqual(GRAPH.play(BAG, "-r", "0.5").wait(), 0)
        self.check_run(objects, poses)
        return collections.Counter(m.detector_state for m in objects.messages)

    def test_detects_for_slam_node(self):
        self.start_detector()
        self.start_slam()
        states = self.play_and_check()
        self.assertGreater(states["on time"] + states["late"], 0.3 * FRAMES)
        self.assertLess(states["failed"], 0.1 * FRAMES)

    def test_in_a_network_of_its_own_with_delays_and_losses(self):
        if NETWORK.problem:
            self.skipTest(f"no network namespace: {NETWORK.problem}")
        self.start_detector("detector/detections:=/far/detections", network=NETWORK)
        relay = Relay(Detections, "/far/detections", "/detector/detections", delay_s=0.08, lost=0.05)
        self.addCleanup(relay.end)
        self.start_slam()
        states = self.play_and_check()
        self.assertGreater(relay.passed, 10)
        self.assertGreater(states["late"], 10)

    def test_tracking_goes_on_when_the_detector_is_killed_and_comes_back(self):
        diagnostics = self.listen("/diagnostics", DiagnosticArray)
        objects, poses = self.listen("/slam_node/objects", Objects), self.listen("/slam_node/pose", PoseStamped)

        def detector_says(level, text):
            last = [s for m in diagnostics.messages[-1:] for s in m.status if s.name == "slam_node: detector"]
            return last and last[0].level == level and text in last[0].message

        def more(listener, count=15):
            wanted = len(listener) + count
            wait_until(lambda: len(listener) >= wanted, "more messages")

        detector = self.start_detector()
        self.start_slam()
        GRAPH.wait_for_detector()
        GRAPH.play(BAG, "-r", "0.2")
        more(poses)
        wait_until(lambda: detector_says(DiagnosticStatus.OK, "answers"), "all is well")
        detector.stop(kill=True)
        wait_until(lambda: detector_says(DiagnosticStatus.WARN, "answers failed"), "diagnostics tell")
        more(poses)
        self.assertIn("failed", {m.detector_state for m in objects.messages[-15:]})
        self.start_detector()
        wait_until(lambda: detector_says(DiagnosticStatus.OK, "answers"), "all is well again")
        more(poses)
        # A machine that is busy gets its answers late, and then objects are not what was detected just now.
        wait_until(lambda: any(o.is_detected for m in objects.messages[-15:] for o in m.objects), "it sees objects")
        self.assertTrue(any(o.is_detected for m in objects.messages[-15:] for o in m.objects))

    def test_without_a_detector_it_says_so(self):
        node = GRAPH.start("detector_node", "_detector:=none")
        self.assertEqual(node.wait(60), 2)
        self.assertIn("~detector", node.text())


unittest.main(warnings="ignore")
