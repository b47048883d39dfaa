# SPDX-License-Identifier: Apache-2.0
"""The figures about order, losses, light, drift and blank areas hold."""

from socialcircle_ros.studies.bench.depth_trust import trust_rows


def test_stacks_are_trustworthy():
    """One seed; the bounds are the goals."""
    rows = {(row.name, row.figure): row.value for row in trust_rows((32,))}
    assert rows['upward or downward', 'pixels that differ from depth_from_focus'] == 0
    assert rows['shuffled', 'of these, with a quality above 0.5'] == 0
    for lost in ('every 7th frame lost, z counted', '3 frames in a row lost, z counted'):
        assert rows[lost, 'pixels of quality >= 0.9 that are bad'] < 0.1
    steady = rows['steady lamp', 'RMS error']
    assert rows['flicker of 5 %', 'RMS error'] < 1.1 * steady
    assert rows['flicker of 5 %, focus.normalize false', 'RMS error'] > 1.1 * steady
    for motion in ('drift of 5 px', '2 % of magnification', 'drift of 5 px and 3 % of magnification'):
        corrected = rows[f'macro lens, {motion}, stack.register', 'RMS error']
        assert corrected < 0.5 * rows[f'macro lens, {motion}', 'RMS error']
        assert corrected < 1.5 * rows['macro lens, drift of 1 px, stack.register', 'RMS error']
    blank = [value for (name, figure), value in rows.items() if name.startswith('blank') and '0.9' in figure]
    assert max(blank) <= 0.01
