"""slam_node in a graph on loopback: what it publishes while a bag plays, and its services in every state."""

import math
import os
import random
import struct
import sys
import unittest

import ros_graph
import walk_film
from ros_graph import Listener, pose_tuple, wait_until

import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

PROGRAM, BUILD = sys.argv.pop(1), sys.argv.pop(1)
sys.path += [os.path.join(BUILD, "generated", "python"),
             os.path.join(os.path.dirname(__file__), "..", "..", "..", "tests")]

import horn
from dynamic_slam_ros.msg import Objects
from dynamic_slam_ros.srv import GetTrajectory, MapFile

FRAMES = 120
GRAPH = None
SEQUENCE, BAG = "", ""


def setUpModule():
    global GRAPH, SEQUENCE, BAG
    GRAPH = ros_graph.Graph(BUILD)
    SEQUENCE, BAG = walk_film.make(PROGRAM, BUILD, GRAPH.path(), FRAMES)


def tearDownModule():
    GRAPH.end()


def start_node(*parameters):
    return GRAPH.start("slam_node", "image:=/camera/image_raw", "camera_info:=/camera/camera_info",
                       "_compressed:=true", *parameters)


def with_boxes():
    return f"_detector:=boxes:{SEQUENCE}/boxes.csv"


def position(pose):
    return (pose.position.x, pose.position.y, pose.position.z)


