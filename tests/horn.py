"""Trajectory errors computed another way than the program does: Horn's quaternions and plain Python.

B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions" (1987), with the least-squares scale of
Umeyama; quaternions are (w, x, y, z).
"""

import math


def read_tum(file):
    """[(stamp, position, quaternion)]."""
    poses = []
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            if not line.startswith("#"):
                t, x, y, z, qx, qy, qz, qw = map(float, line.split())
                norm = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
                poses.append((t, (x, y, z), (qw / norm, qx / norm, qy / norm, qz / norm)))
    return poses


def match(truth, estimate, max_dt=0.01):
    """Pairs of the nearest stamps, for each pose of the shorter list; the estimate's when they are equally long."""
    def nearest(poses, stamp):
        return min(poses, key=lambda pose: (abs(pose[0] - stamp), pose[0]))
    if len(estimate) > len(truth):
        pairs = [(pose, nearest(estimate, pose[0])) for pose in truth]
    else:
        pairs = [(nearest(truth, pose[0]), pose) for pose in estimate]
    return [(a, b) for a, b in pairs if abs(a[0] - b[0]) <= max_dt]


def multiply(p, q):
    a, b, c, d = p
    e, f, g, h = q
    return (a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e)


def conjugate(q):
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q, v):
    return multiply(multiply(q, (0.0, *v)), conjugate(q))[1:]


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def largest_eigenvector(matrix):
    """Of a symmetric 4x4 matrix, by Jacobi's rotations."""
    n = 4
    a = [row[:] for row in matrix]
    v = [[float(i == j) for j in range(n)] for i in range(n)]
    for _ in range(100):
        p, q = max(((i, j) for i in range(n) for j in range(i + 1, n)), key=lambda ij: abs(a[ij[0]][ij[1]]))
        if a[p][q] == 0 or abs(a[p][q]) < 1e-300:
            break
        theta = 0.5 * math.atan2(2 * a[p][q], a[q][q] - a[p][p])
        c, s = math.cos(theta), math.sin(theta)
        for k in range(n):
            a[k][p], a[k][q] = c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]
        for k in range(n):
            a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
        for k in range(n):
            v[k][p], v[k][q] = c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]
    best = max(range(n), key=lambda i: a[i][i])
    return tuple(v[k][best] for k in range(n))


def align(pairs):
    """The poses with the estimate moved onto the truth by the best similarity."""
    n = len(pairs)
    mean = lambda points: tuple(math.fsum(p[i] for p in points) / n for i in range(3))
    target_mean, source_mean = mean([a[1] for a, _ in pairs]), mean([b[1] for _, b in pairs])
    target = [minus(a[1], target_mean) for a, _ in pairs]
    source = [minus(b[1], source_mean) for _, b in pairs]
    m = [[math.fsum(s[i] * t[j] for s, t in zip(source, target)) for j in range(3)] for i in range(3)]
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    q = largest_eigenvector([[xx + yy + zz, yz - zy, zx - xz, xy - yx], [yz - zy, xx - yy - zz, xy + yx, zx + xz],
                             [zx - xz, xy + yx, yy - xx - zz, yz + zy], [xy - yx, zx + xz, yz + zy, zz - xx - yy]])
    turned = [rotate(q, s) for s in source]
    scale = (math.fsum(t[i] * s[i] for t, s in zip(target, turned) for i in range(3)) /
             math.fsum(x * x for s in source for x in s))
    move = lambda p: tuple(scale * r + t for r, t in zip(rotate(q, minus(p, source_mean)), target_mean))
    return [(a, (b[0], move(b[1]), multiply(q, b[2]))) for a, b in pairs], scale


def rmse(errors):
    return math.sqrt(math.fsum(e * e for e in errors) / len(errors))


def absolute_errors(pairs):
    return [math.dist(a[1], b[1]) for a, b in pairs]


def relative(first, second):
    """The motion from one pose to the other, in the frame of the first."""
    return (rotate(conjugate(first[2]), minus(second[1], first[1])), multiply(conjugate(first[2]), second[2]))


def relative_errors(pairs, ends=None):
    """(translation in m, rotation in deg) between consecutive poses, or those of the indices."""
    ends = range(len(pairs)) if ends is None else ends
    errors = []
    for i, j in zip(ends, ends[1:]):
        (true_t, true_q), (t, q) = (relative(pairs[i][k], pairs[j][k]) for k in (0, 1))
        turn = multiply(conjugate(true_q), q)
        angle = 2 * math.atan2(math.sqrt(sum(x * x for x in turn[1:])), abs(turn[0]))
        errors.append((math.dist(true_t, t), math.degrees(angle)))
    return errors


def ends_by_metres(pairs, delta):
    """Indices of poses that are so far apart along the estimate, as evo chooses them."""
    ends, path = [], 0.0
    for i in range(1, len(pairs)):
        path += math.dist(pairs[i][1][1], pairs[i - 1][1][1])
        if path >= delta:
            ends.append(i)
            path = 0.0
    return ends
