# SPDX-License-Identifier: Apache-2.0
"""What the names of recordings mean."""

from pathlib import Path

import pytest

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.recording import RecordingWriter, open_recording
from socialcircle_ros.recording.names import found_parameters, is_mcap_name, parameters_beside


@pytest.mark.parametrize('name', ['a.mcap', 'A.MCAP', 'out/x.y.Mcap'])
def test_mcap_in_any_case_is_a_file(name):
    assert is_mcap_name(Path(name))


@pytest.mark.parametrize('name', ['night', 'night.2026-11-29', 'cell.1', 'a.b', '.hidden', '..', 'part.of_nights'])
def test_a_name_without_a_suffix_of_a_file_is_a_directory(name):
    assert not is_mcap_name(Path(name))


@pytest.mark.parametrize('name', ['a.png', 'a.mcpa', 'a.mcap.zstd', 'a.db3', 'a.x3p', 'a.PLY'])
def test_the_suffix_of_another_file_is_refused(tmp_path, name):
    with pytest.raises(RecordingError, match=r'because it ends in \.\w+: give a name that ends in \.mcap'):
        RecordingWriter(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_recording_in_a_directory_with_such_a_name_can_be_replaced(tmp_path):
    with RecordingWriter(tmp_path / 'bag') as writer:
        writer.close()
    (tmp_path / 'bag').rename(tmp_path / 'bag.v2')
    with pytest.raises(RecordingError, match='exists already'):
        RecordingWriter(tmp_path / 'bag.v2')
    RecordingWriter(tmp_path / 'bag.v2', overwrite=True).close()
    with open_recording(tmp_path / 'bag.v2') as reader:
        assert reader.message_count == 0


@pytest.mark.parametrize(
    ('recording', 'parameters'),
    [
        ('out/groove.mcap', 'out/groove.yaml'),
        ('GROOVE.MCAP', 'GROOVE.yaml'),
        ('night.2026-11-29', 'night.2026-11-29.yaml'),
        ('night', 'night.yaml'),
        ('a.mcap.zstd', 'a.yaml'),
    ],
)
def test_parameters_have_the_name_of_their_recording(recording, parameters):
    assert parameters_beside(Path(recording)) == Path(parameters)


def test_parameters_are_found_beside_a_recording_that_is_there(tmp_path):
    recording, parameters = tmp_path / 'a.mcap', tmp_path / 'a.yaml'
    parameters.touch()
    assert found_parameters(recording) is None
    recording.touch()
    assert found_parameters(recording) == parameters
    parameters.unlink()
    parameters.mkdir()
    assert found_parameters(recording) is None
