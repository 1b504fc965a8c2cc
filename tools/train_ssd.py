#!/usr/bin/env python3
"""Trains the built-in detector, a small SSD, from rendered images only, and writes models/builtin.*.

    scripts/build.sh release dynamic_slam
    tools/train_ssd.py --program build/release/apps/dynamic_slam

Needs what scripts/packages_train.txt names (Debian 12). The same repository gives the same images and the same
training; docs/builtin_detector.md says what came of it. SSD: Liu et al., "SSD: Single shot multibox detector", 2016.
"""

import argparse
import csv
import hashlib
import math
import pathlib
import re
import time

import cv2
import numpy as np
import torch
from torch import nn

from ssd_data import CLASSES, INPUT, RenderedImages, packed_scenes

ROOT = pathlib.Path(__file__).resolve().parent.parent
VARIANCE_CENTER, VARIANCE_SIZE = 0.1, 0.2
NEGATIVES_PER_POSITIVE = 3
# Of each grid: its cells, and the (width, height) of its anchors, px of the input. People stand, cars and screens lie.
# The narrowest stand twice in a cell, side by side.
GRIDS = [
    ((48, 32), [(7, 15), (7, 15), (11, 25), (20, 17), (34, 23)]),
    ((24, 16), [(16, 38), (28, 56), (38, 40), (55, 34), (24, 90)]),
    ((12, 8), [(40, 90), (56, 130), (72, 74), (100, 60), (42, 160), (80, 190), (56, 235), (112, 240), (120, 130)]),
    ((6, 4), [(72, 236), (132, 236), (192, 240), (180, 120), (180, 170), (300, 244)]),
]


def make_anchors():
    """All anchors as rows of center x, center y, width, height, shares of the input; in the order of the outputs."""
    rows = []
    for (columns, lines), sizes in GRIDS:
        for y in range(lines):
            for x in range(columns):
                for i, (w, h) in enumerate(sizes):
                    aside = 0.5 if sizes.count((w, h)) == 1 else 0.25 + 0.5 * i
                    rows.append([(x + aside) / columns, (y + 0.5) / lines, w / INPUT[0], h / INPUT[1]])
    return torch.tensor(rows, dtype=torch.float32)


