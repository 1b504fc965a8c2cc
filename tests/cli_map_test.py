"""Maps between runs as a user meets them: --save-map, --load-map, --localise-only, `dynamic_slam map`, back-filling."""

import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""
FRAMES = 100


def run_program(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


def rows(path):
    with open(path) as file:
        return [line.split() for line in file.read().splitlines() if not line.startswith("#")]


def read_bytes(path):
    with open(path, "rb") as file:
        return file.read()


def rotate(q, v):
    """The unit quaternion w x y z turns v."""
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    cross = [y * t[2] - z * t[1], z * t[0] - x * t[2], x * t[1] - y * t[0]]
    return [v[i] + w * t[i] + cross[i] for i in range(3)]


class ColmapModel:
    """What COLMAP's documentation says of its text format, and no more."""

    def __init__(self, folder):
        (camera,) = rows(os.path.join(folder, "cameras.txt"))
        self.camera_id, self.model = camera[:2]
        self.width, self.height = map(int, camera[2:4])
        self.params = [float(p) for p in camera[4:]]
        lines = rows(os.path.join(folder, "images.txt"))
        self.images = {}
        for head, points in zip(lines[0::2], lines[1::2]):
            assert head[8] == self.camera_id
            self.images[int(head[0])] = {
                "q": [float(v) for v in head[1:5]], "t": [float(v) for v in head[5:8]], "name": head[9],
                "points": [(float(x), float(y), int(p)) for x, y, p in zip(points[0::3], points[1::3], points[2::3])]}
        self.points = {int(row[0]): ([float(v) for v in row[1:4]], float(row[7]), [int(v) for v in row[8:]])
                       for row in rows(os.path.join(folder, "points3D.txt"))}

    def project(self, image, point):
        """Pixels whose top left one has its centre at (0.5, 0.5)."""
        x, y, z = [a + b for a, b in zip(rotate(image["q"], point), image["t"])]
        fx, fy, cx, cy, *k = self.params
        u, v = x / z, y / z
        r = math.hypot(u, v)
        if self.model == "OPENCV_FISHEYE":
            angle = math.atan(r)
            bent = angle * (1 + sum(k[i] * angle ** (2 * i + 2) for i in range(4)))
            u, v = u * bent / r, v * bent / r
        elif self.model != "PINHOLE":
            k1, k2, p1, p2, *k = k
            k3, k4, k5, k6 = k if self.model == "FULL_OPENCV" else (0, 0, 0, 0)
            radial = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
            u, v = (u * radial + 2 * p1 * u * v + p2 * (r * r + 2 * u * u),
                    v * radial + p1 * (r * r + 2 * v * v) + 2 * p2 * u * v)
        return fx * u + cx, fy * v + cy

    def distances(self):
        """By point: px between where its images see it and where it projects to. Every link is from both sides."""
        found = {}
        for point_id, (position, _, track) in self.points.items():
            found[point_id] = []
            for image_id, index in zip(track[0::2], track[1::2]):
                x, y, linked = self.images[image_id]["points"][index]
                assert linked == point_id
                found[point_id].append(math.dist(self.project(self.images[image_id], position), (x, y)))
        links = sum(p[2] != -1 for image in self.images.values() for p in image["points"])
        assert links == sum(map(len, found.values()))
        return found

    def median_distance(self):
        return statistics.median(d for of_point in self.distances().values() for d in of_point)


class CliMapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.room = os.path.join(cls.shared, "room")
        cls.map = os.path.join(cls.shared, "room.map")
        cls.out = os.path.join(cls.shared, "out")
        assert run_program("simulate", "room", "--frames", str(FRAMES), "--out", cls.room).returncode == 0
        result = run_program("run", cls.room, "--quiet", "--save-map", cls.map, "--out", cls.out)
        assert result.returncode == 0, result.stderr
        assert f"map: {cls.map}" in result.stdout
        cls.exported = os.path.join(cls.shared, "exported")
        result = run_program("map", "export", cls.map, "--out", cls.exported)
        assert result.returncode == 0, result.stderr
        with open(os.path.join(cls.out, "summary.json")) as file:
            cls.summary = json.load(file)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def run_room(self, *arguments, source=None):
        """The summary of a run that ends well."""
        out = os.path.join(self.folder, "out")
        result = run_program("run", source or self.room, "--quiet", "--out", out, *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(os.path.join(out, "summary.json")) as file:
            return json.load(file)

    def assert_input_error(self, arguments, *parts):
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 2, result)
        for part in parts:
            self.assertIn(part, result.stderr)

    def test_info_and_validate_say_what_is_in_it(self):
        info = run_program("map", "info", self.map)
        self.assertEqual(info.returncode, 0, info.stderr)
        self.assertRegex(info.stdout, rf"keyframes +{self.summary['keyframes']}\n")
        self.assertRegex(info.stdout, rf"part 1 +{self.summary['keyframes']} keyframes from ")
        self.assertIn("version 1", info.stdout)
        valid = run_program("map", "validate", self.map)
        self.assertEqual(valid.returncode, 0, valid.stderr)
        self.assertIn(": valid, ", valid.stdout)

    def test_a_damaged_file_is_refused(self):
        content = read_bytes(self.map)
        path = os.path.join(self.folder, "a.map")
        for damaged, reason in ((content[:len(content) // 2], "is damaged"),
                                (content[:5000] + bytes([content[5000] ^ 1]) + content[5001:], "the checksum is wrong"),
                                (b"ply\n", "is no map file")):
            with open(path, "wb") as file:
                file.write(damaged)
            for command in ("info", "validate"):
                self.assert_input_error(["map", command, path], path, reason)
            self.assert_input_error(["run", self.room, "--load-map", path], path, reason)
        self.assert_input_error(["map", "info", self.shared], "is a folder")
        self.assert_input_error(["map", "export", self.map, "--part", "7", "--out", self.folder], "no part 7")

    def test_the_colmap_model_is_the_map(self):
        model = ColmapModel(os.path.join(self.exported, "colmap"))
        self.assertEqual(model.model, "PINHOLE")
        self.assertEqual((model.width, model.height), (640, 480))
        # Poses: COLMAP's are camera from world, TUM's world from camera.
        keyframes = rows(os.path.join(self.exported, "keyframes.txt"))
        self.assertEqual(len(keyframes), len(model.images))
        by_name = {image["name"]: image for image in model.images.values()}
        for stamp, *numbers in keyframes:
            image = by_name[f"{float(stamp):.6f}.png"]
            w, x, y, z = image["q"]
            centre = rotate((w, -x, -y, -z), [-t for t in image["t"]])
            self.assertLess(math.dist(centre, [float(v) for v in numbers[:3]]), 1e-6)
            qx, qy, qz, qw = (float(v) for v in numbers[3:])
            self.assertGreater(abs(w * qw - x * qx - y * qy - z * qz), 1 - 1e-9)
        # Points: those of the point cloud, seen where they project to.
        ply = read_bytes(os.path.join(self.exported, "map.ply"))
        self.assertIn(f"element vertex {len(model.points)}\n".encode(), ply)
        for point_id, distances in model.distances().items():
            self.assertAlmostEqual(model.points[point_id][1], sum(distances) / len(distances), places=3)
        self.assertLess(model.median_distance(), 0.7)

    def test_colmap_gets_the_lens(self):
        """What it is told is where points are in the images, not where they would be without distortion."""
        pinhole = "fx: 450\nfy: 452\ncx: 322\ncy: 237\n"
        for colmap_model, lens in (
                ("OPENCV", "model: pinhole\nk1: -0.28\nk2: 0.07\np1: 0.002\np2: -0.001\n"),
                ("FULL_OPENCV", "model: pinhole\nk1: 0.26\nk2: -0.95\nk3: 1.16\np1: -0.005\n"),
                ("OPENCV_FISHEYE", "model: kannala_brandt\nk1: -0.02\nk2: 0.01\nk3: -0.004\nk4: 0.001\n")):
            with self.subTest(colmap_model):
                folder = os.path.join(self.folder, colmap_model)
                camera, sequence, saved = folder + ".yaml", folder + "_room", folder + ".map"
                with open(camera, "w") as file:
                    file.write("width: 640\nheight: 480\nfps: 30\n" + pinhole + lens)
                for command in (["simulate", "room", "--frames", "40", "--camera", camera, "--out", sequence],
                                ["run", sequence, "--quiet", "--save-map", saved, "--out", folder + "_out"],
                                ["map", "export", saved, "--out", folder]):
                    result = run_program(*command)
                    self.assertEqual(result.returncode, 0, result.stderr)
                model = ColmapModel(os.path.join(folder, "colmap"))
                self.assertEqual(model.model, colmap_model)
                self.assertGreater(len(model.points), 100)
                self.assertLess(model.median_distance(), 0.7)

    def test_localising_leaves_the_map_as_it_is(self):
        before = read_bytes(self.map)
        summary = self.run_room("--load-map", self.map, "--localise-only")
        self.assertGreaterEqual(summary["frames_tracked"] + summary["frames_backfilled"], 0.98 * FRAMES)
        self.assertEqual((summary["keyframes"], summary["maps"]), (self.summary["keyframes"], 1))
        self.assertEqual(read_bytes(self.map), before)
        # In the world of the map: no alignment is needed.
        first = {row[0]: row[1:4] for row in rows(os.path.join(self.out, "trajectory.txt"))}
        distances = [math.dist([float(v) for v in row[1:4]], [float(v) for v in first[row[0]]])
                     for row in rows(os.path.join(self.folder, "out", "trajectory.txt")) if row[0] in first]
        self.assertGreater(len(distances), 0.95 * FRAMES)
        self.assertLess(max(distances), 0.01)

    def test_a_loaded_map_grows(self):
        grown = os.path.join(self.folder, "grown.map")
        summary = self.run_room("--load-map", self.map, "--save-map", grown)
        self.assertEqual(summary["maps"], 1)
        self.assertGreaterEqual(summary["frames_tracked"], 0.95 * FRAMES)
        self.assertEqual(run_program("map", "validate", grown).returncode, 0)

    def test_elsewhere_a_new_map_is_started(self):
        other = os.path.join(self.folder, "other")
        self.assertEqual(run_program("simulate", "room", "--frames", "60", "--seed", "5", "--out", other).returncode, 0)
        summary = self.run_room("--load-map", self.map, source=other)
        self.assertEqual(summary["maps"], 2)
        self.assertGreater(summary["frames_tracked"], 20)

    def test_frames_before_the_start_get_a_pose(self):
        self.assertEqual(self.summary["frames_tracked"] + self.summary["frames_backfilled"], FRAMES)
        live = self.run_room("--no-backfill")
        self.assertEqual(live["frames_backfilled"], 0)
        self.assertEqual(live["frames_tracked"], self.summary["frames_tracked"])
        self.assertLess(live["frames_tracked"], FRAMES)

    def test_what_does_not_go_together(self):
        run = ["run", self.room, "--out", os.path.join(self.folder, "out")]
        self.assert_input_error([*run, "--localise-only"], "--localise-only", "no map", "--load-map")
        self.assert_input_error([*run, "--localise-only", "--load-map", self.map, "--save-map", "a.map"],
                                "--save-map", "does not change")
        self.assert_input_error([*run, "--load-map", self.map, "--set", "image.resize_width=320"], self.map,
                                "another camera", "--camera")
        self.assert_input_error([*run, "--load-map", self.map, "--set", "orb.levels=5"], self.map, "octaves",
                                "orb.levels")
        self.assert_input_error([*run, "--save-map", self.folder], self.folder, "it is a folder")
        self.assertFalse(os.path.exists(os.path.join(self.folder, "out", "summary.json")))


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=2)
