# SPDX-License-Identifier: Apache-2.0
"""The memory of a stack stays within what is promised."""

from socialcircle_ros.studies.bench import depth_cost


def test_a_pixel_takes_what_the_documentation_says(monkeypatch):
    monkeypatch.setattr(depth_cost, 'SHAPES', ((700, 900),))
    monkeypatch.setattr(depth_cost, 'usable_cores', lambda: 1)
    plain, registered = depth_cost.frame_costs()
    assert plain.running_bytes < 63.5  # 62 for large frames
    assert plain.peak_bytes < 90
    assert plain.running_bytes + 0.9 < registered.running_bytes < plain.running_bytes + 5
    assert min(plain.processor_ms, plain.frames_per_s, plain.finish_s) > 0
