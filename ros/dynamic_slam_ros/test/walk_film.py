"""People who walk in an office, rendered: as a folder and as a bag."""

import os
import subprocess


def run(program, *arguments):
    """What the program says; it must succeed."""
    result = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, f"{program} {arguments}: {result.stderr}"
    return result.stdout


def make(program, build, folder, frames):
    """The paths of both, in the folder; `build` has the ROS programs."""
    sequence, bag = os.path.join(folder, "walk"), os.path.join(folder, "walk.bag")
    run(program, "simulate", "office_walk", "--frames", str(frames), "--out", sequence)
    run(os.path.join(build, "make_bag"), sequence, bag)
    return sequence, bag
