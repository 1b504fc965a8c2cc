"""What the built-in detector learns from: rendered scenes, and how each image is varied before it is shown.

Everything is drawn from seeds, so that the same repository gives the same images and the same variations.
"""

import csv
import json
import pathlib
import subprocess
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import torch

CLASSES = ["person", "car", "chair", "tv", "potted plant"]  # labels 1 to 5; 0 is background
INPUT = (384, 256)  # width, height, px
RENDERED = (400, 300)
FRAMES_PER_SCENE = 8
SURE_VISIBLE = 0.25  # objects that are seen less are neither object nor background,
SURE_SHARE, SURE_VISIBLE_NEAR = 0.06, 0.12  # but for those that fill so much of the image; then this much will do
MIN_HEIGHT_PX = 9  # those that are smaller, in the network's input, are not either
WEBP_QUALITY = 60  # of the images that are kept; each is varied anyway
SCENES_PER_PACK = 50


def scene(seed):
    """A scene file and its camera file, as YAML: another place, other people and another camera for each seed."""
    rng = np.random.default_rng(seed)
    kind = rng.choice(["office", "crowd", "corridor", "street"], p=[0.36, 0.28, 0.12, 0.24])
    size, motion, people, extra = (60, 50), "path", int(rng.integers(4, 36)), {}
    fps, height, speed, richness = rng.uniform(0.3, 0.8), rng.uniform(0.7, 2.0), 1.0, rng.uniform(0.3, 2.0)
    if kind in ("office", "crowd"):
        size = (rng.uniform(5.5, 12), rng.uniform(5.5, 9))
        motion = str(rng.choice(["hand_held", "xyz", "rpy", "halfsphere", "static"]))
        people = int(rng.integers(3, 17)) if kind == "crowd" else int(rng.integers(0, 7))
        extra["near_camera"] = bool(kind == "crowd")
        if kind == "crowd" and rng.random() < 0.15:
            people, extra = int(rng.integers(1, 4)), {"towards_camera": True}
    elif kind == "corridor":
        size, people = (rng.uniform(8, 20), rng.uniform(7, 14)), int(rng.integers(1, 12))
    else:
        size = (rng.uniform(50, 110), rng.uniform(45, 80))
        fps, height, speed = rng.uniform(0.8, 1.4), rng.uniform(1.2, 2.2), 8.0
        people = int(rng.integers(8, 70))
    width, rows = RENDERED
    focal = width * rng.uniform(0.65, 1.15)
    camera = {"model": "pinhole", "width": width, "height": rows, "fps": 30, "fx": focal, "fy": focal,
              "cx": width / 2, "cy": rows / 2, "k1": rng.uniform(-0.12, 0.12)}
    options = {
        "seed": seed, "frames": FRAMES_PER_SCENE,
        "world": {"kind": "office" if kind == "crowd" else str(kind), "length_m": float(size[0]),
                  "width_m": float(size[1]), "richness": float(richness)},
        "people": {"count": people, "speed_m_per_s": float(rng.uniform(0.5, 1.6)), **extra},
        "cars": {"moving": int(rng.integers(3, 16)), "parked_share": float(rng.uniform(0.1, 0.9))},
        "camera": {"model": "camera.yaml", "motion": motion, "fps": float(fps), "height_m": float(height),
                   "speed_m_per_s": speed, "amplitude": float(rng.uniform(0.5, 2.0))},
        "effects": {"noise_grey": float(rng.uniform(0, 4)), "exposure_ms": float(rng.choice([0, 6, 15])),
                    "exposure_change": float(rng.uniform(0, 0.4)), "vignette": float(rng.uniform(0, 0.3)),
                    "jpeg_quality": int(rng.integers(75, 93))},
    }
    return json.dumps(options), json.dumps(camera)  # JSON is YAML


def render(program, folder, seeds, jobs):
    """Renders the scenes that are not there yet, and returns their folders."""
    def one(seed):
        out = folder / f"{seed}"
        if not (out / "rgb.txt").exists():
            source = folder / f"scene_{seed}"
            source.mkdir(parents=True, exist_ok=True)
            options, camera = scene(seed)
            (source / "camera.yaml").write_text(camera)
            (source / "scene.yaml").write_text(options.replace('"camera.yaml"', f'"{source / "camera.yaml"}"'))
            subprocess.run([program, "simulate", source / "scene.yaml", "--out", out],
                           check=True, stdout=subprocess.DEVNULL)
        return out

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, seeds))


