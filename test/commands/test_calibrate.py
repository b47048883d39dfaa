# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest
from click.testing import CliRunner

from socialcircle_ros.commands.calibrate import command
from socialcircle_ros.recording import calibration


@pytest.mark.parametrize(
    ('text', 'metres'),
    [('10um', 1e-5), ('10 µm', 1e-5), ('10μm', 1e-5), ('0.001cm', 1e-5), ('1e7pm', 1e-5), ('0.01 mm', 1e-5)],
)
def test_the_period_of_a_grating_takes_every_known_unit(monkeypatch, text, metres):
    periods = []

    def measure_pitch(_, period):
        periods.append(period)
        return calibration.GratingPitch(1e-6, 10.0, 0.0, 20.0)

    monkeypatch.setattr(calibration, 'read_gray', lambda path: None)
    monkeypatch.setattr(calibration, 'measure_pitch', measure_pitch)
    done = CliRunner().invoke(command, ['pitch', 'grating.png', '--period', text], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert periods == pytest.approx([metres])


@pytest.mark.parametrize('text', ['10', 'um', '0um', '10 pixels', '1.2.3um', '-1um'])
def test_a_period_that_is_no_length_is_refused(text):
    done = CliRunner().invoke(command, ['pitch', 'grating.png', f'--period={text}'])
    assert done.exit_code == 2
    assert f'{text!r} is no length; give a number and a unit, such as 10um.' in ' '.join(done.output.split())


def test_what_the_latency_leaves_out_is_told(monkeypatch):
    found = calibration.Latency(
        0.004, 1, 0.0, 1e-6, 0.0, {'A frame was refused: cut.': 2}, 'scans.mcap is damaged.'
    )
    monkeypatch.setattr(calibration, 'measure_latency', lambda *_: found)
    recording = str(Path(__file__).parents[2] / 'bags' / 'stack.mcap')
    done = CliRunner().invoke(command, ['latency', recording], catch_exceptions=False)
    assert done.stdout.splitlines()[-1] == 'Set stack.latency: 0.004000'
    assert done.stderr.splitlines()[-2:] == [
        'Refused, 2 times: A frame was refused: cut.',
        'Warning: scans.mcap is damaged.',
    ]