def convolution(inputs, outputs, size, stride=1, groups=1):
    return nn.Sequential(nn.Conv2d(inputs, outputs, size, stride, size // 2, groups=groups, bias=False),
                         nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class Block(nn.Module):
    """A depthwise separable convolution; what comes in is added where it has the same shape."""

    def __init__(self, inputs, outputs, stride=1):
        super().__init__()
        self.layers = nn.Sequential(convolution(inputs, inputs, 3, stride, inputs),
                                    nn.Sequential(nn.Conv2d(inputs, outputs, 1, bias=False), nn.BatchNorm2d(outputs)))
        self.adds = inputs == outputs and stride == 1

    def forward(self, x):
        return torch.relu(self.layers(x) + x if self.adds else self.layers(x))


class Head(nn.Module):
    """Rows of `numbers` for each anchor of a grid."""

    def __init__(self, channels, anchors, numbers):
        super().__init__()
        self.numbers = numbers
        self.layers = nn.Sequential(convolution(channels, channels, 3, 1, channels),
                                    nn.Conv2d(channels, anchors * numbers, 1))

    def forward(self, features):
        return self.layers(features).permute(0, 2, 3, 1).reshape(features.shape[0], -1, self.numbers)


class SmallSsd(nn.Module):
    """Images, N x 3 x height x width, 0 to 255, blue first: codes N x anchors x 4 (y x h w), class scores."""

    def __init__(self):
        super().__init__()
        self.stages = nn.ModuleList([
            nn.Sequential(convolution(3, 16, 3, 2), Block(16, 32, 2), Block(32, 32), Block(32, 32), Block(32, 64, 2),
                          *(Block(64, 64) for _ in range(4))),
            nn.Sequential(Block(64, 128, 2), *(Block(128, 128) for _ in range(4))),
            nn.Sequential(Block(128, 192, 2), *(Block(192, 192) for _ in range(2))),
            nn.Sequential(Block(192, 128, 2), Block(128, 128)),
        ])
        # What coarse grids see is added to the finer ones: small things are told by what is around them.
        channels = [64, 96, 128, 128]
        self.across = nn.ModuleList(nn.Conv2d(i, o, 1) for i, o in zip([64, 128, 192], channels))
        self.down = nn.ModuleList(nn.Conv2d(i, o, 1, bias=False) for i, o in zip(channels[1:], channels))
        self.joined = nn.ModuleList(Block(c, c) for c in channels[:-1])
        self.codes = nn.ModuleList(Head(c, len(sizes), 4) for c, (_, sizes) in zip(channels, GRIDS))
        self.scores = nn.ModuleList(Head(c, len(sizes), len(CLASSES) + 1) for c, (_, sizes) in zip(channels, GRIDS))
        for head in self.scores:  # at first nearly everything is background
            head.layers[-1].bias.data.view(-1, len(CLASSES) + 1)[:, 0] = 4

    def forward(self, images):
        features, x = [], images
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        for i in (2, 1, 0):
            above = nn.functional.interpolate(self.down[i](features[i + 1]), scale_factor=2.0, mode="nearest")
            features[i] = self.joined[i](torch.relu(self.across[i](features[i]) + above))
        codes = torch.cat([head(f) for head, f in zip(self.codes, features)], dim=1)
        scores = torch.cat([head(f) for head, f in zip(self.scores, features)], dim=1)
        return codes, scores if self.training else torch.softmax(scores, dim=2)


def corners(boxes):
    return torch.cat([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2], dim=1)


def overlaps(a, b):
    """Of each box (corners) of `a` with each of b[i]: the intersection over the union, and over the box of `a`."""
    a, b = a[None, :, None], b[:, None]
    width, height = ((torch.minimum(a[..., i + 2], b[..., i + 2]) - torch.maximum(a[..., i], b[..., i])).clamp(min=0)
                     for i in (0, 1))
    common = width * height
    area_a, area_b = ((c[..., 2] - c[..., 0]) * (c[..., 3] - c[..., 1]) for c in (a, b))
    return common / (area_a + area_b - common).clamp(min=1e-9), common / area_a.clamp(min=1e-9)


def match(anchors, truth):
    """The labels of the anchors (0: background, -1: neither) and their codes, images x anchors (x 4).

    `truth`: images x objects x (label, corners), label 0: no object, it fills the row.
    """
    is_object, is_unsure = truth[:, None, :, 0] > 0, truth[:, None, :, 0] < 0
    iou, inside = overlaps(corners(anchors), truth[..., 1:])
    iou = iou * is_object
    favourite = iou.argmax(dim=1, keepdim=True)  # each object has its best anchor in any case
    iou.scatter_(1, favourite, iou.gather(1, favourite) + 2.0 * is_object)
    best, object_of = iou.max(dim=2)
    labels = torch.where((best >= 0.35) | ((inside > 0.5) & is_unsure).any(dim=2), -1, 0)
    # Less than SSD's 0.5: narrow objects would have hardly any.
    labels = torch.where(best >= 0.45, truth[..., 0].long().gather(1, object_of), labels)
    box = truth[..., 1:].gather(1, object_of[..., None].expand(-1, -1, 4))
    size, center = (box[..., 2:] - box[..., :2]).clamp(min=1e-4), (box[..., :2] + box[..., 2:]) / 2
    offset = (center - anchors[:, :2]) / anchors[:, 2:] / VARIANCE_CENTER
    growth = torch.log(size / anchors[:, 2:]) / VARIANCE_SIZE
    return labels, torch.stack([offset[..., 1], offset[..., 0], growth[..., 1], growth[..., 0]], dim=2)


class Loss(nn.Module):
    """Eq. (3) of the paper: softmax confidence and smooth L1 of the codes, over the number of matched anchors.

    Of the background, the anchors that look least like it count, three for each matched one. Returns both parts.
    """

    def forward(self, codes, scores, wanted_labels, wanted_codes):
        positive = wanted_labels > 0
        count = positive.sum().clamp(min=1)
        every = nn.functional.cross_entropy(scores.flatten(0, 1), wanted_labels.clamp(min=0).flatten(),
                                            reduction="none").view_as(wanted_labels)
        background = every[wanted_labels == 0]
        hardest = background.topk(min(NEGATIVES_PER_POSITIVE * int(count), len(background))).values
        confidence = (every[positive].sum() + hardest.sum()) / count
        location = nn.functional.smooth_l1_loss(codes[positive], wanted_codes[positive], reduction="sum") / count
        return confidence, location


def batch_of(samples):
    """Images, and their objects, as many rows for each: rows of zeros are none."""
    objects = nn.utils.rnn.pad_sequence([torch.cat([truth, torch.zeros(1, 5)]) for _, truth in samples], True)
    return torch.stack([image for image, _ in samples]), objects


def normalised(images):
    return ((images.float() - 128) / 128).contiguous(memory_format=torch.channels_last)


def folded(model):
    """A copy in which the batch normalisations are part of the convolutions."""
    copy = SmallSsd()
    copy.load_state_dict(model.state_dict())
    copy.eval()
    for module in list(copy.modules()):
        if isinstance(module, nn.Sequential) and len(module) > 1 and isinstance(module[1], nn.BatchNorm2d):
            module[0] = nn.utils.fusion.fuse_conv_bn_eval(module[0], module[1])
            module[1] = nn.Identity()
    return copy


def export(model, anchors, folder):
    """Writes builtin.onnx and builtin_anchors.txt, and checks that OpenCV computes what PyTorch does."""
    network, image = folded(model), torch.zeros(1, 3, INPUT[1], INPUT[0])
    file = folder / "builtin.onnx"
    torch.onnx.export(network, image, str(file), opset_version=11, input_names=["image"],
                      output_names=["boxes", "scores"])
    with open(folder / "builtin_anchors.txt", "w") as stream:
        stream.write("# center y, center x, height, width, 0 to 1 over the input; written by tools/train_ssd.py\n")
        for x, y, w, h in anchors.tolist():
            stream.write(f"{y:.4g} {x:.4g} {h:.4g} {w:.4g}\n")
    image.uniform_(-1, 1, generator=torch.Generator().manual_seed(1))
    opencv = cv2.dnn.readNetFromONNX(str(file))
    opencv.setInput(image.numpy())
    with torch.no_grad():
        for ours, theirs in zip(network(image), opencv.forward(["boxes", "scores"])):
            difference = float(np.abs(ours.numpy() - theirs).max())
            assert difference < 1e-2, f"OpenCV's result differs by {difference}"


def state_checksums(folder, detector_file):
    """Writes the SHA-256 of both files into the detector file, which names them."""
    text = detector_file.read_text()
    for name in ("builtin.onnx", "builtin_anchors.txt"):
        digest = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        text = re.sub(rf"(/{re.escape(name)}\n  sha256:).*", rf"\1 {digest}", text)
    detector_file.write_text(text)


def draw_curves(log, file):
    """The losses over the steps, on a logarithmic scale: training blue, unseen scenes red."""
    width, height, left, right, bottom = 900, 460, 70, 40, 50
    picture = np.full((height, width, 3), 255, np.uint8)
    steps = [row["step"] for row in log]
    low, high = -0.35, 1.05  # powers of ten

    def at(step, loss):
        x = left + (width - left - right) * step / max(steps[-1], 1)
        y = height - bottom - (height - bottom - 20) * (np.log10(max(loss, 1e-3)) - low) / (high - low)
        return int(x), int(np.clip(y, 0, height))

    for loss in (0.5, 1, 2, 5, 10):
        cv2.line(picture, at(0, loss), at(steps[-1], loss), (220, 220, 220), 1)
        cv2.putText(picture, f"{loss:g}", (15, at(0, loss)[1] + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1,
                    cv2.LINE_AA)
    for i in range(6):
        step = steps[-1] * i // 5
        cv2.putText(picture, f"{step}", (at(step, 1)[0] - 15, height - 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0),
                    1, cv2.LINE_AA)
    for key, color in (("train", (200, 90, 20)), ("unseen", (30, 30, 210))):
        points = np.array([at(row["step"], row[f"{key}_confidence"] + row[f"{key}_location"]) for row in log])
        cv2.polylines(picture, [points], False, color, 2, cv2.LINE_AA)
    cv2.imwrite(str(file), picture)


def rate_share(step, steps):
    """Of the highest learning rate: it rises in the first 3%, and falls along a cosine to zero."""
    rise = 0.03 * steps
    return step / rise if step < rise else 0.5 + 0.5 * math.cos(math.pi * (step - rise) / (steps - rise))


def unseen_loss(model, batches, anchors, loss):
    """Both parts of the loss on images of other scenes, as they are."""
    parts = []
    model.eval()
    with torch.no_grad():
        for images, objects in batches:
            codes, scores = model(normalised(images.to(anchors.device)))
            wanted = match(anchors, objects.to(anchors.device))
            parts.append([float(part) for part in loss(codes, torch.log(scores.clamp(min=1e-9)), *wanted)])
    model.train()
    return np.mean(parts, axis=0).tolist()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/apps/dynamic_slam")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "out/train_ssd", help="rendered images, checkpoints")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "models")
    parser.add_argument("--scenes", type=int, default=900)
    parser.add_argument("--steps", type=int, default=22000, help="in which the learning rate falls to zero")
    parser.add_argument("--stop", type=int, default=20800, help="stop after this step; the rate is next to nothing then")
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--rate", type=float, default=4e-3, help="highest learning rate")
    parser.add_argument("--device", default="cpu", help="of PyTorch: cpu or cuda; another one rounds differently")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch; another number rounds differently")
    parser.add_argument("--workers", type=int, default=1, help="processes that vary images; does not change the result")
    parser.add_argument("--decoded", action="store_true", help="hold images as pixels: faster, 5 GB of memory")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in --work")
    parser.add_argument("--no-export", action="store_true", help="leave the files to a later call with --resume")
    arguments = parser.parse_args()

    torch.manual_seed(1)
    torch.set_num_threads(arguments.threads)
    torch.backends.cudnn.deterministic = True
    device = torch.device(arguments.device)
    program = arguments.program.resolve()
    data = arguments.work.resolve() / "data"
    frames = packed_scenes(program, data, range(1000, 1000 + arguments.scenes), 2)
    unseen = packed_scenes(program, data, range(9000, 9000 + 40), 2)
    print(f"{len(frames)} images of {arguments.scenes} scenes, {len(unseen)} of others", flush=True)

    anchors, loss = make_anchors().to(device), Loss()
    model = SmallSsd().to(device, memory_format=torch.channels_last)  # faster by a quarter
    print(f"{sum(p.numel() for p in model.parameters())} parameters, {len(anchors)} anchors", flush=True)
    optimizer = torch.optim.AdamW(model.parameters(), lr=arguments.rate, weight_decay=1e-3)
    first, log, checkpoint = 0, [], arguments.work / "checkpoint.pt"
    if arguments.resume:
        state = torch.load(checkpoint, map_location=device)
        model.load_state_dict(state["model"])
        optimizer.load_state_dict(state["optimizer"])
        first, log = state["step"], state["log"]
    last = min(arguments.stop, arguments.steps)
    varied = RenderedImages(frames, arguments.steps * arguments.batch, seed=1, decoded=arguments.decoded)
    rest = torch.utils.data.Subset(varied, range(first * arguments.batch, last * arguments.batch))
    loader = torch.utils.data.DataLoader(rest, arguments.batch, num_workers=arguments.workers, prefetch_factor=4,
                                         collate_fn=batch_of, pin_memory=device.type == "cuda")
    plain = list(torch.utils.data.DataLoader(RenderedImages(unseen, len(unseen), None), 32, collate_fn=batch_of))
    arguments.out.mkdir(parents=True, exist_ok=True)
    recent, begin, model = torch.zeros(3, device=device), time.time(), model.train()
    for step, batch in enumerate(loader, start=first + 1):
        images, objects = (part.to(device, non_blocking=True) for part in batch)
        for group in optimizer.param_groups:
            group["lr"] = arguments.rate * rate_share(step, arguments.steps)
        confidence, location = loss(*model(normalised(images)), *match(anchors, objects))
        optimizer.zero_grad()
        (confidence + location).backward()
        nn.utils.clip_grad_norm_(model.parameters(), 10)
        optimizer.step()
        recent += torch.stack([confidence.detach(), location.detach(), torch.ones_like(location)])
        if step % 200 == 0 or step == last:
            train, other = (recent[:2] / recent[2]).tolist(), unseen_loss(model, plain, anchors, loss)
            recent.zero_()
            log.append({"step": step, "train_confidence": train[0], "train_location": train[1],
                        "unseen_confidence": other[0], "unseen_location": other[1]})
            print(f"step {step}: training {train[0]:.3f} + {train[1]:.3f}, unseen scenes {other[0]:.3f} + "
                  f"{other[1]:.3f}; {time.time() - begin:.0f} s", flush=True)
            torch.save({"model": model.state_dict(), "optimizer": optimizer.state_dict(),
                        "step": step, "log": log}, checkpoint)
    if arguments.no_export:
        return
    export(model, anchors, arguments.out)
    if arguments.out.resolve() == ROOT / "models":
        state_checksums(arguments.out, ROOT / "config/detectors/builtin.yaml")
    with open(arguments.out / "builtin_training.csv", "w", newline="") as stream:
        writer = csv.DictWriter(stream, log[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: v if k == "step" else f"{v:.4f}" for k, v in row.items()} for row in log)
    draw_curves(log, arguments.out / "builtin_training.png")


if __name__ == "__main__":
    main()
