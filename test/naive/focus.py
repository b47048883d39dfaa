"""Slow, obvious references for the focus measure and the fit of its peak."""

import math

import numpy as np


def modified_laplacian(frame, x, y, s):
    """M_l of eq. 1; a direction without both neighbours counts 0."""
    height, width = frame.shape
    value = lambda row, column: int(frame[row, column])  # noqa: E731
    across = abs(2 * value(y, x) - value(y, x - s) - value(y, x + s)) if s <= x < width - s else 0
    along = abs(2 * value(y, x) - value(y - s, x) - value(y + s, x)) if s <= y < height - s else 0
    return across + along


def focus_measure(frame, step, half_window, threshold):
    """F of eq. 2, over the part of the window that lies in the frame; M_l below T counts 0 (eq. 3)."""
    height, width = frame.shape
    laplacian = np.array(
        [[modified_laplacian(frame, x, y, step) for x in range(width)] for y in range(height)], np.int64
    )
    laplacian[laplacian < threshold] = 0
    n = half_window
    return np.array(
        [
            [laplacian[max(y - n, 0) : y + n + 1, max(x - n, 0) : x + n + 1].sum() for x in range(width)]
            for y in range(height)
        ]
    )


def peak_of_three(z, f):
    """The peak of the Gaussian through three points (Nayar and Nakagawa 1994)."""
    (z0, z1, z2), (y0, y1, y2) = z, (math.log(value) for value in f)
    up, down = (y1 - y0) / (z1 - z0), (y2 - y1) / (z2 - z1)
    curvature = (down - up) / (z2 - z0)
    return (z0 + z1) / 2 - up / (2 * curvature)


def peak_of_curve(z, f, places):
    """The peak of the log-parabola round the sharpest frame, frames weighing (1 + ln(F / F_peak))²."""
    order = np.argsort(z, kind='stable')
    z, f = np.asarray(z, float)[order], np.asarray(f, float)[order]
    best = int(np.argmax(f))
    near = [k for k in range(best - places, best + places + 1) if 0 <= k < len(f) and f[k] > 0]
    y = np.array([math.log(f[k] / f[best]) for k in near])
    weights = np.maximum(1 + y, 0) ** 2
    weights = np.array([max(w, 0.01) if abs(k - best) <= 1 else w for w, k in zip(weights, near, strict=True)])
    c, b, _ = np.polyfit(z[near] - z[best], y, 2, w=np.sqrt(weights))
    return z[best] - b / (2 * c)
