# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

import json

import click
import pytest
from click.testing import CliRunner

from socialcircle_ros.commands.main import socialcircle
from socialcircle_ros.commands.options import Number, parameter_options, parameter_values, size_in_bytes
from socialcircle_ros.errors import SettingError
from socialcircle_ros.messages.point_cloud import TYPE as CLOUD
from socialcircle_ros.recording import RecordingWriter, ros_topic

FILE = """\
/cell1/social_circle: {ros__parameters: {circle.window: 5, fixed_frame: map}}
/cell2/social_circle: {ros__parameters: {circle.window: 7}}
"""


@click.command()
@parameter_options
def show(params_file, parameters):
    click.echo(json.dumps(parameter_values(params_file, parameters)))


@pytest.fixture
def invoke(tmp_path):
    (tmp_path / 'cells.yaml').write_text(FILE)
    return lambda *arguments: CliRunner().invoke(show, ['--params-file', str(tmp_path / 'cells.yaml'), *arguments])


def test_the_node_chooses_among_the_sections_of_a_file(invoke):
    done = invoke('--node', '/cell2/social_circle')
    assert json.loads(done.output.splitlines()[-1]) == {'circle.window': 7}
    assert isinstance(invoke().exception, SettingError)


def test_a_file_may_set_parameters_that_are_unknown_here_and_this_is_told(invoke):
    done = invoke('--node', '/cell1/social_circle')
    assert json.loads(done.output.splitlines()[-1]) == {'circle.window': 5}
    assert 'Warning: there is no parameter fixed_frame' in done.output
    assert 'Did you mean' not in done.output


def test_a_misspelt_parameter_of_a_file_is_asked_back(tmp_path):
    (tmp_path / 'a.yaml').write_text('/**:\n  ros__parameters:\n    circle.windw: 5\n')
    done = CliRunner().invoke(show, ['--params-file', str(tmp_path / 'a.yaml')])
    assert 'has no effect. Did you mean circle.window?' in done.output


def test_single_parameters_override_the_file_and_have_the_types_of_ros(invoke):
    done = invoke('--node', '/cell2/social_circle', '-p', 'circle.window:=9', '-p', 'circle.radius:=1e-6')
    assert json.loads(done.output.splitlines()[-1]) == {'circle.window': 9, 'circle.radius': 1e-6}


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('circle.window=5', 'not of the form NAME:=VALUE'),
        ('circle.windw:=5', r'There is no parameter circle\.windw; did you mean circle\.window\?$'),
        ('mode:=paper', r'There is no parameter mode; did you mean circle\.mode\?$'),
        ('exposure:=5', r'There is no parameter exposure; the parameters are: .*circle\.mode,'),
        ('circle.window:=[5', 'it is not YAML'),
        ('circle.window:=', 'has no value'),
        ('circle.window:={a: 1}', 'it is a mapping'),
    ],
)
def test_a_text_that_sets_no_parameter_is_refused(text, sentence):
    with pytest.raises(SettingError, match=sentence):
        parameter_values(None, (text,))


@pytest.mark.parametrize('text', ['nan', 'inf', '-inf', '1e300'])
def test_a_number_is_finite(text):
    with pytest.raises(click.BadParameter, match='is no number up to'):
        Number().convert(text, None, None)


def test_no_command_takes_a_number_that_is_not_finite():
    def options(command):
        yield from command.params
        for name in command.list_commands(None) if isinstance(command, click.Group) else ():
            yield from options(command.get_command(None, name))

    plain = [
        option.opts
        for option in options(socialcircle)
        if isinstance(option.type, click.types.FloatParamType) and not isinstance(option.type, Number)
    ]
    assert plain == []


def test_a_size_of_hundreds_of_digits_is_refused():
    with pytest.raises(click.BadParameter, match='is no size'):
        size_in_bytes(None, None, '9' * 400)


def test_the_cloud_of_a_stack_is_in_the_namespace_of_its_cell(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        for name in ('/cell1/stack/points', '/cell1/stack/image', '/cell1/outlier_mask'):
            writer.add_topic(ros_topic(name, CLOUD))
    (tmp_path / 'cells.yaml').write_text(FILE)
    assert parameter_values(tmp_path / 'cells.yaml', (), tmp_path / 'a.mcap') == {'circle.window': 5}
