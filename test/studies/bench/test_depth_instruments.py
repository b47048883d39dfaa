# SPDX-License-Identifier: Apache-2.0
"""The quality holds what it promises on instruments that differ; the chosen scale is as good as a fixed one."""

import pytest

from socialcircle_ros.studies.bench.depth_instruments import BOUNDS, CASES, calibrations, scale_figures


@pytest.fixture(scope='module')
def found():
    return {each.name: each for each in calibrations((45,), (130, 150))}


@pytest.mark.parametrize('case', [case.name for case in CASES])
def test_of_pixels_with_a_quality_at_least_as_many_are_good(found, case):
    for bound in BOUNDS:
        pixels, good = found[case].shares[bound]
        # Errors of neighbours are alike: of one small stack the share is known to a hundredth.
        assert pixels < 0.01 or good >= bound - 0.01, (bound, pixels, good)


def test_textured_pixels_are_trusted(found):
    least = {case.name: 0.75 for case in CASES if case.camera.exposure > 0.5 or case.specimen != 'flat'}
    least['steep groove, 20x, a fifth of the light'] = 0.6
    assert not [name for name, share in least.items() if found[name].shares[0.9][0] < share]
    assert {each.step for each in found.values()} == {2, 4}


def test_the_chosen_scale_is_about_as_good_as_the_best_fixed_one():
    rows = {(row.name, row.asked): row for row in scale_figures((46,), (130, 150))}
    for name in ('10x', 'oversampled 4×'):
        chosen = rows[name, 0]
        best = max((rows[name, step] for step in (1, 2, 4, 8)), key=lambda row: row.trusted)
        assert chosen.trusted > best.trusted - 0.05
        assert chosen.rms < 1.5 * min(rows[name, step].rms for step in (2, 4, 8))
    assert (rows['10x', 0].used, rows['oversampled 4×', 0].used) == (2, 4)
    assert rows['oversampled 4×', 2].trusted < 0.5
    assert rows['oversampled 4×', 0].trusted > 0.9
