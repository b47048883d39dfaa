# SPDX-License-Identifier: Apache-2.0
"""Two settings on the same clouds."""

import numpy as np
import pytest
from examples import surface

from socialcircle_ros.formats import MeasuredSurface, write_surface
from socialcircle_ros.report.compare import make_comparison
from socialcircle_ros.settings import CircleSettings, PipelineSettings

pytest.importorskip('matplotlib')


def test_a_file_has_its_name_and_each_warning_the_setting_that_it_is_of(tmp_path):
    write_surface(tmp_path / 'part.npz', MeasuredSurface(np.array(surface()[..., 2]), (1e-6, 1e-6), 'm'))
    strict = PipelineSettings(circle=CircleSettings(mode='paper', radius=1e-12))
    mild = PipelineSettings(circle=CircleSettings(mode='paper', radius_scale=1.5))
    compared = make_comparison(tmp_path / 'part.npz', tmp_path / 'ab.html', ('s.yaml', strict), ('m.yaml', mild))
    (found,) = compared.clouds
    assert found.name == 'part.npz'
    warnings = [warning for warning in found.warnings if warning.startswith('A: ')]
    assert any('The outliers are more than half of the points' in warning for warning in warnings)
    page = (tmp_path / 'ab.html').read_text(encoding='utf-8')
    for warning in found.warnings:
        assert f'<li>part.npz: {warning}' in page
        assert f'<li>{warning}' in page
    assert '100.00 %' not in page