class SlamNodeTest(unittest.TestCase):
    def tearDown(self):
        GRAPH.stop_nodes()

    def listen(self, name, kind):
        listener = Listener(f"/slam_node/{name}" if not name.startswith("/") else name, kind)
        self.addCleanup(listener.stop)
        return listener

    def service(self, name, kind):
        rospy.wait_for_service(f"/slam_node/{name}", timeout=30)
        return rospy.ServiceProxy(f"/slam_node/{name}", kind)

    # Half as fast as the camera: a busy machine must not change what is tested here.
    def play(self, *arguments):
        self.assertEqual(GRAPH.play(BAG, "-r", "0.5", *arguments).wait(), 0)

    def test_publishes_what_it_finds(self):
        transforms = self.listen("/tf", TFMessage)
        poses, odometry = self.listen("pose", PoseStamped), self.listen("odometry", Odometry)
        path, points = self.listen("path", Path), self.listen("points", PointCloud2)
        keyframes, objects = self.listen("keyframes", PoseArray), self.listen("objects", Objects)
        pictures, masks = self.listen("image", Image), self.listen("mask", Image)
        diagnostics = self.listen("/diagnostics", DiagnosticArray)
        node = start_node(with_boxes())
        self.service("reset", Trigger)
        # Not those of the updater itself, which says that the node starts before the node says anything.
        wait_until(lambda: any("no camera_info" in s.message for m in list(diagnostics.messages) for s in m.status),
                   "the node has said what it waits for")
        self.play()
        last_stamp = rospy.Time(0)
        wait_until(lambda: len(path) and path.messages[-1].header.stamp == poses.messages[-1].header.stamp,
                   "the path of the last pose has come")

        # Poses of nearly all frames since the first one, where the truth has them. When that is, the load decides.
        self.assertGreater(len(poses), 0.3 * FRAMES)
        first = poses.messages[0].header.stamp
        truth = horn.read_tum(os.path.join(SEQUENCE, "groundtruth.txt"))
        since_start = sum(stamp >= first.to_sec() - 1e-6 for stamp, *_ in truth)
        self.assertGreaterEqual(len(poses), 0.95 * since_start)
        pairs, _ = horn.align(horn.match(truth, [pose_tuple(m) for m in poses.messages]))
        self.assertLess(horn.rmse(horn.absolute_errors(pairs)), 0.05)
        for message in poses.messages:
            self.assertEqual(message.header.frame_id, "map")
            self.assertGreater(message.header.stamp, last_stamp)
            last_stamp = message.header.stamp

        # The tree is map -> odom -> camera, and says the same.
        buffer = tf2_ros.BufferCore(rospy.Duration(1000))
        parents = {}
        for message in transforms.messages:
            for transform in message.transforms:
                self.assertEqual(parents.setdefault(transform.child_frame_id, transform.header.frame_id),
                                 transform.header.frame_id, "one parent each")
                buffer.set_transform(transform, "slam_node")
        self.assertEqual(parents, {"odom": "map", "camera_optical": "odom"})
        for message in poses.messages:
            found = buffer.lookup_transform_core("map", "camera_optical", message.header.stamp).transform
            self.assertLess(math.dist(position(message.pose), (found.translation.x, found.translation.y,
                                                               found.translation.z)), 1e-9)
        self.assertEqual(len(odometry), len(poses))
        for message in odometry.messages:
            self.assertEqual((message.header.frame_id, message.child_frame_id), ("odom", "camera_optical"))

        # The map is before the camera, whose forward is x.
        cloud = points.messages[-1]
        self.assertEqual([f.name for f in cloud.fields], ["x", "y", "z"])
        self.assertGreater(cloud.width, 100)
        xyz = list(struct.iter_unpack("<3f", cloud.data))
        self.assertEqual(len(xyz), cloud.width)
        self.assertTrue(all(math.isfinite(v) for p in xyz for v in p))
        self.assertGreater(sum(x > 0 for x, _, _ in xyz), 0.95 * len(xyz))
        self.assertGreater(len(keyframes.messages[-1].poses), 2)
        self.assertGreaterEqual(len(path.messages[-1].poses), len(poses))

        # Objects, the mask of those that move, and the picture with both.
        self.assertGreaterEqual(len(objects), FRAMES - 5)  # those before camera_info are not used
        boxes = {m.header.stamp: o.detection for m in objects.messages for o in m.objects
                 if o.detection.class_name == "person" and o.is_dynamic}
        self.assertGreater(len(boxes), 0.5 * FRAMES)
        self.assertGreater(len(masks), 0.5 * FRAMES)
        for mask in masks.messages:
            if mask.header.stamp in boxes:
                self.assertEqual(mask.encoding, "mono8")
                box = boxes[mask.header.stamp]
                centre = mask.data[int(box.y + box.height / 2) * mask.step + int(box.x + box.width / 2)]
                self.assertEqual(centre, 255)
        self.assertEqual({(m.width, m.height, m.encoding) for m in pictures.messages},
                         {(masks.messages[0].width, masks.messages[0].height, "bgr8")})

        statuses = {s.name: s for m in diagnostics.messages for s in m.status}
        self.assertEqual(set(statuses), {"slam_node: tracking", "slam_node: detector", "slam_node: images"})
        tracking = [s for m in diagnostics.messages for s in m.status if s.name == "slam_node: tracking"]
        self.assertEqual(tracking[-1].level, DiagnosticStatus.OK)
        said = [s.message for s in tracking if s.message != "Node starting up"]  # which the updater says
        self.assertIn("no camera_info", said[0])

        parts = self.service("get_trajectory", GetTrajectory)()
        self.assertTrue(parts.success)
        self.assertGreaterEqual(len(parts.parts[0].poses), len(poses))
        self.assertTrue(node.is_alive())
        self.assertEqual(node.stop(), 0)

    def test_maps_are_saved_loaded_and_localised_in(self):
        node = start_node(with_boxes())
        save, load = self.service("save_map", MapFile), self.service("load_map", MapFile)
        localise_only = self.service("set_localise_only", SetBool)
        self.assertIn("no camera", save(GRAPH.path("early.dsmap")).message)
        self.play()
        file = GRAPH.path("walk.dsmap")
        self.assertTrue(save(file).success)
        refused = save("/dev/null/walk.dsmap")
        self.assertFalse(refused.success)
        self.assertIn("/dev/null", refused.message)
        self.assertTrue(load(file).success)
        self.assertTrue(localise_only(True).success)
        poses = self.listen("pose", PoseStamped)
        self.play()
        self.assertGreater(len(poses), 0.8 * FRAMES)
        again = GRAPH.path("again.dsmap")
        self.assertTrue(save(again).success)
        self.assertEqual(self.keyframes(file), self.keyframes(again))
        garbage = os.path.join(SEQUENCE, "rgb.txt")
        self.assertFalse(load(garbage).success)
        self.assertEqual(node.stop(), 0)

    @staticmethod
    def keyframes(file):
        return [line for line in walk_film.run(PROGRAM, "map", "info", file).splitlines() if "keyframes" in line]

    def test_a_bag_that_is_played_again_keeps_the_map(self):
        poses = self.listen("pose", PoseStamped)
        node = start_node(with_boxes())
        self.service("reset", Trigger)
        self.play()
        wait_until(lambda: len(poses) > 20, "poses of the first time have come")
        seen = len(poses)
        self.play()
        wait_until(lambda: len(poses) > seen + 20, "poses of the second time have come")
        again = [pose_tuple(message) for message in poses.messages[seen:]]
        # It was found again in the map of the first time: at the same stamps it is in the same places.
        first = {round(pose[0], 4): pose[1] for pose in map(pose_tuple, poses.messages[:seen])}
        far = [math.dist(first[round(p[0], 4)], p[1]) for p in again if round(p[0], 4) in first]
        reach = max(math.dist(a, b) for a in first.values() for b in first.values())
        self.assertGreater(len(far), 20)
        self.assertLess(sorted(far)[len(far) // 2], 0.05 * reach)
        node.stop()
        self.assertIn("keyframes is kept", node.text())

    def test_parameters_are_options(self):
        for parameter, reasons in (("_options/tracker/min_inlier:=3", ("tracker.min_inlier", "tracker.min_inliers")),
                                   ("_options/orb/features:=1", ("orb.features", "50 to 20000")),
                                   ("_detektor:=none", ("detektor", "detector")),
                                   ("_options/orb/features:=many", ("orb.features", "whole number"))):
            node = start_node(parameter)
            self.assertEqual(node.wait(60), 2, parameter)
            for reason in reasons:
                self.assertIn(reason, node.text())
            rospy.delete_param("/slam_node")  # else the next one has it too

    def test_camera_info_without_a_calibration_is_told(self):
        diagnostics = self.listen("/diagnostics", DiagnosticArray)
        node = start_node()
        info = rospy.Publisher("/camera/camera_info", CameraInfo, queue_size=1, latch=True)
        info.publish(CameraInfo(width=640, height=480))
        wait_until(lambda: any("holds no calibration" in s.message for m in diagnostics.messages for s in m.status),
                   "diagnostics say so")
        info.unregister()
        self.assertTrue(node.is_alive())

    def test_answers_all_services_in_every_state(self):
        node = start_node(with_boxes())
        file = GRAPH.path("random.dsmap")
        calls = {"reset": (Trigger, lambda: ()), "set_localise_only": (SetBool, lambda: (draw.random() < 0.5,)),
                 "save_map": (MapFile, lambda: (draw.choice([file, "", "/dev/null/x", GRAPH.folder.name]),)),
                 "load_map": (MapFile, lambda: (draw.choice([file, "", BAG, GRAPH.folder.name]),)),
                 "get_trajectory": (GetTrajectory, lambda: ())}
        draw = random.Random(11)
        proxies = {name: self.service(name, kind) for name, (kind, _) in calls.items()}

        def call(name):
            answer = proxies[name](*calls[name][1]())
            self.assertTrue(answer.message, name)
            return answer.success

        # Before there is a camera nothing succeeds.
        self.assertFalse(any(call(name) for name in calls for _ in range(4)))
        player = GRAPH.play(BAG, "--loop", "-r", "0.5")
        counts = {name: [0, 0] for name in calls}
        for _ in range(980):
            # More resets would leave no time for a map.
            name = draw.choices(list(calls), weights=(1, 3, 1, 1, 10))[0]
            counts[name][call(name)] += 1
            rospy.sleep(draw.choice([0] * 9 + [0.2]))
        player.stop()
        print(counts, flush=True)
        self.assertTrue(node.is_alive(), node.text())
        for name in calls:
            self.assertGreater(counts[name][True], 0, name)
        self.assertTrue(proxies["reset"]().success)
        self.play()
        self.assertTrue(proxies["save_map"](file).success)
        self.assertTrue(self.keyframes(file))
        self.assertEqual(node.stop(), 0)


unittest.main(warnings="ignore")
