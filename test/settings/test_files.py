# SPDX-License-Identifier: Apache-2.0
"""Reading parameter files for one node: generated ones, those of a whole cell, and other files."""

import pytest

from socialcircle_ros.errors import ParameterFileWarning, SettingError, SocialCircleError
from socialcircle_ros.settings import PARAMETERS, yaml_text
from socialcircle_ros.settings.files import read_parameter_file

DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}
NODE = 'social_circle'
TWO_CELLS = """\
/**: {ros__parameters: {repair.sides: 2}}
cell1:
  social_circle: {ros__parameters: {circle.window: 5}}
  camera: {ros__parameters: {exposure: 5}}
/cell2/social_circle: {ros__parameters: {circle.window: 7}}
"""


def read(path, text, node=NODE):
    path.write_text(text, encoding='utf-8')
    return read_parameter_file(path, node)


@pytest.fixture
def file(tmp_path):
    return tmp_path / 'a.yaml'


def test_a_generated_file_is_read_back_unchanged(file):
    values = DEFAULTS | {'circle.radius': 1e-12, 'stack.joint': 'z: axis'}
    assert read(file, yaml_text(values)) == values


def test_groups_may_be_nested_and_numbers_are_read_as_ros_reads_them(file):
    text = '/**:\n  ros__parameters:\n    circle: {window: 5, radius: 1e-6}\n    repair.sides: 2\n'
    assert read(file, text) == {'circle.window': 5, 'circle.radius': 1e-6, 'repair.sides': 2}


@pytest.mark.parametrize(
    ('node', 'window'), [('/cell1/social_circle', 5), ('/cell2/social_circle', 7), ('/cell3/social_circle', None)]
)
def test_a_file_of_several_cells_is_read_for_the_named_node(file, node, window):
    values = read(file, TWO_CELLS, node)
    assert values == {'repair.sides': 2} | ({'circle.window': window} if window else {})


def test_a_file_with_different_parameters_for_the_node_needs_its_full_name(file):
    with pytest.raises(
        SettingError, match=r'different parameters for /cell1/social_circle and /cell2/.*--node /cell1'
    ):
        read(file, TWO_CELLS)


def test_what_one_cell_has_for_itself_does_not_make_a_file_one_for_two_nodes(file):
    shared = '/**: {ros__parameters: {circle.window: 5}}\n'
    file.write_text(
        shared + '/cell1/social_circle: {ros__parameters: {measurements.cell: A, use_sim_time: true}}\n'
    )
    assert read_parameter_file(file, NODE, lambda: ['/cell2', '/cell1']) == {'circle.window': 5}


@pytest.mark.parametrize(
    ('namespaces', 'window'),
    [(['/cell1'], 5), (['/cell2'], 7), (['/cell2', '/cell2'], 7), ([''], None), (['/x'], None)],
)
def test_the_namespaces_of_a_recording_choose_among_the_sections(file, namespaces, window):
    file.write_text(TWO_CELLS)
    values = read_parameter_file(file, NODE, lambda: namespaces)
    assert values == {'repair.sides': 2} | ({'circle.window': window} if window else {})
    with pytest.raises(SettingError, match='different parameters for /cell1/social_circle and /cell2'):
        read_parameter_file(file, NODE, lambda: ['/cell1', '/cell2'])


@pytest.mark.parametrize(
    ('section', 'namespace'), [('social_circle', '/cellx'), ('/other/social_circle', '/cellx'), ('/cell1/*', '')]
)
def test_the_only_section_is_taken_if_it_is_for_another_namespace_than_the_recording_and_that_is_told(
    file, section, namespace
):
    file.write_text(f'{section}: {{ros__parameters: {{circle.window: 9}}}}\n')
    with pytest.warns(ParameterFileWarning, match=f'no parameters for {namespace}/social_circle, .* are taken'):
        assert read_parameter_file(file, NODE, lambda: [namespace]) == {'circle.window': 9}


@pytest.mark.parametrize(
    'section',
    ['/**', '/*', '*', '**', '/cell1/*', '/*/social_circle', '/**/social_circle', 'cell1/social_circle', NODE],
)
def test_the_only_section_for_the_node_is_taken_whichever_its_namespace(file, section):
    other = 'rviz: {ros__parameters: {fixed_frame: map}}\n'
    assert read(file, f'{other}"{section}": {{ros__parameters: {{circle.window: 5}}}}\n') == {'circle.window': 5}


def test_sections_with_the_same_parameters_need_no_name(file):
    text = ''.join(f'cell{i}: {{social_circle: {{ros__parameters: {{circle.window: 5}}}}}}\n' for i in range(3))
    assert read(file, text) == {'circle.window': 5}


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (b'a: {', 'it is not YAML'),
        (b'\xff\xfe\xfa', 'it is not YAML'),
        (b'', 'holds no ros__parameters'),
        (b'[1, 2]', 'line 1 has a list'),
        (b'/**: {parameters: {}}', 'holds no ros__parameters'),
        (b'/**: {ros__parameters: {}}', 'holds no ros__parameters'),
        (b'a: &x {ros__parameters: {circle.window: 5}}\nb: *x\n', 'an alias in line 2'),
        (b'rviz: {ros__parameters: {a: 1}}', r'no parameters for /social_circle, only for /rviz: .* --node'),
        (b'/**: {ros__parameters: {circle.vote_region: []}}', r'no value for circle\.vote_region'),
        pytest.param(b'#' * (16 * 2**20 + 1), 'too large', id='too large'),
    ],
)
def test_a_file_without_parameters_is_refused(file, content, sentence):
    file.write_bytes(content)
    with pytest.raises(SettingError, match=sentence):
        read_parameter_file(file, NODE)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(SocialCircleError, match='nowhere.yaml cannot be read'):
        read_parameter_file(tmp_path / 'nowhere.yaml', NODE)


@pytest.mark.parametrize(
    ('parameter', 'sentence'),
    [
        ('circle.radius_scale: "1.5"', "circle.radius_scale must be a number, not '1.5': write it without quotes"),
        ('output.mask: "true"', "output.mask must be true or false, not 'true': write it without quotes"),
        ('circle.window: 4', 'circle.window must be odd, not 4; use 3 or 5'),
        ('autostart: 1', 'autostart must be true or false, not 1'),
        ('circle.vote_region: [0.5, 1.5]', r'circle.vote_region must be 4 whole numbers, not \('),
    ],
)
def test_a_value_that_is_not_allowed_is_told_with_its_file(file, parameter, sentence):
    with pytest.raises(SettingError, match=rf'a\.yaml: {sentence}'):
        read(file, f'/**: {{ros__parameters: {{{parameter}}}}}')
    assert read(file, '/**: {ros__parameters: {circle.vote_region: [0, 0, 0, 0], circle.radius: 0.0}}')
