"""cli_limits_test.py PROGRAM: a machine without space, memory or anybody who reads ends a run with a reason and its results."""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""
MB = 1 << 20


def run_program(*arguments, **options):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=240, **options)


def data_lines(path):
    with open(path) as file:
        return [line for line in file if not line.startswith("#")]


class CliLimitsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.room = os.path.join(cls.folder, "room")
        run_program("simulate", "room", "--frames", "40", "--out", cls.room, check=True)

    def mount(self, options):
        """A file system of its own; skips where we must not make one."""
        disk = tempfile.mkdtemp(dir=self.folder)
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("no right to mount a file system")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        return disk

    def full_disk(self, free_kb):
        disk = self.mount("size=400k")
        with open(os.path.join(disk, "fill"), "wb") as file:
            file.write(bytes(1024 * (400 - free_kb)))
        return disk

    def check_refused(self, result, *parts):
        self.assertEqual(result.returncode, 2, result)
        for part in parts:
            self.assertIn(part, result.stderr)
        self.assertNotIn("bug", result.stderr)

    def test_a_disk_that_becomes_full(self):
        for free_kb, written in ((4, []), (40, ["trajectory.txt"]),
                                 (100, ["trajectory.txt", "map.ply", "summary.json"])):
            with self.subTest(free_kb=free_kb):
                disk = self.full_disk(free_kb)
                out = os.path.join(disk, "out")
                saved = os.path.join(self.folder, f"{free_kb}.map")
                result = run_program("run", self.room, "--quiet", "--out", out, "--save-map", saved)
                self.check_refused(result, out, "No space left", "Choose a folder")
                self.assertIn("frames tracked", result.stdout)
                for name in written:
                    self.assertTrue(os.path.exists(os.path.join(out, name)), name)
                self.assertEqual([name for name in os.listdir(out) if name.endswith(".tmp")], [])
                self.assertEqual(run_program("map", "validate", saved).returncode, 0, "on another disk")
                if "summary.json" in written:
                    continue
                # As the message says.
                self.assertIn(f"dynamic_slam recover {out}", result.stderr)
                os.remove(os.path.join(disk, "fill"))
                self.assertEqual(run_program("recover", out).returncode, 0)
                self.assertTrue(os.path.exists(os.path.join(out, "trajectory.txt")))

    def test_a_map_for_which_there_is_no_space(self):
        saved = os.path.join(self.full_disk(40), "room.map")
        out = os.path.join(self.folder, "map_full")
        result = run_program("run", self.room, "--quiet", "--out", out, "--save-map", saved)
        self.check_refused(result, saved, "No space left", f"the map is not saved: {saved}")
        self.assertFalse(os.path.exists(saved), "half a map")
        for name in ("trajectory.txt", "summary.json", "report.html"):
            self.assertTrue(os.path.exists(os.path.join(out, name)), name)

    def test_what_is_written_beside_the_results_ends_alone(self):
        """A full disk for the pictures, masks or the recording: one warning, all results, and an exit code that says so."""
        first = os.path.basename(data_lines(os.path.join(self.room, "rgb.txt"))[0].split()[1]).replace(".jpg", ".png")
        for option, full in (("--overlay", "000000.jpg"), ("--export-masks", first), ("--record", "recording.view")):
            with self.subTest(option=option):
                out, extra = (os.path.join(self.folder, option + end) for end in ("", "_extra"))
                arguments = ["run", self.room, "--quiet", "--out", out, option]
                limits = {}
                if option == "--record":  # which grows; all other files are smaller
                    limits["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2 * MB, 2 * MB))
                else:
                    arguments.append(extra)
                    os.makedirs(extra)
                    os.symlink("/dev/full", os.path.join(extra, full))
                saved = os.path.join(self.folder, option + ".map")
                result = run_program(*arguments, "--save-map", saved, **limits)
                self.check_refused(result, f"warning: {option} ends here", full)
                self.assertEqual(result.stderr.count("warning"), 1, result.stderr)
                self.assertIn("of 40 frames tracked", result.stdout)
                self.assertIn("results: ", result.stdout)
                for name in ("trajectory.txt", "summary.json", "report.html"):
                    self.assertTrue(os.path.exists(os.path.join(out, name)), name)
                self.assertEqual(run_program("map", "validate", saved).returncode, 0)

    def test_images_for_which_there_is_no_space(self):
        out = os.path.join(self.full_disk(200), "room")
        self.check_refused(run_program("simulate", "room", "--frames", "5", "--out", out), out, "cannot be written")

    def test_a_folder_that_is_read_only(self):
        disk = self.mount("size=40k,ro")
        for reason, *arguments in (
                ["Read-only file system", "run", self.room, "--out", os.path.join(disk, "out")],
                ["Read-only file system", "run", self.room, "--out", os.path.join(self.folder, "ro"), "--save-map",
                 os.path.join(disk, "a.map")],
                ["cannot be written", "simulate", "room", "--frames", "2", "--out", os.path.join(disk, "room")]):
            with self.subTest(arguments=arguments):
                self.check_refused(run_program(*arguments), disk, reason)

    def test_a_reader_who_goes_away(self):
        out = os.path.join(self.folder, "closed")
        reader, writer = os.pipe()
        os.close(reader)
        result = subprocess.run([PROGRAM, "run", self.room, "--out", out], stdout=writer, stderr=writer, timeout=240)
        os.close(writer)
        self.assertEqual(result.returncode, 2)
        self.assertEqual(len(data_lines(os.path.join(out, "trajectory.txt"))), 40)
        self.assertTrue(os.path.exists(os.path.join(out, "report.html")))

    def test_an_output_without_space(self):
        with open("/dev/full", "w") as full:
            for arguments in (["config", "--markdown"], ["map", "info", self.make_map()]):
                with self.subTest(arguments=arguments):
                    result = subprocess.run([PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True)
                    self.check_refused(result, "standard output", "No space left")

    def make_map(self):
        saved = os.path.join(self.folder, "some.map")
        run_program("run", self.room, "--quiet", "--out", os.path.join(self.folder, "some"), "--save-map", saved,
                    check=True)
        return saved

    def run_within(self, limit_mb, *arguments):
        return run_program("run", self.room, "--quiet", *arguments,
                           preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit_mb * MB, limit_mb * MB)))

    def test_memory_that_runs_out(self):
        # What the program needs before the first map.
        low, high = 0, 4000
        while high - low > 2:
            middle = (low + high) // 2
            start = self.run_within(middle, "--max-frames", "2", "--out", os.path.join(self.folder, "start"))
            low, high = (low, middle) if start.returncode == 0 else (middle, high)
        out = os.path.join(self.folder, "memory")
        ends = []
        for more_mb in (2, 6, 10):
            result = self.run_within(high + more_mb, "--out", out)
            ends.append(result.returncode)
            if result.returncode == 0:
                continue
            self.check_refused(result, "memory")
            for name in ("trajectory.txt", "frames.csv", "summary.json"):
                self.assertTrue(os.path.exists(os.path.join(out, name)), name)
        self.assertIn(2, ends, "there was enough")


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
