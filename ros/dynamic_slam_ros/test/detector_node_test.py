"""The detector in a node, and a network, of its own: delayed, lost, killed and started again."""

import collections
import os
import random
import subprocess
import sys
import threading
import time
import unittest

import ros_graph
from ros_graph import Listener, wait_until

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


def run(program, *arguments):
    result = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, f"{program} {arguments}: {result.stderr}"
    return result.stdout


class Network:
    """A network namespace whose one cable ends here."""

    HERE, THERE = "10.213.77.1", "10.213.77.2"

    def __init__(self):
        self.name = f"ds{os.getpid() % 100000}"
        commands = (f"netns add {self.name}", f"link add {self.name}a type veth peer name {self.name}b",
                    f"link set {self.name}b netns {self.name}", f"addr add {self.HERE}/30 dev {self.name}a",
                    f"link set {self.name}a up", f"-n {self.name} addr add {self.THERE}/30 dev {self.name}b",
                    f"-n {self.name} link set {self.name}b up", f"-n {self.name} link set lo up")
        self.problem = ""
        for command in commands:
            try:
                result = subprocess.run(["ip", *command.split()], capture_output=True, text=True)
            except FileNotFoundError:
                self.problem = "there is no ip (iproute2)"
                return
            if result.returncode != 0:
                self.problem = f"ip {command}: {result.stderr.strip()}"
                return

    def end(self):
        subprocess.run(["ip", "link", "del", f"{self.name}a"], capture_output=True)
        subprocess.run(["ip", "netns", "del", self.name], capture_output=True)


class Relay:
    """Passes detections on after a delay, and loses a share of them."""

    def __init__(self, source, target, delay_s, lost, seed=5):
        self.draw, self.lost, self.delay_s = random.Random(seed), lost, delay_s
        self.waiting, self.passed, self.dropped = collections.deque(), 0, 0
        self.publisher = rospy.Publisher(target, Detections, queue_size=10)
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.pass_on, daemon=True)
        self.thread.start()
        self.subscriber = rospy.Subscriber(source, Detections, self.take)

    def take(self, message):
        if self.draw.random() < self.lost:
            self.dropped += 1
        else:
            self.waiting.append((time.monotonic() + self.delay_s, message))

    def pass_on(self):
        while not self.ended.wait(0.002):
            while self.waiting and self.waiting[0][0] <= time.monotonic():
                self.publisher.publish(self.waiting.popleft()[1])
                self.passed += 1

    def end(self):
        self.subscriber.unregister()
        self.ended.set()
        self.thread.join()
        self.publisher.unregister()


def setUpModule():
    global GRAPH, NETWORK, SEQUENCE, BAG
    NETWORK = Network()
    GRAPH = ros_graph.Graph(BUILD, "127.0.0.1" if NETWORK.problem else Network.HERE)
    SEQUENCE, BAG = GRAPH.path("walk"), GRAPH.path("walk.bag")
    run(PROGRAM, "simulate", "office_walk", "--frames", str(FRAMES), "--out", SEQUENCE)
    run(os.path.join(BUILD, "make_bag"), SEQUENCE, BAG)


def tearDownModule():
    GRAPH.end()
    NETWORK.end()


class DetectorNodeTest(unittest.TestCase):
    def tearDown(self):
        for node in GRAPH.nodes[1:]:
            node.stop()
        for name in ("/slam_node", "/detector_node"):
            if rospy.has_param(name):
                rospy.delete_param(name)

    def listen(self, topic, kind):
        listener = Listener(topic, kind)
        self.addCleanup(listener.stop)
        return listener

    @staticmethod
    def start_slam(*arguments):
        return GRAPH.start("slam_node", "image:=/camera/image_raw", "camera_info:=/camera/camera_info",
                           "_compressed:=true", "_detector:=ros", *arguments)

    @staticmethod
    def start_detector(*arguments, far_away=False):
        arguments = (f"_detector:=boxes:{SEQUENCE}/boxes.csv", *arguments)
        if not far_away:
            return GRAPH.start("detector_node", *arguments)
        return GRAPH.start("/usr/sbin/ip", "netns", "exec", NETWORK.name, os.path.join(BUILD, "detector_node"),
                           *arguments, environment={"ROS_IP": Network.THERE})

    def wait_for_pair(self):
        import rosgraph
        master = rosgraph.Master(rospy.get_name())

        def is_complete():
            publishers, subscribers, _ = master.getSystemState()
            return ("/detector/detections" in dict(publishers) and "/detector/detections" in dict(subscribers) and
                    "/detector/image/compressed" in dict(subscribers))
        wait_until(is_complete, "both nodes are there")

    def check_run(self, objects, poses):
        """What a run with a good detector has: nearly all poses, of a small error, and its objects."""
        truth = horn.read_tum(os.path.join(SEQUENCE, "groundtruth.txt"))
        estimate = [(m.header.stamp.to_sec(), (m.pose.position.x, m.pose.position.y, m.pose.position.z),
                     (m.pose.orientation.w, m.pose.orientation.x, m.pose.orientation.y, m.pose.orientation.z))
                    for m in poses.messages]
        self.assertGreater(len(estimate), 0.3 * FRAMES)
        since_start = sum(stamp >= estimate[0][0] - 1e-6 for stamp, *_ in truth)
        self.assertGreaterEqual(len(estimate), 0.95 * since_start)
        pairs, _ = horn.align(horn.match(truth, estimate))
        self.assertLess(horn.rmse(horn.absolute_errors(pairs)), 0.05)
        people = [m for m in objects.messages if any(o.detection.class_name == "person" for o in m.objects)]
        self.assertGreater(len(people), 0.5 * FRAMES)

    def play_and_check(self):
        objects, poses = self.listen("/slam_node/objects", Objects), self.listen("/slam_node/pose", PoseStamped)
        self.wait_for_pair()
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
        self.start_detector("detector/detections:=/far/detections", far_away=True)
        relay = Relay("/far/detections", "/detector/detections", delay_s=0.08, lost=0.05)
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
        self.wait_for_pair()
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
        self.assertTrue(any(o.is_detected for m in objects.messages[-15:] for o in m.objects))

    def test_without_a_detector_it_says_so(self):
        node = GRAPH.start("detector_node", "_detector:=none")
        self.assertEqual(node.wait(60), 2)
        self.assertIn("~detector", node.text())


unittest.main(warnings="ignore")
