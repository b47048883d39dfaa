# SPDX-License-Identifier: Apache-2.0
"""Parameters of the live node: whole or not at all, with a reason."""

from dataclasses import replace

import pytest
import rclpy
import yaml
from examples import cloud
from live import RESULTS
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson

pytestmark = pytest.mark.live


def test_a_change_filters_the_last_cloud_again(cell):
    cell.set(circle__mode='paper')
    _, _, before = cell.clean(cloud())
    (result,) = cell.set(circle__radius_scale=100.0)
    assert result.successful
    _, _, after = cell.answer()
    assert int(before.values['outliers']) == 26
    assert int(after.values['outliers']) == 0
    assert after.values['circle.radius_scale'] == '100.0'
    assert after.values['stamp'] == before.values['stamp']


def test_the_network_judges_from_the_next_cloud_on(cell):
    cell.set(circle__judge='rules')
    cell.clean(cloud())
    (result,) = cell.set(circle__judge='network')
    assert result.successful, result.reason
    _, _, after = cell.answer()
    assert after.values['circle.judge'] == 'network'
    assert 20 <= int(after.values['outliers']) <= 32


def test_a_lesson_that_is_replaced_or_gone_is_in_force_until_it_is_set_again(cell, tmp_path):
    weights = (5.0, *(0.0,) * (WEIGHTS - 1))  # takes whatever is found for an outlier
    traits = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS)
    all_of_it = Lesson(('good.npz',), (0.5, 2.0), 'rules', 0.955, *traits, weights, 0.7, {})
    path = tmp_path / 'part.teach'
    path.write_text(all_of_it.to_text())
    cell.set(circle__mode='adaptive')
    assert cell.set(circle__lesson=str(path))[0].successful
    before = int(cell.clean(cloud())[2].values['outliers'])
    assert before > 0
    path.write_text(replace(all_of_it, weights=(-5.0, *weights[1:])).to_text())
    assert cell.set(silence=6.0)[0].successful
    assert int(cell.clean(cloud())[2].values['outliers']) == before
    cell.forget()
    assert cell.set(circle__lesson=str(path))[0].successful
    assert cell.answer()[2].values['outliers'] == '0'
    path.unlink()
    assert 'No such file' in cell.set(circle__lesson=str(path))[0].reason
    assert all(result.successful for result in cell.set(silence=5.0, circle__mode='paper', circle__lesson=''))


def test_without_reprocess_last_a_change_waits_for_the_next_cloud(cell):
    cell.set(circle__mode='paper')
    cell.clean(cloud())
    cell.set(reprocess_last=False)
    cell.set(circle__radius_scale=100.0)
    _, _, after = cell.clean(cloud(stamp=2_000_000_000))
    assert after.values['stamp'].startswith('2.')
    assert after.values['outliers'] == '0'


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('circle__window', 4, 'circle.window must be odd, not 4; use 3 or 5'),
        ('circle__window', 99, 'circle.window is 99, which is out of range: it must be between 3 and 31'),
        ('circle__window', 3.0, 'circle.window must be a whole number, not 3.0'),
        ('circle__mode', 'magic', 'use one of: paper'),
        ('circle__radius', -1.0, 'circle.radius is -1, which is out of range: it must be at least 0'),
        ('circle__radius', float('nan'), 'must be a finite number'),
        ('circle__radius_scale', 1e9, 'out of range'),
        ('circle__radius_scale', 'wide', 'must be a number'),
        ('circle__vote_region', [1, 2, 3], 'must be 4 whole numbers'),
        ('circle__vote_region', [0, 0, 5, 0], 'is empty'),
        ('circle__vote_region', [0, 0, 1000, 1000], 'at most 40000 can vote'),
        ('circle__radius', None, 'cannot be removed'),
        ('autostart', False, 'autostart is read-only; start the node with the value that it shall have.'),
        ('parameters_file', '/etc/profile.d/x.yaml', 'read-only'),
    ],
)
def test_a_change_that_cannot_be_is_refused_with_a_reason_and_nothing_changes(cell, name, value, reason):
    before = cell.get(name.replace('__', '.'))
    (result,) = cell.set(**{name: value})
    assert not result.successful
    assert reason in result.reason
    assert cell.get(name.replace('__', '.')) == before
    _, _, measurement = cell.clean(cloud())
    assert measurement.values['outliers'] == '26'


