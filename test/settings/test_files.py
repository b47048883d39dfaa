"""Reading parameter files: generated ones, nested ones, and files that are not parameter files."""

import pytest

from socialcircle_ros.errors import SettingError, SocialCircleError
from socialcircle_ros.settings import PARAMETERS, yaml_text
from socialcircle_ros.settings.files import read_parameter_file

DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


def test_a_generated_file_is_read_back_unchanged(tmp_path):
    values = DEFAULTS | {'circle.radius': 1e-12, 'stack.joint': 'z: axis'}
    (tmp_path / 'a.yaml').write_text(yaml_text(values), encoding='utf-8')
    assert read_parameter_file(tmp_path / 'a.yaml') == values


def test_groups_may_be_nested_and_numbers_are_read_as_ros_reads_them(tmp_path):
    text = '/**:\n  ros__parameters:\n    circle: {window: 5, radius: 1e-6}\n    repair.sides: 2\n'
    (tmp_path / 'a.yaml').write_text(text)
    assert read_parameter_file(tmp_path / 'a.yaml') == {
        'circle.window': 5,
        'circle.radius': 1e-6,
        'repair.sides': 2,
    }


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (b'a: [', 'is not YAML'),
        (b'\xff\xfe\xfa', 'is not YAML'),
        (b'', 'holds no ros__parameters'),
        (b'[1, 2]', 'holds no ros__parameters'),
        (b'/**: {parameters: {}}', 'holds no ros__parameters'),
    ],
)
def test_a_file_without_parameters_is_refused(tmp_path, content, sentence):
    (tmp_path / 'a.yaml').write_bytes(content)
    with pytest.raises(SettingError, match=sentence):
        read_parameter_file(tmp_path / 'a.yaml')


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(SocialCircleError, match='nowhere.yaml cannot be read'):
        read_parameter_file(tmp_path / 'nowhere.yaml')
