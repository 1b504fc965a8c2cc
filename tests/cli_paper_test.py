"""`dynamic_slam bench tum`, `kitti` and `profiles` on fragments: tables, errors computed anew, going on after an end."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import horn

PROGRAM = ""
FRAMES = 45


def run_program(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


def read(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return file.read()


def read_json(*path):
    return json.loads(read(*path))


class CliPaperTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.root = os.path.join(cls.shared, "tum")
        cls.sequence = os.path.join(cls.root, "rgbd_dataset_freiburg3_walking_xyz")
        result = run_program("simulate", "room", "--frames", str(FRAMES), "--out", cls.sequence)
        assert result.returncode == 0, result.stderr
        cls.out = os.path.join(cls.shared, "bench_tum")
        cls.arguments = ["bench", "tum", "--root", cls.root, "--runs", "2", "--jobs", "2", "--detector", "hog",
                         "--set", "detector.every=15", "--out", cls.out, "--quiet"]
        cls.result = run_program(*cls.arguments)
        assert cls.result.returncode == 0, cls.result.stderr

    def test_tables_have_published_figures_beside_ours(self):
        for title in ("Table 1: absolute", "Table 1, all frames", "Table 2: relative", "Table 3: relative", "Table 4: time"):
            self.assertIn(title, self.result.stdout)
        tables = {table["title"]: table for table in read_json(self.out, "tables.json")}
        rows = {row["sequence"]: row for row in tables["Table 1: absolute pose error, cm"]["rows"]}
        row = rows["fr3_walking_xyz"]
        self.assertEqual(row["Dynamic-SLAM (paper): RMSE"], "1.324")
        self.assertEqual(row["ORB-SLAM2 (paper): RMSE"], "1.431")
        with_, without = float(row["ours with: RMSE"]), float(row["ours without semantics: RMSE"])
        self.assertGreater(with_, 0)
        # Eq. 14; the errors in the table are rounded.
        self.assertAlmostEqual(float(row["ours with: Imp."].rstrip("%")), 100 * (1 - with_ / without), delta=1 / without)
        self.assertEqual(rows["fr3_sitting_rpy"]["ours with: RMSE"], "-")
        self.assertIn("Dynamic-SLAM (paper): RMSE", read(self.out, "table_1.csv").splitlines()[0])
        self.assertEqual(read(self.out, "tables.txt").strip(), self.result.stdout[self.result.stdout.index("Table 1:"):
                         self.result.stdout.index("results: ")].strip())

    def test_a_missing_sequence_is_named(self):
        self.assertIn("fr3_sitting_rpy: not in", self.result.stdout)

    def figures(self, run):
        return read_json(self.out, "fr3_walking_xyz", run, "figures.json")["figures"]

    def test_errors_equal_an_independent_computation(self):
        truth = horn.read_tum(os.path.join(self.sequence, "groundtruth.txt"))
        for run in ("with/1", "without/2"):
            for file, key in (("keyframes.txt", "keyframe_errors"), ("trajectory.txt", "frame_errors")):
                estimate = horn.read_tum(os.path.join(self.out, "fr3_walking_xyz", run, file))
                pairs, scale = horn.align(horn.match(truth, estimate))
                ours = self.figures(run)[key]
                self.assertGreater(len(pairs), 5)
                self.assertEqual(ours["ape"]["n"], len(pairs))
                self.assertAlmostEqual(ours["scale"], scale, delta=1e-9)
                self.assertAlmostEqual(ours["ape"]["rmse"], horn.rmse(horn.absolute_errors(pairs)), delta=1e-9)
                errors = horn.relative_errors(pairs)
                self.assertAlmostEqual(ours["rpe_translation"]["rmse"], horn.rmse([e[0] for e in errors]), delta=1e-9)
                self.assertAlmostEqual(ours["rpe_rotation"]["rmse"], horn.rmse([e[1] for e in errors]), delta=1e-9)
                ends = horn.ends_by_metres(pairs, 1)
                if len(ends) > 1:
                    per_m = horn.relative_errors(pairs, ends)
                    self.assertAlmostEqual(ours["rpe_rotation_per_m"]["rmse"], horn.rmse([e[1] for e in per_m]), delta=1e-9)

    def test_runs_have_seeds_of_their_own_and_reports(self):
        for run, seed in (("with/1", 1), ("with/2", 2)):
            folder = os.path.join(self.out, "fr3_walking_xyz", run)
            self.assertEqual(read_json(folder, "summary.json")["seed"], seed)
            self.assertTrue(os.path.isfile(os.path.join(folder, "report.html")))
        self.assertIn("fr3_walking_xyz/with/2/report.html", read(self.out, "report.html"))

    def test_what_is_done_is_not_done_again(self):
        out = os.path.join(self.shared, "again")
        shutil.copytree(self.out, out)
        shutil.rmtree(os.path.join(out, "fr3_walking_xyz", "without", "2"))
        arguments = self.arguments[:]
        arguments[arguments.index(self.out)] = out
        done = os.path.join(out, "fr3_walking_xyz", "with", "1", "trajectory.txt")
        before = os.stat(done).st_mtime_ns
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr.count("done before"), 3, result.stderr)
        self.assertEqual(os.stat(done).st_mtime_ns, before)
        first, second = read_json(self.out, "tables.json"), read_json(out, "tables.json")
        self.assertEqual([t for t in first if "time" not in t["title"]], [t for t in second if "time" not in t["title"]])

    def test_other_options_are_another_run(self):
        out = os.path.join(self.shared, "other")
        shutil.copytree(self.out, out)
        arguments = [a if a != self.out else out for a in self.arguments]
        arguments[arguments.index("--runs") + 1] = "1"
        result = run_program(*arguments, "--max-frames", "30")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("done before", result.stderr)

    def test_killed_and_started_again(self):
        out = os.path.join(self.shared, "killed")
        arguments = [a if a != self.out else out for a in self.arguments]
        arguments[arguments.index("--jobs") + 1] = "1"
        first = os.path.join(out, "fr3_walking_xyz", "with", "1", "figures.json")
        process = subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not os.path.exists(first) and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
        process.wait()
        result = run_program(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("with/1: done before", result.stderr)
        strip = lambda out: [t for t in read_json(out, "tables.json") if "time" not in t["title"]]
        self.assertEqual(strip(out), strip(self.out))

    def test_a_sequence_that_fails_is_listed_and_the_others_are_run(self):
        root = os.path.join(self.shared, "with_broken")
        os.makedirs(os.path.join(root, "broken"))
        with open(os.path.join(root, "broken", "rgb.txt"), "w", encoding="utf-8") as file:
            file.write("1.0 rgb/none.png\n")
        shutil.copytree(self.sequence, os.path.join(root, "mine"))
        out = os.path.join(self.shared, "bench_broken")
        result = run_program("bench", "tum", "--root", root, "--runs", "1", "--detector", "none", "--max-frames", "25", "--out", out,
                             "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("failed: broken/with/1", result.stdout)
        rows = {row["sequence"]: row for row in read_json(out, "tables.json")[0]["rows"]}
        self.assertGreater(float(rows["mine"]["ours with: RMSE"]), 0)
        self.assertEqual(rows["broken"]["ours with: RMSE"], "x")

    def test_a_root_without_sequences_is_an_input_error(self):
        result = run_program("bench", "tum", "--root", self.shared + "/nowhere", "--detector", "none")
        self.assertEqual(result.returncode, 2)
        self.assertIn("nowhere", result.stderr)
        result = run_program("bench", "kitti", "--root", self.root, "--detector", "none")
        self.assertEqual(result.returncode, 2)
        self.assertIn("image_0", result.stderr)

    def test_kitti_on_a_fragment(self):
        root = os.path.join(self.shared, "kitti")
        sequence = os.path.join(root, "sequences", "04")
        os.makedirs(os.path.join(sequence, "image_0"))
        os.makedirs(os.path.join(root, "poses"))
        shutil.copy(os.path.join(self.sequence, "camera.yaml"), sequence)
        images = [line.split() for line in read(self.sequence, "rgb.txt").splitlines() if not line.startswith("#")]
        truth = horn.read_tum(os.path.join(self.sequence, "groundtruth.txt"))
        self.assertEqual(len(truth), len(images))
        with open(os.path.join(sequence, "times.txt"), "w") as times, open(os.path.join(root, "poses", "04.txt"), "w") as poses:
            for i, (image, pose) in enumerate(zip(images, truth)):
                extension = os.path.splitext(image[1])[1]
                shutil.copy(os.path.join(self.sequence, image[1]), os.path.join(sequence, "image_0", f"{i:06}{extension}"))
                times.write(f"{pose[0] - truth[0][0]:.6f}\n")
                columns = [horn.rotate(pose[2], axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))] + [pose[1]]
                poses.write(" ".join(f"{column[row]:.12f}" for row in range(3) for column in columns) + "\n")
        out = os.path.join(self.shared, "bench_kitti")
        result = run_program("bench", "kitti", "--root", root, "--runs", "1", "--detector", "none", "--out", out, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        tables = {table["title"]: {row.get("sequence"): row for row in table["rows"]} for table in read_json(out, "tables.json")}
        row = tables["Table 5: absolute pose error, m"]["04"]
        self.assertEqual(row["Dynamic-SLAM (paper): RMSE"], "1.109")
        self.assertGreater(float(row["ours with: RMSE"]), 0, "two figures, however small it is")
        self.assertGreater(float(row["ours with: Scale"]), 0)
        self.assertIn("Table 7: relative pose error, rotation, deg per m", tables)
        self.assertIn("00: not in", result.stdout)
        self.assertNotIn("01: not in", result.stdout, "the paper leaves it out")
        self.assertIn(" × ", tables["Sequences as run"]["04"]["dimensions, m"])

    def test_profiles(self):
        out = os.path.join(self.shared, "profiles")
        result = run_program("bench", "profiles", self.sequence, "--profiles", "default,g7", "--runs", "1", "--detector", "none",
                             "--max-frames", "30", "--out", out, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        rows = read_json(out, "tables.json")[0]["rows"]
        self.assertEqual([row["profile"] for row in rows], ["default", "g7"])
        g7 = rows[1]
        self.assertEqual((g7["options: features"], g7["options: levels"], g7["options: matching, bits"], g7["options: map points"]),
                         ("200", "2", "30", "30"))
        self.assertEqual((g7["paper: Tracking, s"], g7["paper: RMSE, m"]), ("0.051", "0.026"))
        self.assertEqual(rows[0]["ours: of default"], "100%")
        self.assertTrue(g7["ours: of default"].endswith("%"))
        result = run_program("bench", "profiles", self.sequence, "--profiles", "g9", "--detector", "none")
        self.assertEqual(result.returncode, 2)
        self.assertIn("g7", result.stderr)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
