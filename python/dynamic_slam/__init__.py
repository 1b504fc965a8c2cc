"""Dynamic-SLAM: the path of one camera among people and cars, and a map of what stands still.

    import dynamic_slam

    slam = dynamic_slam.System(dynamic_slam.load_camera("tum_fr1"), detector="builtin")
    for timestamp, image, name in dynamic_slam.open_source("rgbd_dataset_freiburg1_desk"):
        result = slam.process(timestamp, image)
    slam.finish()
    dynamic_slam.write_trajectory("trajectory.txt", slam.poses())

Trajectories are arrays of shape (n, 8), one pose world_from_cam in each row, as TUM's files have them: timestamp (s),
position x y z, unit quaternion x y z w. Images are arrays of shape (height, width), or (height, width, 3) in the order
blue, green, red, of uint8 or uint16. What is given wrongly raises an InputError, which is a ValueError, or a TypeError.
"""

from ._core import (Camera, Errors, ImageObject, ImageResult, InputError, Map, MapPart, Source, Statistics, System,
                    evaluate, export_map, known_cameras, load_camera, open_source, read_map, read_trajectory,
                    write_trajectory)

__all__ = ["Camera", "Errors", "ImageObject", "ImageResult", "InputError", "Map", "MapPart", "Source", "Statistics",
           "System", "evaluate", "export_map", "known_cameras", "load_camera", "open_source", "read_map",
           "read_trajectory", "write_trajectory"]
