"""cli_faults_test.py PROGRAM [--matrix]: a camera that fails, as `run --inject` makes one, never ends a run or its results.

With --matrix more kills, and every fault in both modes: while the map is started, while it is tracked, while it is lost,
while a loop is closed, and until the end.
"""

import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = ""
MATRIX = False

FRAMES, FPS = 150, 30
FAULTS = ["drop", "black", "blur", "exposure", "freeze", "resize", "stamp", "swap"]
SKIPPED = ["drop", "resize", "stamp", "swap"]  # the others still show an image
RECOVERY_S = 2
JOURNAL_STAMP = 9  # the column of time stamps in the journal


def read_lines(path):
    with open(path) as file:
        return file.read().splitlines()


class Run:
    def __init__(self, folder, name, sequence, faults, *arguments):
        self.out = os.path.join(folder, name)
        self.map = self.out + ".map"
        self.result = subprocess.run([PROGRAM, "run", sequence, "--quiet", "--inject", faults, "--save-map", self.map,
                                      "--out", self.out, *arguments], capture_output=True, text=True, timeout=240)
        with open(os.path.join(self.out, "summary.json")) as file:
            self.summary = json.load(file)
        with open(os.path.join(self.out, "frames.csv")) as file:
            self.frames = list(csv.DictReader(file))
        with open(os.path.join(self.out, "trajectory.txt")) as file:
            self.trajectory = file.read()


class CliFaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.room = os.path.join(cls.folder, "room")
        subprocess.run([PROGRAM, "simulate", "room", "--frames", str(FRAMES), "--out", cls.room], check=True,
                       capture_output=True)

    def check(self, name, faults, end_s, *arguments, film=None, length_s=FRAMES / FPS):
        """A run ends well, with results and a valid map; soon after the faults it tracks, or says why not."""
        run = Run(self.folder, name, film or self.room, faults, *arguments)
        self.assertEqual(run.result.returncode, 0, run.result.stderr)
        self.assertGreater(len(run.frames), 0)
        start_s = float(run.frames[0]["timestamp"])
        for frame in run.frames:
            self.assertIn(frame["state"], ("initialising", "tracking", "lost"))
            if frame["state"] != "tracking":
                self.assertTrue(frame["reason"], frame)
        if end_s + RECOVERY_S < length_s:
            after = [f for f in run.frames if end_s <= float(f["timestamp"]) - start_s <= end_s + RECOVERY_S]
            self.assertTrue(any(f["state"] == "tracking" for f in after), after[-1])
        self.assertNotIn("nan", run.trajectory)
        valid = subprocess.run([PROGRAM, "map", "validate", run.map], capture_output=True, text=True)
        self.assertEqual(valid.returncode, 0, valid.stderr)
        return run

    def test_all_at_once_and_the_same_twice(self):
        faults = ",".join(f"{fault}=0.02" for fault in FAULTS)
        first, second = (self.check(name, faults, FRAMES / FPS) for name in ("once", "twice"))
        self.assertEqual(first.trajectory, second.trajectory)
        self.assertLess(len(first.frames), FRAMES)
        self.assertGreater(first.summary["coverage"], 0.8)
        self.assertIn("fault injection", first.result.stderr + first.result.stdout)

    def test_a_camera_that_stops(self):
        run = self.check("stops", "drop=1,from=1.5,to=2.5", 2.5)
        self.assertEqual(len(run.frames), FRAMES - FPS)

    def test_black_in_real_time(self):
        self.check("black", "black=1,from=1.5,to=2", 2, "--mode", "realtime")

    def kill_after(self, name, after_s):
        """A run in real time until it has seen so much: its results, map and masks, as the kill left them."""
        out, saved, masks = (os.path.join(self.folder, name + end) for end in ("", ".map", "_masks"))
        journal = os.path.join(out, "journal.csv")

        def seen_s():
            rows = read_lines(journal)[1:-1] if os.path.exists(journal) else []  # the last may be half a line
            stamps = [float(row.split(",")[JOURNAL_STAMP]) for row in rows]
            return stamps[-1] - stamps[0] if stamps else -1

        for _ in range(3):  # on a busy machine the run may end before we look
            run = subprocess.Popen([PROGRAM, "run", self.room, "--quiet", "--mode", "realtime", "--out", out, "--save-map",
                                    saved, "--save-map-every", "0.01", "--export-masks", masks], stdout=subprocess.DEVNULL)
            deadline = time.monotonic() + 60
            while run.poll() is None and seen_s() < after_s:
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.01)
            run.kill()
            if run.wait() == -signal.SIGKILL:
                return out, saved, masks
        self.fail("the run always ended before it was killed")

    def test_killed_at_any_moment(self):
        """All that was seen is there: what a frame leaves besides the journal comes after its line there."""
        for i in range(50 if MATRIX else 5):
            after_s = random.Random(i).uniform(0.1, FRAMES / FPS - 1)
            with self.subTest(after_s=after_s):
                out, saved, masks = self.kill_after(f"killed_{i}", after_s)
                self.assertFalse(os.path.exists(os.path.join(out, "summary.json")))
                result = subprocess.run([PROGRAM, "recover", out], capture_output=True, text=True)
                self.assertEqual(result.returncode, 0, result.stderr)
                with open(os.path.join(out, "frames.csv")) as file:
                    stamps = {round(float(frame["timestamp"]), 5) for frame in csv.DictReader(file)}
                self.assertGreaterEqual(max(stamps) - min(stamps), after_s - 1e-4)
                finished = {round(float(mask.removesuffix(".png")), 5) for mask in os.listdir(masks)}
                self.assertTrue(finished)
                self.assertLessEqual(finished, stamps)
                poses = [[float(v) for v in line.split()] for line in read_lines(os.path.join(out, "trajectory.txt"))
                         if not line.startswith("#")]
                self.assertTrue(all(len(pose) == 8 for pose in poses))
                self.assertLessEqual({round(pose[0], 5) for pose in poses}, stamps)
                if after_s > 2:
                    self.assertGreater(len(poses), 0)
                    valid = subprocess.run([PROGRAM, "map", "validate", saved], capture_output=True, text=True)
                    self.assertEqual(valid.returncode, 0, valid.stderr)

    def test_a_killed_run_that_is_started_again(self):
        out, _, _ = self.kill_after("again", 1)
        again = subprocess.run([PROGRAM, "run", self.room, "--quiet", "--out", out], capture_output=True, text=True)
        self.assertEqual(again.returncode, 0, again.stderr)
        kept = os.path.join(out, "journal.1.csv")
        self.assertIn(f"dynamic_slam recover {kept}", again.stderr)
        finished = read_lines(os.path.join(out, "frames.csv"))
        recovered = subprocess.run([PROGRAM, "recover", kept], capture_output=True, text=True)
        self.assertEqual(recovered.returncode, 0, recovered.stderr)
        self.assertGreater(len(read_lines(os.path.join(out, "journal.1", "frames.csv"))), 2)
        self.assertEqual(read_lines(os.path.join(out, "frames.csv")), finished, "they are of the second run")

    def test_nothing_to_recover(self):
        run = self.check("whole", "drop=0", FRAMES / FPS)
        self.assertFalse(os.path.exists(os.path.join(run.out, "journal.csv")))
        result = subprocess.run([PROGRAM, "recover", run.out], capture_output=True, text=True)
        self.assertEqual(result.returncode, 2, result)
        self.assertIn("is not there", result.stderr)

    def test_what_is_no_fault(self):
        result = subprocess.run([PROGRAM, "run", self.room, "--inject", "dorp=0.1"], capture_output=True, text=True)
        self.assertEqual(result.returncode, 2, result)
        self.assertIn("drop", result.stderr)

    def check_all_faults(self, moment, window, end_s, **film):
        for mode in ("offline", "realtime"):
            for fault in FAULTS:
                with self.subTest(mode=mode, moment=moment, fault=fault):
                    run = self.check(f"{mode}_{moment}_{fault}", f"{fault}=1,{window}", end_s, "--mode", mode, **film)
                    if fault not in SKIPPED and mode == "offline" and not film:
                        self.assertEqual(len(run.frames), FRAMES)

    def needs_matrix(self):
        if not MATRIX:
            self.skipTest("with --matrix")

    def test_matrix(self):
        self.needs_matrix()
        self.check_all_faults("start", "from=0,to=1", 1)
        self.check_all_faults("tracking", "from=1.5,to=2.5", 2.5)
        self.check_all_faults("end", "from=4", FRAMES / FPS)

    def test_matrix_while_lost(self):
        """The camera shows another place for a second; the faults begin in its midst and end after it."""
        self.needs_matrix()
        film = os.path.join(self.folder, "cut")
        shutil.copytree(self.room, film)
        other = os.path.join(self.folder, "other")
        subprocess.run([PROGRAM, "simulate", "room", "--seed", "7", "--frames", str(FPS), "--out", other], check=True,
                       capture_output=True)
        begin = int(1.5 * FPS)
        names = sorted(os.listdir(os.path.join(film, "rgb")), key=lambda name: float(name.removesuffix(".jpg")))
        for name, replacement in zip(names[begin:], sorted(os.listdir(os.path.join(other, "rgb")))):
            shutil.copy(os.path.join(other, "rgb", replacement), os.path.join(film, "rgb", name))
        without = self.check("cut_without", "drop=0", 2.5, film=film)
        self.assertEqual(without.frames[begin + FPS // 3]["state"], "lost")
        self.check_all_faults("lost", "from=1.8,to=2.8", 2.8, film=film)

    def test_matrix_while_a_loop_is_closed(self):
        self.needs_matrix()
        film = {"film": os.path.join(self.folder, "corridor"), "length_s": 50}
        subprocess.run([PROGRAM, "simulate", "corridor", "--out", film["film"]], check=True, capture_output=True)
        without = self.check("corridor_without", "drop=0", film["length_s"], **film)
        with open(os.path.join(without.out, "loops.csv")) as file:
            closed = [row for row in csv.DictReader(file) if not row["refused"]]
        self.assertTrue(closed)
        closed_s = float(max(closed, key=lambda row: float(row["drift_px"]))["timestamp"])
        self.check_all_faults("loop", f"from={closed_s - 0.5},to={closed_s + 0.5}", closed_s + 0.5, **film)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    if "--matrix" in sys.argv:
        sys.argv.remove("--matrix")
        MATRIX = True
    unittest.main(verbosity=2)
