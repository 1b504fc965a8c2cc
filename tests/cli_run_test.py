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

RESULTS = ["config.yaml", "frames.csv", "keyframes.txt", "loops.csv", "map.ply", "report.html", "summary.json",
           "trajectory.png", "trajectory.txt"]
SUMMARY_KEYS = ["frames_total", "frames_tracked", "frames_backfilled", "coverage", "keyframes", "landmarks", "maps", "frames_in_other_maps",
                "initialised_at", "lost_count", "pieces_cut", "frames_refuted", "leaps", "tracking_ms", "startup_s", "wall_s", "peak_rss_mb", "mode", "seed",
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
        """Each names the thing, the reason and the remedy."""
        camera = self.write("camera.yaml", CAMERA)
        path = lambda name: os.path.join(self.folder, name)

        self.assert_input_error([path("missing")], path("missing"), "no such file or folder", "Check the path")
        self.write("empty/rgb.txt", "# timestamp filename\n")
        self.assert_input_error([path("empty"), "--camera", camera], path("empty/rgb.txt"), "lists no image",
                                "timestamp rgb/file.png")
        os.mkdir(path("nothing"))
        self.assert_input_error([path("nothing"), "--camera", camera], path("nothing"), "no image", "Known are: TUM")
        text = self.write("notes.txt", "not a video")
        self.assert_input_error([text, "--camera", camera], text, "is not a video", "Give the folder")
        photo = os.path.join(self.room, "rgb", sorted(os.listdir(os.path.join(self.room, "rgb")))[0])
        self.assert_input_error([photo, "--camera", camera], photo, "is a single image", "Give the folder")
        self.write("broken/rgb.txt", "1 rgb/1.png\n2 rgb/2.png\n")
        self.write("broken/rgb/1.png", "no image")
        self.assert_input_error([path("broken"), "--camera", camera], path("broken"),
                                "no image of it can be read (first: rgb/1.png: the image cannot be decoded)",
                                "Check the files")
        shutil.copytree(os.path.join(self.room, "rgb"), path("images"))
        self.assert_input_error([path("images")], path("images"), "has no camera file", "--camera", "tum_fr1")

        misspelt = self.write("misspelt.yaml", CAMERA.replace("width", "widht"))
        self.assert_input_error([self.room, "--camera", misspelt], "misspelt.yaml:2", "unknown key 'widht'",
                                "Did you mean 'width'?", "'width' is missing", "Correct the file")
        small = self.write("small.yaml", CAMERA.replace("640", "320").replace("cx: 320.1", "cx: 160"))
        self.assert_input_error([self.room, "--camera", small], small, "320 x 480 px, these have 640 x 480 px",
                                "Choose another --camera")
        flat = self.write("flat.yaml", CAMERA.replace("fx: 535.4", "fx: 0"))
        self.assert_input_error([self.room, "--camera", flat], "flat.yaml:5", "fx is 0", "Correct the file")
        self.assert_input_error([self.room, "--camera", "tum_fr9"], "tum_fr9", "Known names", "tum_fr1")

        self.assert_input_error([self.room, "--set", "orb.feature=100"], "orb.feature", "orb.features")
        self.assert_input_error([self.room, "--set", "orb.features=1"], "orb.features", "50")
        # Read before the first frame, and after an option that takes one value.
        self.assert_input_error(["--set", "orb.features=500", self.room, "--scale-from", f"file:{path('no.txt')}"],
                                path("no.txt"))
        config = self.write("c.yaml", "orb:\n  featurs: 5\n")
        self.assert_input_error([self.room, "--config", config], "c.yaml:2", "featurs")
        self.assert_input_error([self.room, "--set", f"image.mask={path('no.png')}"], path("no.png"),
                                "the file is missing", "image.mask")
        self.assert_input_error([self.room, "--set", "image.crop_left=600"], "crop_left", "principal point",
                                "Choose a part")
        self.assert_input_error([self.room, "--set", "image.bayer=rgb"], "image.bayer", "'rgb'", "rggb")
        self.assert_input_error([self.room, "--detector", "magic"], "detector 'magic'", "Known names: none, hog")
        self.assert_input_error([self.room, "--mode", "fast"], "--mode")

    def test_a_folder_that_cannot_be_written_is_an_input_error(self):
        # Below a file and in /proc not even root can.
        for out in (os.path.join(self.write("file", ""), "out"), "/proc/out"):
            result = run_program("run", self.room, "--out", out)
            self.assertEqual(result.returncode, 2, result)
            self.assertRegex(result.stderr, f"^error: {out}: .+\n +Choose another folder with --out")
            self.assertEqual(result.stdout, "")
        self.assertEqual(os.listdir(self.folder), ["file"])

    def test_faults_in_mid_sequence_cost_one_frame_each(self):
        sequence, out = os.path.join(self.folder, "faults"), os.path.join(self.folder, "a")
        shutil.copytree(self.room, sequence)
        lines = data_lines(sequence, "rgb.txt")
        names = [line.split()[1] for line in lines]
        with open(os.path.join(sequence, names[20]), "r+b") as file:
            file.truncate(os.path.getsize(file.name) // 2)
        os.remove(os.path.join(sequence, names[30]))
        # A grey image of 16 x 16 px.
        with open(os.path.join(sequence, "small.pgm"), "wb") as file:
            file.write(b"P5 16 16 255 " + bytes(256))
        lines[40] = f"{lines[40].split()[0]} small.pgm"
        lines[50] = f"nan {names[50]}"
        lines[60] = f"{lines[10].split()[0]} {names[60]}"  # goes back
        lines[65] = f"1e12 {names[65]}"
        lines[70] = "what is this"
        lines.insert(75, lines[74])  # twice
        self.write("faults/rgb.txt", "\n".join(lines) + "\n")

        result = run_program("run", sequence, "--quiet", "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "", "decoders do not chatter")
        summary = json.loads(read(out, "summary.json"))
        self.assertEqual(summary["frames_total"], FRAMES + 1)
        reasons = {item["name"]: item["reason"] for item in summary["skipped"]}
        self.assertEqual(len(summary["skipped"]), 8)
        for name, reason in ((names[20], "truncated"), (names[30], "missing"), ("small.pgm", "16 x 16 px"),
                             ("rgb.txt:51", "nan"), (names[60], "goes back"), (names[65], "is ahead of"),
                             ("rgb.txt:71", "what is this"), (names[74], "duplicate")):
            self.assertIn(reason, reasons.get(name, "not skipped"), name)
        self.assertEqual(len(read(out, "frames.csv").splitlines()), 1 + FRAMES + 1 - 8)
        self.assertEqual(summary["lost_count"], 0)
        self.assertEqual(summary["leaps"], [])
        self.assertGreater(summary["frames_tracked"], 80)

    def interrupt(self, signal_number, source, *arguments):
        """Sends the signal when the first line of progress tells that the run has begun; (stdout, folder, summary)."""
        out = tempfile.mkdtemp(dir=self.folder)
        process = subprocess.Popen([PROGRAM, "run", source, "--out", out, *arguments],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertIn("frame", process.stderr.readline())
        process.send_signal(signal_number)
        stdout, stderr = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertIn("interrupted", stdout)
        self.assertLessEqual(set(RESULTS) - {"trajectory.png"}, set(os.listdir(out)))  # drawn where there is truth
        summary = json.loads(read(out, "summary.json"))
        self.assertTrue(summary["interrupted"])
        self.assertEqual(summary["failure"], "")
        self.assertEqual(len(data_lines(out, "trajectory.txt")),
                         summary["frames_tracked"] + summary["frames_backfilled"])
        self.assertEqual(summary["keyframes"], len(data_lines(out, "keyframes.txt")))
        return stdout, out, summary

    def test_interrupt_keeps_the_results(self):
        trace = os.path.join(self.folder, "trace.json")
        for mode in ("offline", "realtime"):
            for signal_number in (signal.SIGINT, signal.SIGTERM):
                with self.subTest(mode=mode, signal=signal_number):
                    _, _, summary = self.interrupt(signal_number, self.room, "--mode", mode, "--trace", trace)
                    self.assertEqual(summary["mode"], mode)
                    self.assertLess(summary["frames_total"], FRAMES)
                    self.assertGreater(summary["keyframes"], 0)
                    events = json.loads(read(trace))["traceEvents"]
                    self.assertIn("tracking", [event["name"] for event in events])

    def test_interrupt_before_there_is_a_map(self):
        # A camera that stands still never has one. The first line comes after five seconds.
        still = os.path.join(self.folder, "still")
        os.mkdir(still)
        shutil.copy(os.path.join(self.room, "camera.yaml"), still)
        name = data_lines(self.room, "rgb.txt")[0].split()[1]
        shutil.copytree(os.path.join(self.room, "rgb"), os.path.join(still, "rgb"))
        self.write("still/rgb.txt", "".join(f"{i / 30:.6f} {name}\n" for i in range(3000)))
        stdout, _, summary = self.interrupt(signal.SIGINT, still, "--mode", "realtime")
        self.assertIn("no map was made: initialising", stdout)
        self.assertIsNone(summary["initialised_at"])
        self.assertEqual((summary["keyframes"], summary["frames_tracked"]), (0, 0))
        self.assertGreater(summary["frames_total"], 0)
        self.assertLess(summary["frames_total"], 3000)

    def test_trace_has_all_stages(self):
        trace_file = os.path.join(self.folder, "new", "trace.json")
        result = run_program("run", self.room, "--max-frames", "40", "--quiet", "--trace", trace_file,
                             "--out", os.path.join(self.folder, "a"))
        self.assertEqual(result.returncode, 0, result.stderr)
        trace = json.loads(read(trace_file))
        scopes = [event for event in trace["traceEvents"] if event["ph"] == "X"]
        counters = [event["name"] for event in trace["traceEvents"] if event["ph"] == "C"]
        self.assertEqual(counters.count("keyframes waiting"), 40)
        self.assertRegex(result.stdout, rf"trace: {trace_file} \({len(scopes) + len(counters)} events\)")
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

    def boxes_file(self, folder, frames, detected):
        """Boxes of a person who stands in the right half of each image."""
        rows = ["timestamp,class,score,x,y,w,h"]
        for line in data_lines(folder, "rgb.txt")[:frames]:
            if detected:
                rows.append(f"{line.split()[0]},person,0.9,320,0,320,480")
        return self.write("boxes.csv", "\n".join(rows) + "\n")

    def test_a_detector_without_a_class_that_moves_is_told_of(self):
        rows = ["timestamp,class,score,x,y,w,h", "0,Person,0.9,320,0,320,480", "0,gizmo,0.9,0,0,320,480"]
        out = os.path.join(self.folder, "out")
        for boxes, is_useless in ((rows, False), (rows[::2], True)):
            file = self.write("boxes.csv", "\n".join(boxes) + "\n")
            result = run_program("run", self.room, "--max-frames", "3", "--detector", "boxes:" + file, "--out", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual("none of its classes (gizmo) scores above 5" in result.stdout + result.stderr, is_useless)

    def test_a_dynamic_box_is_masked_counted_and_not_trusted(self):
        out, masks = os.path.join(self.folder, "out"), os.path.join(self.folder, "masks")
        boxes = self.boxes_file(self.room, 40, True)
        result = run_program("run", self.room, "--max-frames", "40", "--detector", "boxes:" + boxes, "--out", out,
                             "--export-masks", masks, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        rows = [line.split(",") for line in read(out, "frames.csv").splitlines()]
        columns = {name: rows[0].index(name) for name in ["static", "dynamic", "culled", "kept", "keypoints"]}
        for row in rows[1:]:
            count = {name: int(row[column]) for name, column in columns.items()}
            self.assertEqual(count["static"] + count["dynamic"], count["keypoints"])
            self.assertEqual(count["culled"] + count["kept"], count["dynamic"])
            self.assertGreater(count["dynamic"], 100)
        ratio = json.loads(read(out, "summary.json"))["dynamic_keypoints"]["mean_ratio"]
        self.assertTrue(0.2 < ratio < 0.8, ratio)
        self.assertEqual(len(os.listdir(masks)), 40)

        # With these masks no keypoint is left there at all.
        masked = os.path.join(self.folder, "masked")
        result = run_program("run", self.room, "--max-frames", "40", "--masks", masks, "--detector", "boxes:" + boxes,
                             "--out", masked, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        left = [line.split(",")[columns["dynamic"]] for line in read(masked, "frames.csv").splitlines()[1:]]
        before = [row[columns["dynamic"]] for row in rows[1:]]
        # Only in the margin around the box.
        self.assertLess(sum(map(int, left)), 0.2 * sum(map(int, before)))

    def test_boxes_are_of_the_images_of_the_source(self):
        """Whatever is made of the images first: true boxes, given as a detector's, are found where they are."""
        walk = os.path.join(self.folder, "walk")
        result = run_program("simulate", "office_walk", "--frames", "8", "--out", walk)
        self.assertEqual(result.returncode, 0, result.stderr)
        for options in (["resize_width=320"], ["crop_left=40", "crop_top=30", "crop_width=500", "resize_width=400"]):
            out = os.path.join(self.folder, "prepared")
            assignments = [part for option in options for part in ("--set", "image." + option)]
            result = run_program("run", walk, "--detector", f"boxes:{walk}/boxes.csv", "--quiet", "--out", out, *assignments)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("Recall 100.0% and precision 100.0%", read(out, "report.html"), options)

    def test_boxes_and_masks_of_another_sequence_are_told_of(self):
        masks, out = os.path.join(self.folder, "masks"), os.path.join(self.folder, "out")
        result = run_program("run", self.room, "--max-frames", "6", "--out", out, "--export-masks", masks, "--quiet",
                             "--detector", "boxes:" + self.boxes_file(self.room, 3, True))
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        first = sorted(os.listdir(masks))[0]
        arguments = ["run", self.room, "--out", out, "--masks", masks, "--quiet", "--detector"]
        matching = run_program(*arguments, "boxes:" + os.path.join(self.folder, "boxes.csv"), "--max-frames", "6")
        self.assertEqual(matching.stderr, "")
        for name in os.listdir(masks):
            os.rename(os.path.join(masks, name), os.path.join(masks, "mask_" + name))
        late = self.write("late.csv", "timestamp,x,y,w,h\n1000.5,0,0,9,9\n1001.25,0,0,9,9\n")
        for frames in ("6", "0"):  # at the end of a short run, and in the middle of a long one
            result = run_program(*arguments, "boxes:" + late, "--max-frames", frames)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual(result.stderr.count("warning: "), 2, result.stderr)
            self.assertRegex(result.stderr, r"late.csv has boxes for none of \d+ images: their stamps are 0.000 to ")
            self.assertIn("those of the boxes 1000.500 to 1001.250 s", result.stderr)
            self.assertIn(f"{first} is not there, but for instance mask_{first}", result.stderr)

    def test_masks_that_do_not_fit_are_input_errors(self):
        self.assert_input_error([self.room, "--masks", os.path.join(self.folder, "nowhere")], "nowhere", "no folder")

    def test_demo(self):
        out = os.path.join(self.folder, "a")
        arguments = ["demo", "--frames", "25", "--seed", "2", "--detector", "boxes:{source}/boxes.csv", "--out", out,
                     "--quiet"]
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        for scene in ("office_walk", "street_short"):
            rows = [line.split() for line in result.stdout.splitlines() if line.startswith(scene)]
            self.assertEqual([row[1] for row in rows], ["with", "without"])
            self.assertEqual([rows[0][4], rows[1][4]], ["1.000", "-"], "the true boxes miss nobody")
            self.assertEqual(sorted(os.listdir(os.path.join(out, scene))), ["sequence", "with", "without"])
            for run in ("with", "without"):
                self.assertLessEqual(set(RESULTS) - {"trajectory.png"}, set(os.listdir(os.path.join(out, scene, run))))
        self.assertIn("overview.png", os.listdir(out))
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
