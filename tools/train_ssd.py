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
import pathlib
import re
import time

import cv2
import numpy as np
import torch
from torch import nn

from ssd_data import CLASSES, INPUT, RenderedImages, read_scenes, render

ROOT = pathlib.Path(__file__).resolve().parent.parent
VARIANCE_CENTER, VARIANCE_SIZE = 0.1, 0.2
NEGATIVES_PER_POSITIVE = 3
# Of each grid: its cells, and the (width, height) of its anchors, px of the input. People stand, cars and screens lie.
GRIDS = [
    ((24, 18), [(7, 17), (10, 25), (18, 14)]),
    ((12, 9), [(14, 36), (19, 48), (28, 28), (42, 28), (32, 46)]),
    ((6, 5), [(30, 70), (42, 96), (62, 66), (72, 104), (110, 60)]),
    ((3, 3), [(48, 122), (66, 140), (92, 120), (110, 142), (150, 90), (185, 142)]),
]


def make_anchors():
    """All anchors as rows of center x, center y, width, height, shares of the input; in the order of the outputs."""
    rows = []
    for (columns, lines), sizes in GRIDS:
        for y in range(lines):
            for x in range(columns):
                rows += [[(x + 0.5) / columns, (y + 0.5) / lines, w / INPUT[0], h / INPUT[1]] for w, h in sizes]
    return torch.tensor(rows, dtype=torch.float32)


def convolution(inputs, outputs, size, stride=1, groups=1):
    return nn.Sequential(nn.Conv2d(inputs, outputs, size, stride, size // 2, groups=groups, bias=False),
                         nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


def block(inputs, outputs, stride=1):
    """A depthwise separable convolution."""
    return nn.Sequential(convolution(inputs, inputs, 3, stride, inputs), convolution(inputs, outputs, 1))


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
            nn.Sequential(convolution(3, 16, 3, 2), block(16, 32, 2), block(32, 32), block(32, 64, 2), block(64, 64),
                          block(64, 64)),
            nn.Sequential(block(64, 128, 2), block(128, 128), block(128, 128), block(128, 128), block(128, 128)),
            nn.Sequential(block(128, 256, 2), block(256, 256), block(256, 256)),
            nn.Sequential(block(256, 256, 2)),
        ])
        channels = [64, 128, 256, 256]
        self.codes = nn.ModuleList(Head(c, len(sizes), 4) for c, (_, sizes) in zip(channels, GRIDS))
        self.scores = nn.ModuleList(Head(c, len(sizes), len(CLASSES) + 1) for c, (_, sizes) in zip(channels, GRIDS))
        for head in self.scores:  # at first nearly everything is background
            head.layers[-1].bias.data.view(-1, len(CLASSES) + 1)[:, 0] = 4

    def forward(self, images):
        features, x = [], images
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        codes = torch.cat([head(f) for head, f in zip(self.codes, features)], dim=1)
        scores = torch.cat([head(f) for head, f in zip(self.scores, features)], dim=1)
        return codes, scores if self.training else torch.softmax(scores, dim=2)


def corners(boxes):
    return torch.cat([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2], dim=1)


def overlaps(a, b):
    """Of each box (corners) of `a` with each of `b`: the intersection over the union, and over the box of `a`."""
    low, high = torch.maximum(a[:, None, :2], b[None, :, :2]), torch.minimum(a[:, None, 2:], b[None, :, 2:])
    common = (high - low).clamp(min=0).prod(dim=2)
    area_a, area_b = (a[:, 2:] - a[:, :2]).prod(dim=1)[:, None], (b[:, 2:] - b[:, :2]).prod(dim=1)[None]
    return common / (area_a + area_b - common).clamp(min=1e-9), common / area_a.clamp(min=1e-9)


def match(anchors, truth):
    """The label of each anchor (0: background, -1: neither) and its codes, for an image's rows of label and corners."""
    labels, codes = torch.zeros(len(anchors), dtype=torch.long), torch.zeros(len(anchors), 4)
    unsure, truth = truth[truth[:, 0] < 0], truth[truth[:, 0] > 0]
    if len(unsure) > 0:
        labels[overlaps(corners(anchors), unsure[:, 1:])[1].amax(dim=1) > 0.5] = -1
    if len(truth) == 0:
        return labels, codes
    iou, _ = overlaps(corners(anchors), truth[:, 1:])
    best, object_of = iou.max(dim=1)
    favourite = iou.argmax(dim=0)  # each object has its best anchor in any case
    object_of[favourite], best[favourite] = torch.arange(len(truth)), 1.0
    # Less than SSD's 0.5: with few anchors that gives an object two on average, and learning is slow.
    labels[best >= 0.3] = -1
    positive = best >= 0.4
    labels[positive] = truth[object_of[positive], 0].long()
    box, a = truth[object_of, 1:], anchors
    size = (box[:, 2:] - box[:, :2]).clamp(min=1e-4)
    center = (box[:, :2] + box[:, 2:]) / 2
    offset = (center - a[:, :2]) / a[:, 2:] / VARIANCE_CENTER
    growth = torch.log(size / a[:, 2:]) / VARIANCE_SIZE
    return labels, torch.stack([offset[:, 1], offset[:, 0], growth[:, 1], growth[:, 0]], dim=1)


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


