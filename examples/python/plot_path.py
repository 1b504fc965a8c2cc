#!/usr/bin/python3
"""Follows the camera through a sequence and plots its path over the map, from above the first image.

Usage: plot_path.py SOURCE PICTURE.png [CAMERA] [DETECTOR]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import dynamic_slam


def main(path, picture, camera=None, detector="builtin"):
    source = dynamic_slam.open_source(path)
    slam = dynamic_slam.System(dynamic_slam.load_camera(camera) if camera else source.camera, detector=detector)
    states = [slam.process(timestamp, image).state for timestamp, image, name in source]
    slam.finish()

    poses = slam.poses()
    figure, axes = plt.subplots(figsize=(8, 8))
    for part in slam.map().parts[:1]:
        axes.plot(part.landmarks[:, 0], part.landmarks[:, 2], ".", color="0.7", markersize=1, label="landmarks")
    axes.plot(poses[:, 1], poses[:, 3], color="tab:red", label="camera")
    axes.set(xlabel="to the right", ylabel="forward", title=f"{len(poses)} of {len(states)} images with a pose")
    axes.set_aspect("equal")
    axes.legend()
    figure.savefig(picture)
    print(f"{len(poses)} of {len(states)} images have a pose: {picture}")


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