def read_scene(folder):
    """The frames of a scene as (image, mask of what moves, boxes), the first two as bytes of WebP and PNG files.

    Boxes are rows of label, x, y, w, h, visible, moves.
    """
    boxes, frames = {}, []
    with open(folder / "boxes.csv", newline="") as file:
        for row in csv.DictReader(file):
            numbers = [float(row[key]) for key in ("x", "y", "w", "h", "visible", "moving")]
            boxes.setdefault(row["timestamp"], []).append([CLASSES.index(row["class"]) + 1, *numbers])
    for line in (folder / "rgb.txt").read_text().splitlines():
        if line.startswith("#"):
            continue
        stamp, name = line.split()
        image = cv2.imencode(".webp", cv2.imread(str(folder / name)), [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])[1]
        mask = np.fromfile(folder / "masks" / (pathlib.Path(name).stem + ".png"), np.uint8)
        frames.append((image.ravel(), mask, np.array(boxes.get(stamp, []), np.float32).reshape(-1, 7)))
    return frames


def packed_scenes(program, folder, seeds, jobs):
    """The frames of the scenes: renders those that are not there yet, and keeps them in few files."""
    frames = []
    for first in range(seeds.start, seeds.stop, SCENES_PER_PACK):
        some = range(first, min(first + SCENES_PER_PACK, seeds.stop))
        file = folder / f"{some.start}_{some.stop}.npz"
        if not file.exists():
            new = [frame for scene_folder in render(program, folder, some, jobs) for frame in read_scene(scene_folder)]
            arrays = {f"{kind}{i}": part for i, frame in enumerate(new) for kind, part in zip("imb", frame)}
            np.savez(file, **arrays)
        with np.load(file) as arrays:
            count = len(arrays.files) // 3
            frames += [tuple(arrays[f"{kind}{i}"] for kind in "imb") for i in range(count)]
    return frames


def texture(rng, size):
    """A picture of nothing: noise of several scales, in colours, with rectangles and lines."""
    width, height = size
    image = np.empty((height, width, 3), np.float32)
    image[:] = rng.uniform(0, 255, 3)
    for cells in (3, 9, 27, 81):
        if rng.random() < 0.7:
            noise = rng.normal(0, rng.uniform(5, 50), (cells, cells, int(rng.choice([1, 3])))).astype(np.float32)
            noise = cv2.resize(noise, size, interpolation=int(rng.choice([cv2.INTER_NEAREST, cv2.INTER_CUBIC])))
            image += noise if noise.ndim == 3 else noise[..., None]
    for _ in range(int(rng.integers(0, 12))):
        a, b = rng.integers(0, width, 2), rng.integers(0, height, 2)
        color = rng.uniform(0, 255, 3).tolist()
        if rng.random() < 0.6:
            cv2.rectangle(image, (int(a[0]), int(b[0])), (int(a[1]), int(b[1])), color, -1)
        else:
            cv2.line(image, (int(a[0]), int(b[0])), (int(a[1]), int(b[1])), color, int(rng.integers(1, 9)))
    return np.clip(image, 0, 255).astype(np.uint8)


def warp_boxes(boxes, matrix, size):
    """Boxes after an affine map without rotation, cut off at the image, seen the less the more is cut off."""
    x0, y0 = boxes[:, 1] * matrix[0, 0] + matrix[0, 2], boxes[:, 2] * matrix[1, 1] + matrix[1, 2]
    x1, y1 = x0 + boxes[:, 3] * matrix[0, 0], y0 + boxes[:, 4] * matrix[1, 1]
    x0, x1 = np.minimum(x0, x1), np.maximum(x0, x1)
    whole = np.maximum((x1 - x0) * (y1 - y0), 1e-6)
    x0, x1, y0, y1 = x0.clip(0, size[0]), x1.clip(0, size[0]), y0.clip(0, size[1]), y1.clip(0, size[1])
    result = boxes.copy()
    result[:, 1], result[:, 2], result[:, 3], result[:, 4] = x0, y0, x1 - x0, y1 - y0
    result[:, 5] *= (x1 - x0) * (y1 - y0) / whole
    return result[(x1 - x0 > 1) & (y1 - y0 > 1)]


