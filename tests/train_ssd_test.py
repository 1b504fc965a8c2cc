"""What tools/train_ssd.py wants of its network: matches, codes and the loss. Skipped without PyTorch."""

import math
import os
import sys
import unittest

try:
    import cv2  # noqa: F401
    import numpy as np
    import torch
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../tools"))
import ssd_data  # noqa: E402
import train_ssd  # noqa: E402


class MatchTest(unittest.TestCase):
    def setUp(self):
        self.anchors = train_ssd.make_anchors()

    def test_codes_give_the_box_back_as_the_decoder_reads_them(self):
        (labels,), (codes,) = train_ssd.match(self.anchors, torch.tensor([[[2.0, 0.31, 0.2, 0.52, 0.9]]]))
        matched = (labels == 2).nonzero().flatten()
        self.assertGreater(len(matched), 0)
        self.assertEqual(int((labels > 0).sum()), len(matched))
        for i in matched:
            (x, y, w, h), (ty, tx, th, tw) = self.anchors[i].tolist(), codes[i].tolist()
            center, size = (x + 0.1 * tx * w, y + 0.1 * ty * h), (w * math.exp(0.2 * tw), h * math.exp(0.2 * th))
            for value, wanted in zip((*center, *size), (0.415, 0.55, 0.21, 0.7)):
                self.assertAlmostEqual(value, wanted, 5)

    def test_what_fits_no_anchor_well_has_one_all_the_same(self):
        (labels,), _ = train_ssd.match(self.anchors, torch.tensor([[[5.0, 0.1, 0.5, 0.9, 0.52], [0, 0, 0, 0, 0]]]))
        self.assertEqual(int((labels == 5).sum()), 1)

    def test_where_one_cannot_be_sure_there_is_neither_object_nor_background(self):
        (labels,), _ = train_ssd.match(self.anchors, torch.tensor([[[-1.0, 0.0, 0.0, 0.5, 1.0]]]))
        box = train_ssd.corners(self.anchors)
        inside = (box[:, 0] >= 0) & (box[:, 1] >= 0) & (box[:, 2] <= 0.5) & (box[:, 3] <= 1)
        self.assertTrue((labels[inside] == -1).all())
        self.assertTrue((labels[box[:, 0] > 0.5] == 0).all())


class LossTest(unittest.TestCase):
    def test_counts_matches_and_three_of_the_hardest_negatives_for_each(self):
        scores = torch.zeros(1, 6, 3)  # softmax of equal scores: log 3 for each
        scores[0, 1, 0] = -50.0  # taken for an object, which it is not
        scores[0, 5, 1] = 50.0  # the same, but nobody is sure there
        codes, wanted = torch.zeros(1, 6, 4), torch.zeros(1, 6, 4)
        codes[0, 0] = torch.tensor([0.5, 2.0, 0.0, 0.0])  # smooth L1: 0.125 and 1.5
        codes[0, 1] = 9.0  # background has no box
        labels = torch.tensor([[1, 0, 0, 0, 0, -1]])
        confidence, location = train_ssd.Loss()(codes, scores, labels, wanted)
        self.assertAlmostEqual(float(location), 1.625, 5)
        self.assertAlmostEqual(float(confidence), math.log(3) + (50 + math.log(2)) + 2 * math.log(3), 3)


class DataTest(unittest.TestCase):
    def test_boxes_follow_a_flip_and_are_seen_less_where_they_are_cut_off(self):
        boxes = np.array([[1, 10, 20, 40, 60, 0.8, 1]], np.float32)
        flipped = ssd_data.warp_boxes(boxes, np.array([[-1, 0, 30.0], [0, 1, 0]]), (320, 240))
        np.testing.assert_allclose(flipped, [[1, 0, 20, 20, 60, 0.4, 1]], rtol=1e-6)

    def test_a_seed_says_all_of_a_scene(self):
        self.assertEqual(ssd_data.scene(7), ssd_data.scene(7))
        self.assertNotEqual(ssd_data.scene(7), ssd_data.scene(8))


if __name__ == "__main__":
    unittest.main()
