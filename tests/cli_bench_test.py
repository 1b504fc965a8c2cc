"""`dynamic_slam bench` as a user meets it: rows, pictures and what they say."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import horn

PROGRAM = ""
FRAMES = 60


def run_program(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


def read(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return file.read()


class CliBenchTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.shared)
        cls.room = os.path.join(cls.shared, "room")
        result = run_program("simulate", "room", "--frames", str(FRAMES), "--out", cls.room)
        assert result.returncode == 0, result.stderr

    def bench(self, experiment, *arguments):
        out = os.path.join(self.shared, experiment)
        result = run_program("bench", experiment, *arguments, "--out", out, "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        return out, result.stdout

    def assert_is_picture(self, *path):
        with open(os.path.join(*path), "rb") as file:
            self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")

    def trajectory(self, out, variant, row):
        return horn.read_tum(os.path.join(out, "room", variant, str(row["run"]), "trajectory.txt"))

    def test_ablation_compares_over_common_frames(self):
        boxes = os.path.join(self.shared, "boxes.csv")  # a person in the right half of each image
        stamps = [line.split()[0] for line in read(self.room, "rgb.txt").splitlines() if not line.startswith("#")]
        with open(boxes, "w", encoding="utf-8") as file:
            file.write("timestamp,class,score,x,y,w,h\n")
            file.writelines(f"{stamp},person,0.9,320,0,320,480\n" for stamp in stamps)
        arguments = [self.room, "--max-frames", "30", "--detector", "boxes:" + boxes, "--runs", "2", "--jobs", "2"]
        out, _ = self.bench("ablation", *arguments)
        rows = json.loads(read(out, "ablation_runs.json"))
        self.assertEqual([(row["variant"], row["run"]) for row in rows][:4],
                         [("none", 1), ("none", 2), ("hard boxes", 1), ("hard boxes", 2)])
        made_of = json.loads(read(out, "room", "none", "2", "figures.json"))["made_of"]
        self.assertIn("\nseed: 2\n", made_of["options"])
        none = rows[0]
        self.assertGreater(none["coverage"], 0.7)
        self.assertFalse(none["failed"])
        for row in rows:
            self.assertEqual(row["failed"], row["coverage"] < 0.5 or row["ape_m"] > 0.01 * row["path_m"])
            self.assertEqual(row["common_ape_m"] is None, row["failed"])
        table = {row["variant"]: row for row in json.loads(read(out, "tables.json"))[0]["rows"]}
        self.assertEqual(table["none"]["failed"], "0 of 2")
        truth = horn.read_tum(os.path.join(self.room, "groundtruth.txt"))
        of_none, of_default = ([row for row in rows if row["variant"] == name] for name in ["none", "default"])
        for mine, its in zip(of_none, of_default):
            self.assertEqual(its["common_ape_m"], its["ape_m"])
            common = {pose[0] for pose in self.trajectory(out, "none", mine)}
            common &= {pose[0] for pose in self.trajectory(out, "default", its)}
            for path, row, error in [("none", mine, mine["common_ape_m"]), ("default", its, mine["default_ape_m"])]:
                poses = [pose for pose in self.trajectory(out, path, row) if pose[0] in common]
                pairs, _ = horn.align(horn.match(truth, poses))
                self.assertAlmostEqual(error, horn.rmse(horn.absolute_errors(pairs)), delta=1e-9)
        # Two pairs: the median of their ratios is the mean, and no sign test tells them from chance.
        ratios = [row["common_ape_m"] / row["default_ape_m"] for row in of_none]
        self.assertAlmostEqual(float(table["none"]["APE over the default's: all"]), sum(ratios) / 2, delta=6e-3)
        of_all = sum(row["ape_m"] for row in of_default) / 2
        self.assertAlmostEqual(float(table["default"]["APE over the default's: all"].removesuffix(" m")), of_all,
                               delta=6e-5)
        self.assertAlmostEqual(float(table["none"]["APE over the default's: worst"].removesuffix(" m")),
                               max(row["common_ape_m"] for row in of_none), delta=6e-5)
        # What is done is not done again.
        before = os.path.getmtime(os.path.join(out, "room", "paper", "1", "figures.json"))
        self.bench("ablation", *arguments)
        self.assertEqual(os.path.getmtime(os.path.join(out, "room", "paper", "1", "figures.json")), before)

    def test_boxes_of_another_sequence_are_told(self):
        boxes = os.path.join(self.shared, "others.csv")
        with open(boxes, "w", encoding="utf-8") as file:
            file.write("timestamp,class,score,x,y,w,h\n1e9,person,0.9,320,0,320,480\n")
        result = run_program("bench", "scale", self.room, "--max-frames", "10", "--detector", "boxes:" + boxes, "--out",
                             os.path.join(self.shared, "others"), "--quiet")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn(f"warning: {boxes} has boxes for none of 10 images", result.stderr)

    def test_loops_runs_with_and_without_closing(self):
        # Forward, then the same images backward, so that each place is seen twice.
        again = os.path.join(self.shared, "again")
        os.makedirs(os.path.join(again, "rgb"))
        shutil.copy(os.path.join(self.room, "camera.yaml"), again)
        images = [line.split() for line in read(self.room, "rgb.txt").splitlines() if not line.startswith("#")]
        poses = [line.split(" ", 1)[1] for line in read(self.room, "groundtruth.txt").splitlines() if line[0] != "#"]
        self.assertEqual(len(poses), len(images))
        with open(os.path.join(again, "rgb.txt"), "w") as rgb, open(os.path.join(again, "groundtruth.txt"), "w") as truth:
            for i, (image, pose) in enumerate(zip(images + images[::-1], poses + poses[::-1])):
                rgb.write(f"{i / 10:.6f} {os.path.join(self.room, image[1])}\n")
                truth.write(f"{i / 10:.6f} {pose}\n")
        out, text = self.bench("loops", again, "--apart-s", "3")
        rows = json.loads(read(out, "loops.json"))
        self.assertEqual([row["closing"] for row in rows], ["without", "with"])
        without, closing = rows
        self.assertEqual(without["corrected"] + without["linked"], 0)
        self.assertGreaterEqual(without["places_seen_again"], 1)
        self.assertGreaterEqual(without["recall_at_full_precision"], 0.5)
        self.assertEqual(closing["false_loops"], 0)
        self.assertIn("again", text)
        points = json.loads(read(out, "places.json"))
        self.assertTrue(points)
        self.assertEqual(sorted(points, key=lambda p: -p["min_score"]), points)
        self.assertEqual(max(p["recall"] for p in points if p["precision"] == 1), without["recall_at_full_precision"])
        self.assert_is_picture(out, "places.png")

    def test_scale_gives_a_row_for_each_part_of_the_sequence(self):
        out, text = self.bench("scale", self.room, "--window", "20", "--mapped-at", "0")
        rows = json.loads(read(out, "scale_room.json"))
        self.assertEqual([row["first_frame"] for row in rows], [0, 20, 40])
        self.assertEqual(len(read(out, "scale_room.csv").splitlines()), 4)
        for row in rows:
            self.assertGreater(row["cpu_ms"], 0)
            self.assertGreater(row["rss_mb"], 1)
        self.assertGreater(rows[-1]["keyframes"], 1)
        self.assertEqual(rows[-1]["tracked"], 20)
        self.assertIn("growth after frame 0", text)
        self.assert_is_picture(out, "scale_room.png")

    def test_a_source_that_is_not_there_is_an_input_error(self):
        for experiment in ["ablation", "loops", "scale"]:
            result = run_program("bench", experiment, os.path.join(self.shared, "nowhere"), "--detector", "none")
            self.assertEqual(result.returncode, 2, result.stdout)
            self.assertIn("nowhere", result.stderr)

    def test_wrong_detectors_and_options_are_told_before_the_first_run(self):
        for wrong, named in [(["--detector", "boxes:{source}/none.csv"], os.path.join(self.room, "none.csv")),
                             (["--detector", "none", "--set", "nonsense=1"], "nonsense"),
                             (["--detector", "none", "--camera", "nowhere.yaml"], "nowhere.yaml")]:
            out = os.path.join(self.shared, "wrong")
            result = run_program("bench", "ablation", self.room, *wrong, "--out", out)
            self.assertEqual(result.returncode, 2, result.stdout)
            self.assertIn(named, result.stderr)
            self.assertFalse(os.path.exists(os.path.join(out, "room")))

    def test_recall_counts_before_and_after_compensation(self):
        # Every other image without an answer: half of the boxes are missed, and compensation brings most back.
        scene = os.path.join(self.shared, "walk")
        result = run_program("simulate", "office_walk", "--frames", "12", "--out", scene)
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = read(scene, "boxes.csv").splitlines()
        stamps = sorted({line.split(",")[0] for line in lines[1:]})
        seen = os.path.join(self.shared, "seen.csv")
        with open(seen, "w", encoding="utf-8") as file:
            file.write("\n".join([lines[0]] + [line for line in lines[1:] if line.split(",")[0] in stamps[::2]]) + "\n")
        out, _ = self.bench("recall", scene, "--detector", "boxes:" + seen)
        recall = json.loads(read(out, "recall.json"))
        self.assertEqual(recall["before"]["frames_with_one_found"], 6)
        self.assertEqual(recall["before"]["frames"], 12)
        self.assertGreater(recall["after"]["recall_per_box"], recall["before"]["recall_per_box"])
        rows = [line.split(",") for line in read(out, "recall.csv").splitlines()]
        self.assertEqual(len(rows), 13)
        found = rows[0].index("found_before")
        self.assertEqual([int(row[found]) > 0 for row in rows[1:]], [True, False] * 6)
        self.assert_is_picture(out, "recall.png")

    def test_recall_is_that_of_all_scenes(self):
        out, stdout = self.bench("recall", "office_walk", "--seeds", "2", "--max-frames", "6", "--detector",
                                 "boxes:{source}/boxes.csv")
        recall = json.loads(read(out, "recall.json"))
        self.assertEqual([sequence["sequence"] for sequence in recall["sequences"]], ["seed 1", "seed 2"])
        self.assertEqual(recall["after"]["frames"], sum(s["after"]["frames"] for s in recall["sequences"]))
        self.assertEqual(recall["after"]["recall_per_frame"], 1)
        self.assertEqual(len(read(out, "recall.csv").splitlines()), 13)
        self.assertIn("seed 2, compensated", stdout)

    def test_recall_needs_true_boxes(self):
        result = run_program("bench", "recall", self.room, "--max-frames", "2", "--detector", "none", "--out",
                             os.path.join(self.shared, "none"))
        self.assertEqual(result.returncode, 2, result)
        self.assertIn("boxes.csv", result.stderr)

    def test_interference_counts_keypoints_by_the_true_mask(self):
        out, stdout = self.bench("interference", "--seeds", "1", "--frames", "8", "--detector",
                                 "boxes:{source}/boxes.csv")
        runs = json.loads(read(out, "interference.json"))["runs"]
        self.assertEqual([run["semantics"] for run in runs], [True, False])
        for run in runs:  # people take most of the view, and without a pose nothing is held
            self.assertGreater(run["dynamic_share"], 0.3)
            self.assertLess(run["dynamic_share"], 1)
        rows = [line.split(",") for line in read(out, "interference_frames.csv").splitlines()]
        self.assertEqual(len(rows), 9)
        dynamic, static = rows[0].index("dynamic"), rows[0].index("static")
        for row in rows[1:]:
            self.assertGreater(int(row[dynamic]) + int(row[static]), 200)
        self.assert_is_picture(out, "interference.png")
        self.assertIn("on people", stdout)

    def test_init_tells_a_fixed_camera_from_one_that_sways(self):
        out, _ = self.bench("init", "--repetitions", "1", "--fixed", "1", "--frames", "35", "--detector",
                            "boxes:{source}/boxes.csv")
        init = json.loads(read(out, "init.json"))
        starts = {(start["camera"], start["semantics"]): start for start in init["starts"]}
        self.assertEqual(len(starts), 4)
        self.assertIsNone(starts["fixed", True]["started_s"], "nothing moved but a person")
        self.assertTrue(starts["fixed", True]["good"])
        for semantics in (True, False):
            sway = starts["swaying", semantics]
            self.assertEqual(sway["good"], sway["tracks_at_end"] and sway["ape_share"] <= 0.05)
        self.assertTrue(starts["swaying", False]["tracks_at_end"], "a second of sideways motion is enough")
        self.assertEqual(init["with"], {"good_starts": int(starts["swaying", True]["good"]),
                                        "fixed_without_false_start": 1})
        self.assert_is_picture(out, "init.png")


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
