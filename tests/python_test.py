"""The Python module: the poses are those of the program, wrong arrays are named, others run meanwhile.

Usage: python_test.py PROGRAM FOLDER_OF_THE_PACKAGE
"""

import ast
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest

FOLDER = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROGRAM = PACKAGE = ""
FRAMES = 100


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, **options)


def read_bytes(*path):
    with open(os.path.join(*path), "rb") as file:
        return file.read()


class PythonTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.room = os.path.join(cls.folder, "room")
        result = run(PROGRAM, "simulate", "room", "--frames", str(FRAMES), "--out", cls.room)
        assert result.returncode == 0, result.stderr

    def follow(self, source, camera, **options):
        slam = dynamic_slam.System(camera, **options)
        results = [slam.process(timestamp, image) for timestamp, image, name in source]
        slam.finish()
        return slam, results

    def assert_same_poses_as_the_program(self, path, camera, max_frames, detector):
        out = os.path.join(self.folder, "out_" + os.path.basename(path))
        result = run(PROGRAM, "run", path, *(["--camera", camera] if camera else []), "--max-frames", str(max_frames),
                     "--detector", detector, "--quiet", "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        source = dynamic_slam.open_source(path, max_frames=max_frames)
        slam, results = self.follow(source, dynamic_slam.load_camera(camera) if camera else source.camera,
                                    detector=detector)
        written = os.path.join(self.folder, "trajectory.txt")
        dynamic_slam.write_trajectory(written, slam.poses())
        self.assertGreater(len(slam.poses()), max_frames // 3)
        self.assertEqual(read_bytes(written), read_bytes(out, "trajectory.txt"))
        dynamic_slam.write_trajectory(written, slam.keyframe_poses())
        self.assertEqual(read_bytes(written), read_bytes(out, "keyframes.txt"))
        with open(os.path.join(out, "config.yaml")) as file:
            self.assertEqual(slam.config, file.read())
        return slam, results

    def test_the_room_has_the_poses_of_the_program(self):
        slam, results = self.assert_same_poses_as_the_program(self.room, "", FRAMES, "none")
        errors = dynamic_slam.evaluate(dynamic_slam.read_trajectory(os.path.join(self.room, "groundtruth.txt")),
                                       slam.poses())
        self.assertEqual(errors.translation.n, len(slam.poses()))
        self.assertLess(errors.translation.rmse, 0.02)
        relative = dynamic_slam.evaluate(slam.poses(), slam.poses(), metric="rpe", align="none")
        self.assertLess(relative.translation.max, 1e-9)
        for result in results:
            self.assertEqual(result.world_from_cam is None, result.state != "tracking")
            self.assertTrue(result.reason or result.state == "tracking")
        pose = results[-1].world_from_cam
        self.assertEqual(pose.shape, (4, 4))
        numpy.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, numpy.eye(3), atol=1e-9)

    @unittest.skipUnless(os.environ.get("DYNAMIC_SLAM_DATA"), "needs DYNAMIC_SLAM_DATA")
    def test_people_who_walk_have_the_poses_of_the_program_and_are_named(self):
        walk = os.path.join(os.environ["DYNAMIC_SLAM_DATA"], "tum_fr1_desk_walk")
        _, results = self.assert_same_poses_as_the_program(walk, "tum_fr1", 120, "builtin")
        people = [o for result in results for o in result.objects if o.class_name == "person"]
        self.assertGreater(len(people), 10)
        # Not each: who was taken for a chair before is believed to move only after some frames.
        self.assertGreater(sum(person.is_dynamic for person in people), 0.8 * len(people))
        for person in people:
            self.assertGreater(person.width * person.height, 0)
            self.assertTrue(0 <= person.score <= 1)

    def test_a_map_is_seen_saved_read_and_exported(self):
        source = dynamic_slam.open_source(self.room)
        self.assertEqual((source.layout, len(source), source.problems), ("tum", FRAMES, []))
        slam, _ = self.follow(source, source.camera)
        (part,) = slam.map().parts
        self.assertEqual(part.keyframes.shape, slam.keyframe_poses().shape)
        self.assertEqual(part.landmarks.shape, (len(part.observations), 3))
        self.assertEqual(part.static_log_odds.shape, part.observations.shape)
        self.assertGreaterEqual(part.observations.min(), 2)
        file, out = os.path.join(self.folder, "room.map"), os.path.join(self.folder, "exported")
        slam.save_map(file)
        (read,) = dynamic_slam.read_map(file).parts
        numpy.testing.assert_array_equal(read.keyframes[:, 0], part.keyframes[:, 0])
        self.assertLessEqual(len(read.landmarks), len(part.landmarks))  # without those that may move
        self.assertEqual(len(dynamic_slam.export_map(file, out).landmarks), len(read.landmarks))
        self.assertEqual(sorted(os.listdir(out)), ["colmap", "keyframes.txt", "map.ply"])
        localiser, _ = self.follow(dynamic_slam.open_source(self.room, max_frames=20), slam.camera, map=file,
                                   localise_only=True)
        self.assertGreater(len(localiser.poses()), 10)
        slam.reset()
        self.assertEqual((slam.part_count, slam.poses().shape), (0, (0, 8)))

    def test_other_threads_run_while_an_image_is_tracked(self):
        source = dynamic_slam.open_source(self.room, max_frames=20)
        slam = dynamic_slam.System(source.camera)
        images = [(timestamp, image) for timestamp, image, _ in source]
        counted, ended = [0], threading.Event()

        def count():
            while not ended.is_set():
                counted[0] += 1
                time.sleep(0)  # gives the GIL back

        interval = sys.getswitchinterval()
        self.addCleanup(sys.setswitchinterval, interval)
        thread = threading.Thread(target=count)
        thread.start()
        sys.setswitchinterval(1000)  # from now on nobody gives the GIL away but who wants to
        before = counted[0]
        for timestamp, image in images:
            slam.process(timestamp, image)
        during = counted[0]
        ended.set()
        thread.join()
        self.assertGreater(during, before)

    def test_a_wrong_array_is_named_with_its_shape(self):
        camera = dynamic_slam.Camera(64, 48, 50, 50, 31.5, 23.5)
        slam = dynamic_slam.System(camera)
        good = numpy.zeros((48, 64), numpy.uint8)
        for wrong, kind, message in [
                (numpy.zeros((64, 48), numpy.uint8), ValueError, r"\(48, 64\).*not \(64, 48\)"),
                (numpy.zeros((48, 64, 2), numpy.uint8), ValueError, r"\(48, 64, 3\).*not \(48, 64, 2\)"),
                (numpy.zeros(10, numpy.uint8), ValueError, r"not \(10,\)"),
                (numpy.zeros((0, 0), numpy.uint8), ValueError, r"not \(0, 0\)"),
                (numpy.zeros((48, 64)), TypeError, "uint8 or uint16, not float64"),
                ([[0] * 64] * 48, TypeError, "must be a numpy array, not list"),
                (None, TypeError, "must be a numpy array, not NoneType")]:
            with self.assertRaisesRegex(kind, message):
                slam.process(0.0, wrong)
        with self.assertRaisesRegex(ValueError, r"mask must have shape \(48, 64\).*not \(4, 4\)"):
            slam.process(0.0, good, numpy.zeros((4, 4), bool))
        with self.assertRaisesRegex(TypeError, "mask must have dtype uint8 or bool, not float64"):
            slam.process(0.0, good, numpy.zeros((48, 64)))
        # What went wrong changed nothing; views with gaps, colours, 16 bits and masks of bool are taken.
        slam.process(0.0, numpy.zeros((48, 128), numpy.uint8)[:, ::2], numpy.ones((48, 64), bool))
        slam.process(0.1, numpy.zeros((48, 64, 3), numpy.uint8))
        slam.process(0.2, numpy.zeros((48, 64), numpy.uint16))
        with self.assertRaisesRegex(dynamic_slam.InputError, "is not after"):
            slam.process(0.2, good)
        with self.assertRaisesRegex(ValueError, r"poses must have shape \(n, 8\).*not \(3, 7\)"):
            dynamic_slam.write_trajectory(os.path.join(self.folder, "t.txt"), numpy.zeros((3, 7)))
        with self.assertRaisesRegex(ValueError, "reference, row 0: its quaternion's norm"):
            dynamic_slam.evaluate(numpy.zeros((3, 8)), numpy.zeros((3, 8)))

    def test_what_cannot_be_used_is_a_value_error(self):
        for call, message in [(lambda: dynamic_slam.load_camera("tum_fr9"), "Did you mean 'tum_fr1'"),
                              (lambda: dynamic_slam.open_source("/nothing"), "no such file"),
                              (lambda: dynamic_slam.Camera(64, 48, -1, 50, 31.5, 23.5), "fx"),
                              (lambda: dynamic_slam.System(dynamic_slam.load_camera("tum_fr1"), mode="fast"),
                               "'offline' or 'realtime', not 'fast'"),
                              (lambda: dynamic_slam.System(dynamic_slam.load_camera("tum_fr1"), set=["orb.featurs=1"]),
                               "orb.features")]:
            with self.assertRaisesRegex(ValueError, message):
                call()

    def test_the_stubs_name_what_is_there(self):
        with open(os.path.join(PACKAGE, "dynamic_slam/__init__.pyi")) as file:
            stubs = ast.parse(file.read()).body
        names = {node.name for node in stubs if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(names, set(dynamic_slam.__all__))
        for node in stubs:
            if isinstance(node, ast.ClassDef) and node.name != "InputError":
                members = {m.name for m in node.body if isinstance(m, ast.FunctionDef)}
                cls = getattr(dynamic_slam, node.name)
                special = {"__init__", "__iter__", "__next__", "__len__"}
                self.assertEqual({m for m in members if m not in special},
                                 {m for m in vars(cls) if not m.startswith("_")}, node.name)
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                self.assertTrue(getattr(dynamic_slam, node.name).__doc__, node.name)

    def test_the_example_plots(self):
        if run(sys.executable, "-c", "import matplotlib").returncode != 0:
            self.skipTest("needs matplotlib")
        picture = os.path.join(self.folder, "path.png")
        result = run(sys.executable, os.path.join(FOLDER, "examples/python/plot_path.py"), self.room, picture,
                     env={**os.environ, "PYTHONPATH": PACKAGE, "MPLCONFIGDIR": self.folder})
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn(f"of {FRAMES} images have a pose", result.stdout)
        self.assertEqual(read_bytes(picture)[:8], b"\x89PNG\r\n\x1a\n")


if __name__ == "__main__":
    PROGRAM, PACKAGE = sys.argv.pop(1), sys.argv.pop(1)
    sys.path.insert(0, PACKAGE)
    import numpy

    import dynamic_slam

    unittest.main()