class Batches:
    """Images with what is wanted of each anchor."""

    def __init__(self, anchors):
        self.anchors = anchors

    def __call__(self, samples):
        labels, codes = zip(*(match(self.anchors, truth) for _, truth in samples))
        return torch.stack([image for image, _ in samples]), torch.stack(labels), torch.stack(codes)


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
            stream.write(f"{y:.7f} {x:.7f} {h:.7f} {w:.7f}\n")
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
    width, height, left, bottom = 900, 460, 70, 50
    picture = np.full((height, width, 3), 255, np.uint8)
    steps = [row["step"] for row in log]
    low, high = -1.0, 1.5  # powers of ten

    def at(step, loss):
        x = left + (width - left - 20) * step / max(steps[-1], 1)
        y = height - bottom - (height - bottom - 20) * (np.log10(max(loss, 1e-3)) - low) / (high - low)
        return int(x), int(np.clip(y, 0, height))

    for loss in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20):
        cv2.line(picture, at(0, loss), at(steps[-1], loss), (220, 220, 220), 1)
        cv2.putText(picture, f"{loss:g}", (15, at(0, loss)[1] + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1,
                    cv2.LINE_AA)
    for i in range(6):
        step = steps[-1] * i // 5
        cv2.putText(picture, f"{step}", (at(step, 0.1)[0] - 15, height - 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0),
                    1, cv2.LINE_AA)
    for key, color in (("train", (200, 90, 20)), ("unseen", (30, 30, 210))):
        points = np.array([at(row["step"], row[f"{key}_confidence"] + row[f"{key}_location"]) for row in log])
        cv2.polylines(picture, [points], False, color, 2, cv2.LINE_AA)
    cv2.imwrite(str(file), picture)


def rate_share(step, steps):
    """Of the highest learning rate: it rises, stays, and falls to zero in the last third.

    So a checkpoint from before the last third can be ended with any number of steps, as if that had been planned.
    """
    return min(step / 100, 1.0, (steps - step) / (steps / 3))


def unseen_loss(model, loader, loss):
    """Both parts of the loss on images of other scenes, as they are."""
    parts = []
    model.eval()
    with torch.no_grad():
        for images, labels, codes in loader:
            predicted, scores = model(normalised(images))
            parts.append([float(part) for part in loss(predicted, torch.log(scores.clamp(min=1e-9)), labels, codes)])
    model.train()
    return np.mean(parts, axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/apps/dynamic_slam")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "out/train_ssd", help="rendered images, checkpoints")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "models")
    parser.add_argument("--scenes", type=int, default=180)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rate", type=float, default=6e-3, help="highest learning rate")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch; another number rounds differently")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in --work")
    arguments = parser.parse_args()

    torch.manual_seed(1)
    torch.set_num_threads(arguments.threads)
    program = arguments.program.resolve()
    data = arguments.work.resolve() / "data"
    frames = read_scenes(render(program, data, range(1000, 1000 + arguments.scenes), 2))
    unseen = read_scenes(render(program, data, range(9000, 9012), 2))
    print(f"{len(frames)} images of {arguments.scenes} scenes, {len(unseen)} of others", flush=True)

    anchors, loss = make_anchors(), Loss()
    model = SmallSsd().to(memory_format=torch.channels_last)  # faster by a quarter
    print(f"{sum(p.numel() for p in model.parameters())} parameters, {len(anchors)} anchors", flush=True)
    optimizer = torch.optim.AdamW(model.parameters(), lr=arguments.rate, weight_decay=1e-3)
    first, log, checkpoint = 0, [], arguments.work / "checkpoint.pt"
    if arguments.resume:
        state = torch.load(checkpoint)
        model.load_state_dict(state["model"])
        optimizer.load_state_dict(state["optimizer"])
        first, log = state["step"], state["log"]
    varied = RenderedImages(frames, arguments.steps * arguments.batch, seed=1)
    rest = torch.utils.data.Subset(varied, range(first * arguments.batch, len(varied)))
    loader = torch.utils.data.DataLoader(rest, arguments.batch, num_workers=1, prefetch_factor=4,
                                         collate_fn=Batches(anchors))
    plain = torch.utils.data.DataLoader(RenderedImages(unseen, len(unseen), None), 28, collate_fn=Batches(anchors))
    arguments.out.mkdir(parents=True, exist_ok=True)
    recent, begin, model = [], time.time(), model.train()
    for step, (images, labels, codes) in enumerate(loader, start=first + 1):
        for group in optimizer.param_groups:
            group["lr"] = arguments.rate * rate_share(step, arguments.steps)
        confidence, location = loss(*model(normalised(images)), labels, codes)
        optimizer.zero_grad()
        (confidence + location).backward()
        nn.utils.clip_grad_norm_(model.parameters(), 10)
        optimizer.step()
        recent.append([float(confidence), float(location)])
        if step % 100 == 0 or step == arguments.steps:
            train, other = np.mean(recent, axis=0), unseen_loss(model, plain, loss)
            recent = []
            log.append({"step": step, "train_confidence": train[0], "train_location": train[1],
                        "unseen_confidence": other[0], "unseen_location": other[1]})
            print(f"step {step}: training {train[0]:.3f} + {train[1]:.3f}, unseen scenes {other[0]:.3f} + "
                  f"{other[1]:.3f}; {(time.time() - begin) / 60:.1f} min", flush=True)
            torch.save({"model": model.state_dict(), "optimizer": optimizer.state_dict(),
                        "step": step, "log": log}, checkpoint)
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