def image_of(kept):
    return kept if kept.ndim == 3 else cv2.imdecode(kept, cv2.IMREAD_COLOR)


def mask_of(kept):
    return kept if kept.ndim == 2 else cv2.imdecode(kept, cv2.IMREAD_GRAYSCALE)


class RenderedImages(torch.utils.data.Dataset):
    """`count` images of the frames as the network wants them, varied (`seed`) or as they are (None).

    `decoded`: the images are held as pixels, 0.5 MB each, which saves time.
    """

    def __init__(self, frames, count, seed, decoded=False):
        self.frames, self.count, self.seed = frames, count, seed
        if decoded:
            with ThreadPoolExecutor() as pool:
                self.frames = list(pool.map(lambda f: (image_of(f[0]), mask_of(f[1]), f[2]), frames))

    def __len__(self):
        return self.count

    def __getitem__(self, index):
        cv2.setNumThreads(1)
        if self.seed is None:
            image, boxes = self.read(index % len(self.frames))
            image, boxes = self.framed(image, boxes, np.array([[INPUT[0] / image.shape[1], 0, 0],
                                                               [0, INPUT[1] / image.shape[0], 0]]))
        else:
            rng = np.random.default_rng([self.seed, index])
            image, boxes = self.varied(rng)
        tensor = torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))
        return tensor, torch.from_numpy(self.labelled(boxes))

    def read(self, i):
        image, _, boxes = self.frames[i]
        return image_of(image), boxes

    @staticmethod
    def labelled(boxes):
        """Rows of label, x0, y0, x1, y1 as shares of the image; label -1: not sure."""
        result = np.empty((len(boxes), 5), np.float32)
        share = boxes[:, 3] * boxes[:, 4] / (INPUT[0] * INPUT[1])
        visible = (boxes[:, 5] >= SURE_VISIBLE) | ((boxes[:, 5] >= SURE_VISIBLE_NEAR) & (share >= SURE_SHARE))
        sure = visible & (boxes[:, 4] >= MIN_HEIGHT_PX)
        result[:, 0] = np.where(sure, boxes[:, 0], -1)
        result[:, 1:3] = boxes[:, 1:3] / INPUT
        result[:, 3:5] = (boxes[:, 1:3] + boxes[:, 3:5]) / INPUT
        return result

    @staticmethod
    def framed(image, boxes, matrix, fill=(0, 0, 0)):
        return cv2.warpAffine(image, matrix, INPUT, borderValue=fill), warp_boxes(boxes, matrix, INPUT)

    def varied(self, rng):
        image, boxes = self.read(int(rng.integers(len(self.frames))))
        if rng.random() < 0.2:
            image, boxes = self.with_movers(rng, image, boxes)
        height, width = image.shape[:2]
        # About the image, a part of it, or it and something around it.
        low, high = ((0.95, 1.3), (1.0, 2.5), (0.5, 1.0))[rng.choice(3, p=[0.6, 0.26, 0.14])]
        zoom, stretch = np.exp(rng.uniform(np.log(low), np.log(high))), np.exp(rng.uniform(-0.13, 0.13))
        scale = np.array([INPUT[0] / width * zoom * stretch, INPUT[1] / height * zoom / stretch])
        # Parts are aimed at an object in two of three, and show nothing beyond the image.
        aim = np.array([width, height]) * rng.uniform(0, 1, 2)
        if len(boxes) > 0 and rng.random() < 0.67:
            b = boxes[int(rng.integers(len(boxes)))]
            aim = b[1:3] + b[3:5] * rng.uniform(0, 1, 2)
        shift, room = np.array(INPUT) * rng.uniform(0.3, 0.7, 2) - aim * scale, INPUT - scale * (width, height)
        shift = np.clip(shift, np.minimum(room, 0), np.maximum(room, 0))
        (sx, sy) = scale
        matrix = np.array([[sx, 0, shift[0]], [0, sy, shift[1]]])
        if rng.random() < 0.5:
            matrix[0] = [-sx, 0, INPUT[0] - shift[0]]
        fill = rng.uniform(0, 255, 3).tolist()
        image, boxes = self.framed(image, boxes, matrix, fill)
        if rng.random() < 0.1:
            boxes = self.cover(rng, image, boxes)
        return self.developed(rng, image), boxes

    def with_movers(self, rng, image, boxes):
        """People and cars of another image, cut out, before this one or before a texture."""
        other, mask, others = self.frames[int(rng.integers(len(self.frames)))]
        others = others[others[:, 6] > 0]
        if len(others) == 0:
            return image, boxes
        height, width = image.shape[:2]
        if rng.random() < 0.3:
            image, boxes = texture(rng, (width, height)), boxes[:0]
        scale = np.exp(rng.uniform(np.log(0.5), np.log(1.6)))
        shift = np.array([width, height]) * (1 - scale) * rng.uniform(0, 1, 2) + rng.uniform(-0.2, 0.2, 2) * width
        matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
        front = cv2.warpAffine(image_of(other), matrix, (width, height))
        mask = cv2.warpAffine(cv2.GaussianBlur(mask_of(mask), (3, 3), 0), matrix, (width, height))
        boxes = boxes.copy()
        for box in boxes:  # what is now covered
            x, y, w, h = box[1:5].astype(int)
            box[5] *= 1 - (mask[y:y + max(h, 1), x:x + max(w, 1)] > 127).mean()
        share = (mask.astype(np.float32) / 255)[..., None]
        image = (image * (1 - share) + front * share).astype(np.uint8)
        return image, np.concatenate([boxes, warp_boxes(others, matrix, (width, height))])

    @staticmethod
    def cover(rng, image, boxes):
        """Something without a name before the image."""
        boxes = boxes.copy()
        for _ in range(int(rng.integers(1, 4))):
            w, h = rng.integers(12, 110, 2)
            x, y = rng.integers(0, INPUT[0] - w), rng.integers(0, INPUT[1] - h)
            image[y:y + h, x:x + w] = texture(rng, (int(w), int(h)))
            for box in boxes:
                overlap_x = min(box[1] + box[3], x + w) - max(box[1], x)
                overlap_y = min(box[2] + box[4], y + h) - max(box[2], y)
                if overlap_x > 0 and overlap_y > 0:
                    box[5] *= 1 - overlap_x * overlap_y / max(box[3] * box[4], 1e-6)
        return boxes

    @staticmethod
    def developed(rng, image):
        """Other light, colours, lens and sensor."""
        if rng.random() < 0.5:
            levels = np.arange(256)
            hue, saturation = (levels + int(rng.integers(-15, 16))) % 180, np.clip(levels * rng.uniform(0.4, 1.5), 0, 255)
            curves = np.stack([hue, saturation, levels], axis=-1).astype(np.uint8).reshape(1, 256, 3)
            image = cv2.cvtColor(cv2.LUT(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), curves), cv2.COLOR_HSV2BGR)
        if rng.random() < 0.08:
            image = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
        if rng.random() < 0.15:
            size = int(rng.choice([3, 5]))
            image = cv2.GaussianBlur(image, (size, size), 0)
        elif rng.random() < 0.12:
            size = int(rng.integers(3, 9))
            kernel = np.zeros((size, size), np.float32)
            cv2.line(kernel, tuple(map(int, rng.integers(0, size, 2))), tuple(map(int, rng.integers(0, size, 2))), 1)
            image = cv2.filter2D(image, -1, kernel / kernel.sum())
        levels = np.arange(256) / 255.0
        curve = (levels ** np.exp(rng.uniform(-0.4, 0.4)) - 0.5) * rng.uniform(0.7, 1.3) + 0.5
        curves = np.stack([curve * rng.uniform(0.88, 1.12) + rng.uniform(-0.1, 0.1) for _ in range(3)], axis=-1)
        image = cv2.LUT(image, (np.clip(curves, 0, 1) * 255).astype(np.uint8).reshape(1, 256, 3))
        if rng.random() < 0.3:
            noise = np.empty(image.shape, np.int16)
            cv2.setRNGSeed(int(rng.integers(1 << 31)))
            cv2.randn(noise, 0, float(rng.uniform(1, 12)))
            image = cv2.add(image, noise, dtype=cv2.CV_8U)
        if rng.random() < 0.12:
            quality = int(rng.integers(25, 85))
            image = cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)
        return image
