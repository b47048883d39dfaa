# SPDX-License-Identifier: Apache-2.0
"""Point sets of the shape (3, n) for the tests of the vote."""

import numpy as np
import pytest


def noisy_sheet(rows, columns, seed=0):
    """x, y and z of a surface with noise, (3, n), and the generator that made it."""
    generator = np.random.default_rng(seed)
    y, x = (axis.ravel() for axis in np.mgrid[:rows, :columns].astype(float))
    return np.array((x, y, generator.normal(0, 0.1, x.size))), generator


def contaminated_sheet(rows, columns, share=0.1, height=30.0):
    """The same, with a share of the points raised."""
    points, generator = noisy_sheet(rows, columns)
    points[2, generator.random(points.shape[1]) < share] += height
    return points


def hard_point_sets():
    """Named point sets, as test parameters: each would reveal a wrong bound, or a rank that is off by one."""
    for rows, columns in ((1, 2), (1, 3), (4, 8), (3, 11), (5, 13), (23, 29), (34, 34)):
        (x, y, z), generator = noisy_sheet(rows, columns)
        n = x.size
        far = generator.random(n) < 0.1
        named = {
            'flat': (x, y, 0 * z),
            'noisy': (x, y, z),
            'far from the origin': (x + 1e6, y - 1e7, z + 3),
            'lost in the offset': (x + 1e16, y - 1e17, z),
            'heights far above the pitch': (x, y, z * 1e7),
            'heights far below the pitch': (x, y, z * 1e-12),
            'quantized': (x, y, np.round(10 * z)),
            'all at one place': (0 * x, 0 * y, 0 * z),
            'groups at one place': (np.floor(x / 7), np.floor(y / 7), 0 * z),
            'on a line': (generator.random(n), 0 * y, 0 * z),
            'a ball': tuple(generator.normal(0, 1, (3, n))),
            'heavy tails': tuple(generator.standard_cauchy((3, n))),
            'every scale': (2.0 ** np.linspace(-300, 300, n), 2.0 ** np.linspace(300, -300, n), z),
            'two places': (np.where(far, 1e5, 0.0) + 1e-9 * x, y, z),
            'subnormal squares': (x * 1e-161, y * 1e-161, z * 1e-161),
            'infinite distances': (x * 1e153, y * 1e153, z),
            'one infinitely far': (np.where(np.arange(n) == n // 2, 1e200, x), y, z),
        }
        for height in (5.0, 50.0, 1e4, 1e9, 1e15):
            heights = np.where(far, generator.uniform(-height, height, n), z)
            named[f'outliers up to {height:g}'] = (x, y, heights)
        for name, points in named.items():
            yield pytest.param(np.array(points), id=f'{name} {rows}×{columns}')