def test_changes_asked_for_together_come_together_or_not_at_all(cell):
    refused = cell.set_together(circle__radius_scale=2.0, circle__vote_region=[0, 0, 0, 7])
    assert not refused.successful
    assert cell.get('circle.radius_scale') == 1.0
    accepted = cell.set_together(circle__radius_scale=2.0, circle__vote_region=[0, 0, 60, 60])
    assert accepted.successful
    _, _, measurement = cell.clean(cloud())
    assert measurement.values['circle.radius_scale'] == '2.0'
    assert measurement.values['circle.vote_region'] == '[0, 0, 60, 60]'


def test_a_whole_number_serves_as_a_real_one(cell):
    (result,) = cell.set(circle__radius_scale=2)
    assert result.successful
    _, _, measurement = cell.clean(cloud())
    assert measurement.values['circle.radius_scale'] == '2.0'


def test_a_parameter_that_there_is_not_is_refused_with_the_one_that_may_be_meant(cell):
    sentences = [result.reason for result in cell.set(circle__windw=5, nonsense=1)]
    assert sentences == ['There is no parameter circle.windw; did you mean circle.window?',
                         'There is no parameter nonsense.']  # fmt: skip
    refused = cell.set_together(circle__window=5, window=5)
    assert refused.reason == 'There is no parameter window; did you mean circle.window?'
    assert cell.get('circle.window') == 3


def test_a_value_of_a_type_that_ros_does_not_have_is_refused(cell):
    unknown = ParameterMessage(name='circle.window', value=ParameterValue(type=77))
    request = SetParameters.Request(parameters=[unknown, *cell.messages({'silence': 6.0})])
    refused, accepted = cell.call(SetParameters, 'set_parameters', request).results
    assert refused.reason == 'circle.window cannot be set: ROS has no values of type 77.'
    assert accepted.successful
    together = SetParametersAtomically.Request(parameters=request.parameters)
    assert not cell.call(SetParametersAtomically, 'set_parameters_atomically', together).result.successful
    cell.forget()
    assert cell.diagnosis(lambda found: found).values['clouds_failed'] == '0'
    cell.set(silence=5.0)


def test_no_value_changes_the_type_that_a_parameter_describes(cell):
    for value in ('wide', None, 2):
        cell.set(circle__radius_scale=value)
        assert cell.describe('circle.radius_scale').type == ParameterType.PARAMETER_DOUBLE
    assert cell.get('circle.radius_scale') == 2.0


def test_every_parameter_describes_itself(cell):
    for name, row in PARAMETERS.items():
        descriptor = cell.describe(name)
        assert row.sentence in descriptor.description
        assert descriptor.additional_constraints == row.allowed
    window = cell.describe('circle.window').integer_range[0]
    assert (window.from_value, window.to_value, window.step) == (3, 31, 2)
    scale = cell.describe('circle.radius_scale').floating_point_range[0]
    assert (scale.from_value, scale.to_value) == (0.01, 100.0)


def test_what_is_saved_starts_a_node_with_the_same_parameters_and_gives_a_cell_to_no_other(start_cell, tmp_path):
    path = tmp_path / 'saved' / 'tuned.yaml'
    override = 'qos_overrides./camera/points.subscription.reliability'
    of_cell = {
        'parameters_file': str(path), 'measurements.cell': 'line A', 'measurements.folder': str(tmp_path / 'rows'),
    }  # fmt: skip
    first = start_cell(of_cell | {override: 'best_effort'}, ('-r', 'points:=/camera/points'), active=False)
    first.wait_for_state('active')
    first.set(
        circle__radius_scale=3, circle__vote_region=[1, 2, 61, 62], measurements__part='P7', use_sim_time=True
    )
    saved = first.trigger('save_parameters')
    assert saved.success
    assert str(path) in saved.message
    content = yaml.safe_load(path.read_text())
    assert set(content) == {'/**', first.name}
    assert not any(name.startswith('qos_overrides') for name in content['/**']['ros__parameters'])
    assert content[first.name]['ros__parameters'][override] == 'best_effort'
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    again = Node('social_circle', namespace=first.namespace, context=context)
    try:
        read = {name: item.value for name, item in again._parameter_overrides.items()}
    finally:
        again.destroy_node()
        rclpy.shutdown(context=context)
    assert read.items() >= (of_cell | {'measurements.part': 'P7', override: 'best_effort'}).items()
    assert read['use_sim_time'] is True
    second = start_cell(arguments=('--params-file', str(path)))
    assert second.get('circle.radius_scale') == 3.0
    assert second.get('circle.vote_region') == [1, 2, 61, 62]
    assert [second.get(name) for name in (*of_cell, 'measurements.part')] == [''] * 4
    assert second.get('use_sim_time') is False


