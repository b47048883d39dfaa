# SPDX-License-Identifier: Apache-2.0
"""Slow, obvious references: the focus measure (eq. 1 to 3), the fit of its peak, the centroid correction."""

import math

import numpy as np


def modified_laplacian(frame, x, y, s):
    """M_l of eq. 1; a direction counts as 0 if one of its neighbours is outside the frame."""
    height, width = frame.shape
    value = lambda row, column: int(frame[row, column])  # noqa: E731
    across = abs(2 * value(y, x) - value(y, x - s) - value(y, x + s)) if s <= x < width - s else 0
    along = abs(2 * value(y, x) - value(y - s, x) - value(y + s, x)) if s <= y < height - s else 0
    return across + along


def focus_measure(frame, step, half_window, threshold):
    """F of eq. 2 over the part of the window in the frame; M_l below T counts as 0 (eq. 3)."""
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
    """The peak of the Gaussian through three points (Nayar and Nakagawa 1994, DOI 10.1109/34.308479)."""
    (z0, z1, z2), (y0, y1, y2) = z, (math.log(value) for value in f)
    up, down = (y1 - y0) / (z1 - z0), (y2 - y1) / (z2 - z1)
    curvature = (down - up) / (z2 - z0)
    return (z0 + z1) / 2 - up / (2 * curvature)


def peak_of_curve(z, f, places):
    """The peak of the parabola through ln F near the sharpest frame, with weights (1 + ln(F / F_peak))²."""
    order = np.argsort(z, kind='stable')
    z, f = np.asarray(z, float)[order], np.asarray(f, float)[order]
    best = int(np.argmax(f))
    near = [k for k in range(best - places, best + places + 1) if 0 <= k < len(f) and f[k] > 0]
    y = np.array([math.log(f[k] / f[best]) for k in near])
    weights = np.maximum(1 + y, 0) ** 2
    weights = np.array([max(w, 0.01) if abs(k - best) <= 1 else w for w, k in zip(weights, near, strict=True)])
    c, b, _ = np.polyfit(z[near] - z[best], y, 2, w=np.sqrt(weights))
    return z[best] - b / (2 * c)


def correct_for_centroid(depth, quality, image, z, step, half, threshold, strip=4):
    """Each depth less the slope in its window times the centroid of the texture."""
    height, width = depth.shape
    if half == 0 or min(height, width) < 2 * half + 1:
        return depth
    scale = np.median(np.diff(z))
    texture = focus_measure(image, step, 0, threshold)
    result = depth.copy()
    for row, column in np.ndindex(height, width):
        rows = np.arange(max(row - half, 0), min(row + half, height - 1) + 1)
        columns = np.arange(max(column - half, 0), min(column + half, width - 1) + 1)
        weights = texture[np.ix_(rows, columns)]
        if weights.sum() == 0:
            continue
        right = (weights * (columns - column)).sum() / weights.sum()
        down = (weights * (rows - row)[:, None]).sum() / weights.sum()
        middle = (
            int(np.clip(row // strip * strip + strip // 2, half, height - 1 - half)),
            int(np.clip(column, half, width - 1 - half)),
        )
        along_y, along_x = slopes(depth / scale, quality, middle, half)
        moved = depth[row, column] - (right * along_x + down * along_y) * scale
        if z[0] <= moved <= z[-1]:
            result[row, column] = moved
    return result


def slopes(depth, quality, middle, half):
    """Slopes down and to the right, from the means of the halves of the window; 0 where they are not known."""
    row, column = middle
    window = np.s_[row - half : row + half + 1, column - half : column + half + 1]
    values = np.where(quality[window] >= 0.5, depth[window], np.nan)
    parts = [values[:half], values[half + 1 :], values[:, :half], values[:, half + 1 :]]
    if np.isnan(values[half, half]) or any(2 * np.isfinite(part).sum() < part.size for part in parts):
        return 0.0, 0.0
    top, bottom, left, right = (np.nanmean(part) for part in parts)
    if max(abs((top + bottom) / 2 - values[half, half]), abs((left + right) / 2 - values[half, half])) > 0.5:
        return 0.0, 0.0
    return (bottom - top) / (half + 1), (right - left) / (half + 1)


def codes_of(measure, scale=1.0):
    """Codes of F times a scale as the kernel rounds them: 1 + 2048 log2 F, all steps in single precision."""
    f32 = np.float32
    rounded = np.asarray(measure, np.int32).astype(f32)
    bits = rounded.view(np.int32)
    t = (bits & 0x7FFFFF).astype(f32) * f32(2**-23)
    q = f32(-0.04400469) * t + f32(0.14631434)
    q = q * t + f32(-0.26602988)
    q = q * t + f32(0.4417403)
    octaves = ((bits >> 23) - 127).astype(f32) + (t + t * (f32(1) - t) * q)
    offset = f32(2048 * math.log2(scale))
    return np.clip((octaves * f32(2048) + (offset + f32(1.5))).astype(np.int32), 1, 65535)


def kept_of_curve(codes, reach=8):
    """What is kept of one curve: sharpest frame, codes by their distance from it, lowest, and highest elsewhere.

    Args:
        codes: (n,) of all frames, in order of z.
        reach: frames kept on either side of the sharpest one.
    """
    centre = int(np.argmax(codes))
    near = {k: int(code) for k, code in enumerate(codes) if abs(k - centre) <= reach}
    others = [int(code) for k, code in enumerate(codes) if k not in near]
    return centre, near, int(min(codes)), max(others, default=0)


def scale_of(frame):
    """What makes the mean of all pixels a quarter of the range."""
    return (64 if frame.dtype == np.uint8 else 16384) / max(float(frame.mean(dtype=np.float64)), 1)


def effective_share(image, step, half):
    """The effective number of pixels with texture in each window, as a share of it; NaN: none has texture."""
    height, width = image.shape
    texture = focus_measure(image, step, 0, 0).astype(float)
    shares = np.full((height, width), np.nan)
    for row, column in np.ndindex(height, width):
        window = texture[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
        if window.any():
            shares[row, column] = window.sum() ** 2 / (window**2).sum() / window.size
    return shares


def quality_where_bent(depth, quality, half, bent):
    """The quality, with odds divided by 1 + (distance from the mean of the window / bent)²."""
    result = quality.astype(float)
    for row, column in np.ndindex(depth.shape):
        window = np.s_[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
        counted = depth[window][quality[window] >= np.float32(0.3)]
        if quality[row, column] > 0 and counted.size:
            q = float(quality[row, column])
            result[row, column] = q / (1 + (1 - q) * ((counted.mean() - depth[row, column]) / bent) ** 2)
    return result
