"""`dynamic_slam eval` as a user meets it: known answers, tables, messages and exit codes."""

import json
import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""
DATA = os.environ.get("DYNAMIC_SLAM_DATA")

# command, {path in the JSON: value}; the values are evo's
KNOWN_ANSWERS = [
    ("ape KITTI_00_gt.txt KITTI_00_ORB.txt --format kitti --align se3",
     {"n": 4541, "rmse": 1.3034497145650266, "mean": 1.1569971285389768, "median": 1.065624769555848,
      "std": 0.6002822693968323, "scale": 1}),
    ("ape KITTI_00_gt.txt KITTI_00_SPTAM.txt --format kitti --align se3",
     {"rmse": 3.738487907582613, "mean": 3.4909766330848684, "median": 3.6425846417432637}),
    ("rpe KITTI_00_gt.txt KITTI_00_ORB.txt --format kitti --align none",
     {"n": 4540, "translation.rmse": 0.028120377017393464, "translation.std": 0.020450305572286376,
      "rotation.rmse": 0.11497352089152525, "rotation.median": 0.04107440667799087}),
    ("rpe KITTI_00_gt.txt KITTI_00_ORB.txt --format kitti --align none --delta 100 --delta-unit m",
     {"n": 35, "translation.rmse": 1.1027416411758488, "translation.median": 0.8951799347568006,
      "rotation.mean": 0.595168811238703, "rotation.std": 0.3509535099621885}),
    ("ape fr2_desk_groundtruth.txt fr2_desk_ORB_kf_mono.txt",
     {"n": 118, "scale": 2.2280217535893287, "rmse": 0.007729264783424089, "std": 0.0030463378840978475}),
    ("rpe fr2_desk_groundtruth.txt fr2_desk_ORB_kf_mono.txt",
     {"n": 117, "translation.rmse": 0.007069324681400399, "rotation.rmse": 0.38709138324990994}),
    ("ape freiburg1_xyz-groundtruth.txt freiburg1_xyz-ORB_kf_mono.txt --align sim3 --max-dt 0.01",
     {"n": 32, "scale": 1.1056223637370346, "rmse": 0.009754581898685104, "median": 0.007909070259951205}),
    ("rpe freiburg1_xyz-groundtruth.txt freiburg1_xyz-ORB_kf_mono.txt --align sim3",
     {"n": 31, "rmse": 0.013834917845973996, "std": 0.0067825475920548}),
    ("ape fr2_desk_groundtruth.txt fr2_desk_ORB.txt",
     {"n": 2174, "scale": 0.9969698308032563, "rmse": 0.006123163030157227, "mean": 0.005586197318706093}),
    ("rpe fr2_desk_groundtruth.txt fr2_desk_ORB.txt --delta 1 --delta-unit frames",
     {"n": 2173, "rmse": 0.003485016890888194, "median": 0.0027455208712606595}),
]

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 2, 1)]


def tum(positions, stamps=None):
    stamps = stamps or range(len(positions))
    return "".join(f"{t} {x} {y} {z} 0 0 0 1\n" for t, (x, y, z) in zip(stamps, positions))


def kitti(positions):
    return "".join(f"1 0 0 {x} 0 1 0 {y} 0 0 1 {z}\n" for x, y, z in positions)


class CliEvalTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def write(self, name, text):
        with open(os.path.join(self.folder, name), "w") as file:
            file.write(text)

    def run_program(self, *arguments, cwd=None):
        return subprocess.run([PROGRAM, *arguments], cwd=cwd or self.folder, capture_output=True, text=True)

    def evaluate(self, command, cwd=None):
        result = self.run_program("eval", *command.split(), "--json", cwd=cwd)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")
        return json.loads(result.stdout)

    def assert_input_error(self, command, *parts):
        result = self.run_program("eval", *command.split())
        self.assertEqual(result.returncode, 2, result)
        self.assertEqual(result.stdout, "")
        for part in parts:
            self.assertIn(part, result.stderr)

    @unittest.skipUnless(DATA, "DYNAMIC_SLAM_DATA is not set")
    def test_known_answers(self):
        for command, answers in KNOWN_ANSWERS:
            found = self.evaluate(command, cwd=os.path.join(DATA, "trajectories"))
            for path, expected in answers.items():
                value = found
                for key in path.split("."):
                    value = value[key]
                self.assertAlmostEqual(value, expected, delta=1e-9 * expected, msg=f"{command}: {path}")

    def test_json_holds_every_number(self):
        self.write("a.txt", tum(SQUARE))
        for metric in ("ape", "rpe"):
            found = self.evaluate(f"{metric} a.txt a.txt")
            for part in (found, found["translation"], found["rotation"]):
                for key in ("rmse", "mean", "median", "std", "min", "max", "sse", "n"):
                    self.assertIn(key, part)
            self.assertAlmostEqual(found["scale"], 1)

    def test_table(self):
        self.write("a.txt", tum(SQUARE))
        self.write("b.txt", tum([(x + 3, y, z + 4) for x, y, z in SQUARE]))
        result = self.run_program("eval", "ape", "a.txt", "b.txt", "--align", "none")
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stdout, r"rmse +5\.000000 +0\.000000")
        self.assertIn("5 of 5 estimated and 5 true poses matched", result.stdout)

    def test_kitti_truth_with_times_judges_an_estimate_with_gaps(self):
        self.write("poses.txt", kitti(SQUARE))
        self.write("times.txt", "0\n0.1\n0.2\n0.3\n0.4\n")
        self.write("est.txt", tum([SQUARE[i] for i in (1, 2, 3, 4)], [0.1, 0.2, 0.3, 0.4]))
        found = self.evaluate("ape poses.txt est.txt --format kitti --times times.txt --align none")
        self.assertEqual((found["n"], found["rmse"]), (4, 0))

    def test_input_errors_name_the_thing_and_exit_with_2(self):
        self.write("a.txt", tum(SQUARE))
        self.write("late.txt", tum(SQUARE, [100, 101, 102, 103, 104]))
        self.write("line.txt", tum([(i, 0, 0) for i in range(5)]))
        self.write("broken.txt", "0 1 2\n")
        self.write("k5.txt", kitti(SQUARE))
        self.write("k4.txt", kitti(SQUARE[:4]))
        self.write("times4.txt", "0\n1\n2\n3\n")
        self.assert_input_error("ape a.txt missing.txt", "missing.txt")
        self.assert_input_error("ape a.txt broken.txt", "broken.txt:1", "3 columns, 8 are wanted")
        self.assert_input_error("ape a.txt late.txt", "no two poses within", "--max-dt")
        self.assert_input_error("ape a.txt line.txt", "on one line", "--align none")
        self.assert_input_error("ape k5.txt k4.txt --format kitti", "5 rows", "4")
        self.assert_input_error("ape k5.txt a.txt --format kitti --times times4.txt", "4 stamps for 5 poses")
        self.assert_input_error("ape a.txt a.txt --times times4.txt", "--format kitti only")
        self.assert_input_error("rpe a.txt a.txt --delta 9", "no two of the 5 matched poses")
        self.assert_input_error("rpe a.txt a.txt --delta 0.5", "not a whole number")

    def test_usage_errors_exit_with_2(self):
        self.write("a.txt", tum(SQUARE))
        self.assert_input_error("ape a.txt", "EST is required")
        self.assert_input_error("xyz a.txt a.txt", "METRIC")
        self.assert_input_error("ape a.txt a.txt --align sim2", "--align")
        self.assert_input_error("ape a.txt a.txt --max-dt -1", "--max-dt")
        self.assert_input_error("ape a.txt a.txt --colour", "--colour")
        self.assertEqual(self.run_program().returncode, 2)
        self.assertEqual(self.run_program("evil").returncode, 2)

    def test_help_and_version(self):
        version = self.run_program("--version")
        self.assertEqual(version.returncode, 0)
        self.assertRegex(version.stdout, r"^dynamic_slam \d+\.\d+\.\d+$")
        self.assertIn("eval", self.run_program("--help").stdout)
        text = self.run_program("eval", "--help").stdout
        for option in ("--format", "--times", "--align", "--max-dt", "--delta", "--delta-unit", "--json"):
            self.assertIn(option, text)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