@pytest.mark.parametrize('path', ['/proc/nowhere/tuned.yaml', '~nobody_here/tuned.yaml'])
def test_a_file_that_cannot_be_written_is_told(start_cell, path):
    cell = start_cell({'parameters_file': path})
    saved = cell.trigger('save_parameters')
    assert not saved.success
    assert path.split('/')[-2] in saved.message
    assert cell.state() == 'active'


def test_a_cloud_that_was_refused_for_a_setting_is_filtered_once_that_is_mended(cell):
    cell.set(circle__vote_region=[900, 900, 60, 60])
    cell.publish(cloud(stamp=7_000_000_000))
    cell.diagnosis(lambda found: found.values['clouds_refused'] == '1')
    cell.set(circle__vote_region=[0, 0, 0, 0])
    _, _, measurement = cell.answer()
    assert measurement.values['stamp'].startswith('7.')


def test_a_change_that_concerns_no_cloud_publishes_none_again(cell):
    cell.clean(cloud())
    cell.set(silence=6.0)
    cell.set(stack__frames=7)
    cell.set(stack__frames=0, silence=5.0)
    cell.forget()
    cell.diagnosis(lambda found: found)
    assert not any(cell.inbox[result] for result in RESULTS)


def test_the_shipped_parameter_file_starts_the_node(start_cell, request):
    path = request.config.rootpath / 'config' / 'social_circle.yaml'
    cell = start_cell(arguments=('--params-file', str(path)))
    assert cell.get('circle.window') == 3
    assert cell.get('circle.radius') == 0.0


@pytest.mark.parametrize(
    ('parameters', 'sentence'),
    [
        ({'circle.window': '4'}, 'circle.window'),
        ({'circle.mode': 'magic'}, "circle.mode cannot be 'magic'; use one of: paper"),
        ({'circle.radius': '-2'}, 'circle.radius is -2, which is out of range'),
        ({'parameters_file': '/etc/profile.d/x.sh'}, 'parameters_file must end in .yaml'),
    ],
)
def test_a_node_that_is_started_with_what_cannot_be_says_so_and_ends(start_cell, parameters, sentence):
    cell = start_cell(parameters, active=False)
    cell.wait_for(lambda: cell.node_process.process.poll() is not None)
    assert cell.node_process.process.poll() == 1
    log = cell.node_process.log.read_text()
    assert 'The node cannot start' in log
    assert sentence in log
    assert 'Traceback' not in log


def test_a_misspelled_parameter_is_told(start_cell):
    topics = ('/camera/pionts.subscription', '/camera/points.subscription', '/another_cell/points.subscription',
              '/another_cell/points.publisher')  # fmt: skip
    overrides = [f'qos_overrides.{topic}.reliability' for topic in topics]
    given = {'circle.raduis': '1.0', 'circle.radius': '2', **dict.fromkeys(overrides, 'reliable')}
    cell = start_cell(given, ('-r', 'points:=/camera/points'), active=False)
    cell.wait_for_state('active')
    log = cell.node_process.log.read_text()
    assert 'There is no parameter circle.raduis' in log
    assert f'There is no parameter {overrides[0]}' in log
    assert overrides[1] not in log
    assert overrides[2] not in log  # a file may be for several cells
    assert f'There is no parameter {overrides[3]}' in log  # the node publishes on stack/points alone
    assert cell.get('circle.radius') == 2


def test_a_change_while_nothing_was_received_publishes_nothing(cell):
    cell.set(circle__radius_scale=2.0)
    cell.diagnosis(lambda found: found.values['clouds_received'] == '0')
    assert not any(cell.inbox[result] for result in RESULTS)


def test_reset_forgets_the_last_cloud_and_the_counts(cell):
    cell.clean(cloud())
    assert cell.trigger('reset').success
    cell.forget()
    cell.set(circle__radius_scale=2.0)
    found = cell.diagnosis(lambda found: found.values['clouds_published'] == '0')
    assert found.values['clouds_received'] == '0'
    assert not any(cell.inbox[result] for result in RESULTS)
