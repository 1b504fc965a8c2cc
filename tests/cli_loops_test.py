"""cli_loops_test.py PROGRAM SCENE SEEDS [KEY=VALUE...]: loops of a simulated scene are found, and only those.

Renders the scene with seeds 1 to SEEDS, runs it with and without closing loops, with the simulator's boxes.
"""

import json
import os
import subprocess
import sys
import tempfile


def run(*command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{' '.join(command)}: {result.returncode}\n{result.stderr}")


def check(program, folder, scene, seed, settings):
    name = f"{scene}{seed}"
    sequence, out = os.path.join(folder, name), os.path.join(folder, name + "_loops")
    run(program, "simulate", scene, "--seed", str(seed), "--out", sequence,
        *(argument for setting in settings for argument in ("--set", setting)))
    run(program, "bench", "loops", sequence, "--detector", "boxes:{source}/boxes.csv", "--out", out, "--quiet")
    with open(os.path.join(out, "loops.json")) as file:
        without, closing = json.load(file)
    print(f"{name}: coverage {closing['coverage']:.3f}, APE {100 * without['ape_m'] / without['path_m']:.2f}% of "
          f"{closing['path_m']:.0f} m without, {100 * closing['ape_m'] / closing['path_m']:.2f}% with closing; "
          f"{closing['corrected']} corrected, {closing['linked']} linked, {closing['false_loops']} false", flush=True)
    return (closing["corrected"] + closing["linked"] >= 1 and closing["false_loops"] == 0 and
            closing["coverage"] >= 0.9 and closing["ape_m"] <= 0.01 * closing["path_m"])


def main():
    program, scene, seeds, *settings = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        passed = [check(os.path.abspath(program), folder, scene, seed, settings) for seed in range(1, int(seeds) + 1)]
    sys.exit(0 if all(passed) else "no loop, a false one, or an error above 1% of the path")


main()
