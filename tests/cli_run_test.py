"""`dynamic_slam run` and `demo` as a user meets them: files, messages, exit codes and Ctrl-C."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""
FRAMES = 100

RESULTS = ["config.yaml", "frames.csv", "keyframes.txt", "map.ply", "summary.json", "trajectory.png", "trajectory.txt"]
SUMMARY_KEYS = ["frames_total", "frames_tracked", "frames_backfilled", "coverage", "keyframes", "landmarks",
                "initialised_at", "lost_count", "tracking_ms", "startup_s", "wall_s", "peak_rss_mb", "mode", "seed",
                "version"]
CAMERA = "model: pinhole\nwidth: 640\nheight: 480\nfps: 30\nfx: 535.4\nfy: 539.2\ncx: 320.1\ncy: 247.6\n"


def run_program(*arguments, cwd=None):
    return subprocess.run([PROGRAM, *arguments], cwd=cwd, capture_output=True, text=True)


def read(*path):
    with open(os.path.join(*path), encoding="latin-1") as file:  # any byte is a letter
        return file.read()


def data_lines(*path):
    return [line for line in read(*path).splitlines() if not line.startswith("#")]


class CliRunTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.room = os.path.join(cls.shared, "room")
        result = run_program("simulate", "room", "--frames", str(FRAMES), "--out", cls.room)
        assert result.returncode == 0, result.stderr

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def write(self, name, text):
        path = os.path.join(self.folder, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w") as file:
            file.write(text)
        return path

    def assert_input_error(self, arguments, *parts):
        """Exit code 2 with all parts in the message, and nothing is written."""
        before = sorted(os.listdir(self.folder))
        result = run_program("run", *arguments, "--out", os.path.join(self.folder, "out"))
        self.assertEqual(result.returncode, 2, result)
        for part in parts:
            self.assertIn(part, result.stderr)
        self.assertEqual(sorted(os.listdir(self.folder)), before)

    def test_writes_all_results(self):
        result = run_program("run", self.room, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        out = os.path.join(self.folder, "out", "room")
        self.assertEqual(sorted(os.listdir(out)), RESULTS)
        self.assertIn("frame", result.stderr, "no progress")
        self.assertIn("results: out/room", result.stdout)
        self.assertRegex(result.stdout, r"APE .*: rmse 0\.0\d+ m \(0\.\d+% of the path of ")

        summary = json.loads(read(out, "summary.json"))
        for key in SUMMARY_KEYS:
            self.assertIn(key, summary)
        self.assertEqual(sorted(summary["tracking_ms"]), ["max", "mean", "median", "p95"])
        self.assertEqual(summary["frames_total"], FRAMES)
        self.assertAlmostEqual(summary["coverage"], summary["frames_tracked"] / FRAMES)
        self.assertEqual(summary["frames_tracked"] + summary["frames_backfilled"],
                         len(data_lines(out, "trajectory.txt")))
        self.assertEqual(summary["keyframes"], len(data_lines(out, "keyframes.txt")))
        self.assertIn(f"element vertex {summary['landmarks']}\n", read(out, "map.ply"))
        self.assertEqual(len(read(out, "frames.csv").splitlines()), FRAMES + 1)
        self.assertGreater(summary["peak_rss_mb"], 10)

    def test_the_config_that_was_written_can_be_given_back(self):
        first, second = os.path.join(self.folder, "a"), os.path.join(self.folder, "b")
        arguments = ["run", self.room, "--quiet", "--max-frames", "20"]
        result = run_program(*arguments, "--set", "orb.features=700", "--set", "seed=9", "--out", first)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "", "--quiet")
        self.assertIn("features: 700", read(first, "config.yaml"))
        result = run_program(*arguments, "--config", os.path.join(first, "config.yaml"), "--out", second)
        self.assertEqual(result.returncode, 0, result.stderr)
        for name in ("config.yaml", "trajectory.txt", "map.ply"):
            self.assertEqual(read(first, name), read(second, name), name)

    def test_start_skips_frames(self):
        out = os.path.join(self.folder, "a")
        result = run_program("run", self.room, "--start", "50", "--quiet", "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads(read(out, "summary.json"))["frames_total"], FRAMES - 50)

    def test_a_source_that_never_starts_says_why(self):
        out = os.path.join(self.folder, "a")
        result = run_program("run", self.room, "--max-frames", "1", "--quiet", "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("no map was made: initialising:", result.stdout)
        self.assertIsNone(json.loads(read(out, "summary.json"))["initialised_at"])

    def test_input_errors_come_before_the_first_frame(self):
        camera = self.write("camera.yaml", CAMERA)
        self.assert_input_error([os.path.join(self.folder, "missing")], "missing", "no such file or folder")
        self.write("empty/rgb.txt", "# timestamp filename\n")
        self.assert_input_error([os.path.join(self.folder, "empty"), "--camera", camera], "rgb.txt")
        misspelt = self.write("misspelt.yaml", CAMERA.replace("width", "widht"))
        self.assert_input_error([self.room, "--camera", misspelt], "misspelt.yaml:2", "widht", "width")
        small = self.write("small.yaml", CAMERA.replace("640", "320").replace("cx: 320.1", "cx: 160"))
        self.assert_input_error([self.room, "--camera", small], "320", "640")
        flat = self.write("flat.yaml", CAMERA.replace("fx: 535.4", "fx: 0"))
        self.assert_input_error([self.room, "--camera", flat], "flat.yaml", "fx")
        self.assert_input_error([self.room, "--camera", "tum_fr9"], "tum_fr9", "tum_fr1")
        self.assert_input_error([self.room, "--set", "orb.feature=100"], "orb.feature", "orb.features")
        self.assert_input_error([self.room, "--set", "orb.features=1"], "orb.features", "50")
        self.assert_input_error([self.room, "--config", self.write("c.yaml", "orb:\n  featurs: 5\n")], "c.yaml:2", "featurs")
        shutil.copytree(os.path.join(self.room, "rgb"), os.path.join(self.folder, "images"))
        self.assert_input_error([os.path.join(self.folder, "images")], "images", "--camera", "tum_fr1")
        self.assert_input_error([self.room, "--detector", "magic"], "--detector")
        self.assert_input_error([self.room, "--mode", "realtime"], "--mode")

    def test_a_folder_that_cannot_be_written_is_an_input_error(self):
        blocked = self.write("file", "")
        result = run_program("run", self.room, "--out", os.path.join(blocked, "out"))
        self.assertEqual(result.returncode, 2, result)
        self.assertIn("--out", result.stderr)

    def test_interrupt_keeps_the_results(self):
        out = os.path.join(self.folder, "a")
        trace = os.path.join(self.folder, "trace.json")
        process = subprocess.Popen([PROGRAM, "run", self.room, "--out", out, "--trace", trace],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        # The first line of progress tells that the run has begun.
        self.assertIn("frame", process.stderr.readline())
        process.send_signal(signal.SIGINT)
        stdout, _ = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130)
        self.assertIn("interrupted", stdout)
        summary = json.loads(read(out, "summary.json"))
        self.assertTrue(summary["interrupted"])
        self.assertLess(summary["frames_total"], FRAMES)
        self.assertIn("tracking", [event["name"] for event in json.loads(read(trace))["traceEvents"]])
        self.assertEqual(len(data_lines(out, "trajectory.txt")),
                         summary["frames_tracked"] + summary["frames_backfilled"])

    def test_trace_has_all_stages(self):
        trace_file = os.path.join(self.folder, "new", "trace.json")
        result = run_program("run", self.room, "--max-frames", "40", "--quiet", "--trace", trace_file,
                             "--out", os.path.join(self.folder, "a"))
        self.assertEqual(result.returncode, 0, result.stderr)
        trace = json.loads(read(trace_file))
        scopes = [event for event in trace["traceEvents"] if event["ph"] == "X"]
        self.assertRegex(result.stdout, rf"trace: {trace_file} \({len(scopes)} events\)")
        names = [event["name"] for event in scopes]
        self.assertEqual(names.count("tracking"), 40)
        self.assertEqual(names.count("tracking/orb"), 40)
        self.assertEqual(names.count("io/decode"), 40)
        for name in ("mapping", "mapping/cull landmarks", "mapping/create", "mapping/fuse",
                     "mapping/adjust", "mapping/cull keyframes", "finish", "mapping/adjust all"):
            self.assertIn(name, names)
        self.assertIn("main", [event["args"]["name"] for event in trace["traceEvents"]
                               if event["name"] == "thread_name"])
        self.assertEqual(trace["otherData"]["dropped_events"], {})

    def test_a_trace_that_cannot_be_written(self):
        for path in ("/dev/null/trace.json", self.folder):
            result = run_program("run", self.room, "--trace", path, "--out", os.path.join(self.folder, "a"))
            self.assertEqual(result.returncode, 2, result.stdout)
            self.assertIn(f"{path}: cannot be written", result.stderr)
            self.assertNotIn("frame", result.stderr)
            self.assertEqual(result.stdout, "")

    def test_demo(self):
        out = os.path.join(self.folder, "a")
        arguments = ["demo", "--frames", "40", "--seed", "2", "--out", out]
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stdout, r"rmse .* m \(.*% of the path of ")
        self.assertEqual(sorted(os.listdir(out)), sorted(RESULTS + ["overview.png", "sequence"]))
        self.assertEqual(sorted(os.listdir(os.path.join(out, "sequence"))),
                         ["camera.yaml", "groundtruth.txt", "rgb", "rgb.txt"])
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 2, "must not replace a sequence unasked")
        self.assertIn("--force", result.stderr)

    def test_every_subcommand_has_help(self):
        overview = run_program("--help").stdout
        for command in ("run", "eval", "simulate", "demo", "config"):
            self.assertIn(command, overview)
            result = run_program(command, "--help")
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.assertIn("--help", result.stdout)
        for option in ("--camera", "--config", "--set", "--detector", "--mode", "--out", "--start", "--max-frames",
                       "--trace"):
            self.assertIn(option, run_program("run", "--help").stdout)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
