"""cli_soak_test.py PROGRAM [FRAMES]: a car goes round a block for half an hour of its time, as fast as it can be computed.

The street is rendered once; its images come again with new stamps. Once the place is known, memory grows by little, the
map does not, and it is valid whenever it is looked at. What a frame costs is printed, as no test asserts times.
"""

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = ""
FRAMES, FPS = 18000, 10
KNOWN_AFTER_ROUNDS = 6
MOST_MB_PER_10_MINUTES = 1
CAMERA = "model: pinhole\nwidth: 320\nheight: 240\nfps: 10\nfx: 260\nfy: 260\ncx: 159.5\ncy: 119.5\n"


def run_program(*arguments):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


def rows(path):
    with open(path) as file:
        return [line.split() for line in file if not line.startswith("#")]


def slope(points):
    """Of the line through (x, y) with the least squared errors."""
    mean_x, mean_y = (sum(p[i] for p in points) / len(points) for i in (0, 1))
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)


class Rounds:
    """The street again and again: the camera and rgb.txt of a sequence, and boxes for it."""

    def __init__(self, folder, once, frames):
        self.folder = folder
        os.makedirs(folder)
        shutil.copy(os.path.join(once, "camera.yaml"), folder)
        images, poses = rows(os.path.join(once, "rgb.txt")), rows(os.path.join(once, "groundtruth.txt"))
        start = [float(v) for v in poses[0][1:4]]
        # From this frame on it is where it began.
        self.length = min(range(len(images) // 2, len(images)),
                          key=lambda i: math.dist(start, [float(v) for v in poses[i][1:4]]))
        with open(os.path.join(once, "boxes.csv")) as file:
            header, *boxes = file.read().splitlines()
        boxes_of = {}
        for box in boxes:
            stamp, rest = box.split(",", 1)
            boxes_of.setdefault(round(float(stamp), 3), []).append(rest)
        self.boxes = folder + "_boxes.csv"  # not beside the images, where they would be the truth to compare with
        with open(os.path.join(folder, "rgb.txt"), "w") as rgb, open(self.boxes, "w") as of_all:
            of_all.write(header + "\n")
            for i in range(frames):
                stamp, image = images[i % self.length]
                rgb.write(f"{i / FPS:.6f} {os.path.join(once, image)}\n")
                for rest in boxes_of.get(round(float(stamp), 3), []):
                    of_all.write(f"{i / FPS:.6f},{rest}\n")


class Watch:
    """What a run that goes on has done, and what it holds."""

    def __init__(self, process, journal):
        self.stat = f"/proc/{process.pid}/stat"
        self.status = f"/proc/{process.pid}/status"
        self.journal = journal
        self.frames = -1  # the header is no frame
        self.at = 0

    def look(self):
        """Frames, MB, seconds of processor time; None when it has ended, or has not begun."""
        try:
            with open(self.journal, "rb") as file:
                file.seek(self.at)
                new = file.read()
            self.at += len(new)
            self.frames += new.count(b"\n")
            with open(self.status) as file:
                mb = next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmRSS"))
            with open(self.stat) as file:
                fields = file.read().rsplit(")", 1)[1].split()
            return self.frames, mb, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        except (OSError, StopIteration):
            return None


class CliSoakTest(unittest.TestCase):
    def test_half_an_hour_in_a_known_place(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        once, out, saved = (os.path.join(folder, name) for name in ("once", "out", "map"))
        camera = os.path.join(folder, "small.yaml")
        with open(camera, "w") as file:
            file.write(CAMERA)
        run_program("simulate", "street_short", "--camera", camera, "--out", once)
        film = Rounds(os.path.join(folder, "rounds"), once, FRAMES)
        looks, maps, seen = [], [], None
        command = [PROGRAM, "run", film.folder, "--quiet", "--detector", "boxes:" + film.boxes, "--out", out, "--save-map",
                   saved, "--save-map-every", "0.5"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
            watch = Watch(process, os.path.join(out, "journal.csv"))
            while process.poll() is None:
                look = watch.look()
                if look is not None and (not looks or look[0] > looks[-1][0]):
                    looks.append(look)
                if os.path.exists(saved) and os.stat(saved).st_mtime_ns != seen:
                    seen = os.stat(saved).st_mtime_ns
                    maps.append((watch.frames, run_program("map", "validate", saved).strip().split(": ", 1)[1]))
                time.sleep(1)
            self.assertEqual(process.returncode, 0, process.stdout.read())
        maps.append((FRAMES, run_program("map", "validate", saved).strip().split(": ", 1)[1]))
        with open(os.path.join(out, "frames.csv")) as file:
            header, *lines = file.read().splitlines()
        state = header.split(",").index("state")
        states = [line.split(",")[state] for line in lines]
        self.assertEqual(len(states), FRAMES)
        # After the last frame the results are made.
        begin = KNOWN_AFTER_ROUNDS * film.length
        known = [look for look in looks if begin <= look[0] < FRAMES]
        tracked = states[begin:].count("tracking") / (FRAMES - begin)
        grown = slope([(frames, mb) for frames, mb, _ in known]) * FPS * 600
        print(f"{film.length} frames a round; from round {KNOWN_AFTER_ROUNDS} on {100 * tracked:.1f} % tracked, memory "
              f"{grown:+.2f} MB in 10 minutes")
        for frames, text in maps[::max(1, len(maps) // 8)]:
            print(f"{frames:6} {text}")
        print("frames      MB  CPU, ms a frame")
        steps = known[::max(1, len(known) // 12)]
        for before, after in zip(steps, steps[1:]):
            print(f"{after[0]:6} {after[1]:7.1f} {1e3 * (after[2] - before[2]) / (after[0] - before[0]):7.1f}")
        self.assertGreater(tracked, 0.9)
        self.assertLessEqual(grown, MOST_MB_PER_10_MINUTES)


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    if len(sys.argv) > 1 and sys.argv[1].isdigit():
        FRAMES = int(sys.argv.pop(1))
    unittest.main()
