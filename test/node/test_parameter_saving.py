# SPDX-License-Identifier: Apache-2.0
"""Saving the node's parameters: the path, the text, and an executor that goes on meanwhile."""

import array
import os
import threading

import pytest
import rclpy
import yaml
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.node import parameter_saving
from socialcircle_ros.node.parameter_saving import ParameterSaver, parameter_path, parameter_text
from socialcircle_ros.settings import PARAMETERS

DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}
AWKWARD = [
    '$(command)', 'yes', 'null', '1e3', '0x10', '~', '', ' ', '- a', '{a: b}', '[', "it's", 'a"b\\',
    '# no comment', '*alias', '&anchor', '!!python/object:os.system', 'a: b', 'two\nlines\n', '\ttab',
    'größe', '😀', '%TAG', '---', '\x7f\x85\u2028\ufeff',
]  # fmt: skip


class Saving(Node):
    """A node with the service alone, and a timer that counts."""

    def __init__(self, context, saver, values):
        super().__init__('saving', namespace='/cell', context=context)
        self.ticks = 0
        self.create_timer(0.01, self._tick)
        self.saver, self.values = saver, values
        group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, '~/save_parameters', self._save, callback_group=group)

    def _tick(self):
        self.ticks += 1

    async def _save(self, _, response):
        response.success, response.message = await self.saver.save(self, self.values)
        return response


@pytest.fixture
def call(monkeypatch, tmp_path):
    """Calls the service of a new node, and gives the answer."""
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'ros'))
    with_context = []

    def call(saver, values, meanwhile=lambda node: True):
        context = rclpy.Context()
        rclpy.init(context=context)
        node, executor = Saving(context, saver, DEFAULTS | values), SingleThreadedExecutor(context=context)
        with_context.append((context, node))
        client = node.create_client(Trigger, '~/save_parameters')
        executor.add_node(node)
        assert client.wait_for_service(30)
        future = client.call_async(Trigger.Request())
        for _ in range(3000):
            executor.spin_once(timeout_sec=0.01)
            if future.done() and meanwhile(node):
                break
        return future.result()

    yield call
    for context, node in with_context:
        node.destroy_node()
        rclpy.shutdown(context=context)


def test_the_file_that_is_given_is_written(call, tmp_path):
    path = tmp_path / 'new' / 'tuned.yaml'
    answer = call(ParameterSaver(), {'parameters_file': str(path), 'circle.window': 5})
    assert answer.success
    assert answer.message == f'Saved to {path}; start with --ros-args --params-file {path}.'
    content = yaml.safe_load(path.read_text())
    shared, own = content['/**']['ros__parameters'], content['/cell/saving']['ros__parameters']
    assert shared | own == DEFAULTS | {'parameters_file': str(path), 'circle.window': 5}
    assert set(own) == {'measurements.folder', 'measurements.cell', 'measurements.part', 'parameters_file'}
    assert not set(shared) & set(own)
    assert list(path.parent.iterdir()) == [path]


def test_without_a_given_file_it_is_named_after_the_node(call, tmp_path):
    assert call(ParameterSaver(), {}).success
    assert (tmp_path / 'ros' / 'socialcircle' / 'cell.saving.yaml').is_file()


def a_link(path):
    (path.parent / 'profile').write_text('old')
    path.symlink_to(path.parent / 'profile')


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (a_link, 'is a symbolic link, and is not overwritten'),
        (os.mkfifo, 'is a named pipe, and is not overwritten'),
        (os.mkdir, 'is a directory, and is not overwritten'),
    ],
)
def test_what_is_not_a_file_is_refused_and_left(call, tmp_path, make, reason):
    path = tmp_path / 'tuned.yaml'
    make(path)
    before = path.lstat(), [entry.read_text() for entry in tmp_path.glob('profile')]
    answer = call(ParameterSaver(), {'parameters_file': str(path)})
    assert not answer.success
    assert reason in answer.message
    assert (path.lstat(), [entry.read_text() for entry in tmp_path.glob('profile')]) == before
    assert not list(tmp_path.glob('*.partial'))


@pytest.mark.parametrize(
    ('path', 'reason'),
    [
        ('/proc/nowhere/tuned.yaml', 'The parameters were not saved: /proc/nowhere cannot be made'),
        ('~nobody_here/tuned.yaml', 'The home directory of ~nobody_here/tuned.yaml is not known'),
        ('/dev/null/tuned.yaml', 'The parameters were not saved'),
        ('a\0b.yaml', 'The parameters were not saved'),
    ],
)
def test_a_file_that_cannot_be_written_is_told(call, path, reason):
    answer = call(ParameterSaver(), {'parameters_file': path})
    assert not answer.success
    assert reason in answer.message


def test_a_disk_that_does_not_answer_holds_up_neither_the_node_nor_the_caller(call, monkeypatch):
    released = threading.Event()
    monkeypatch.setattr(parameter_saving, 'write_file', lambda path, text: released.wait(60))
    saver = ParameterSaver(timeout_s=2.0)
    ticks = []
    answer = call(saver, {}, lambda node: ticks.append(node.ticks) or True)
    assert not answer.success
    assert answer.message == 'The parameters were not saved within 2 s: check the disk.'
    assert ticks[0] > 3
    busy = call(saver, {})
    assert busy.message == 'The parameters were not saved: the disk still has not written the last file.'
    released.set()
    assert saver._idle.acquire(timeout=30)  # the thread of the first call has ended
    saver._idle.release()
    assert call(saver, {}).success


def test_a_machine_without_a_thread_left_is_told_and_the_next_call_saves(call, monkeypatch):
    def fail(_):
        raise RuntimeError('no thread is left')

    saver = ParameterSaver()
    with monkeypatch.context() as patch:
        patch.setattr('threading.Timer.start', fail)
        answer = call(saver, {})
    assert not answer.success
    assert answer.message == 'The parameters were not saved: no thread is left.'
    assert call(saver, {}).success


def test_a_fault_is_an_answer(call, monkeypatch):
    monkeypatch.setattr(parameter_saving, 'write_file', lambda path, text: 1 / 0)
    answer = call(ParameterSaver(), {})
    assert answer.message == 'The parameters were not saved: ZeroDivisionError: division by zero'


@pytest.mark.parametrize('text', AWKWARD)
def test_every_text_is_read_back_by_yaml_and_by_ros(tmp_path, text):
    overrides = {
        'qos_overrides./points.subscription.reliability': text,
        'qos_overrides./points.subscription.depth': 1,
        'qos_overrides./points.subscription.times': array.array('q', [1, 2]),
    }
    path = tmp_path / 'saved.yaml'
    path.write_text(parameter_text(DEFAULTS | {'stack.joint': text}, '/cell/node', overrides), encoding='utf-8')
    content = yaml.safe_load(path.read_text(encoding='utf-8'))
    assert content['/**']['ros__parameters']['stack.joint'] == text
    assert content['/cell/node']['ros__parameters']['qos_overrides./points.subscription.reliability'] == text
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    node = Node('node', namespace='/cell', context=context)
    try:
        read = {name: item.value for name, item in node._parameter_overrides.items()}
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)
    assert read['stack.joint'] == text
    assert read['qos_overrides./points.subscription.reliability'] == text
    assert read['qos_overrides./points.subscription.depth'] == 1
    assert list(read['qos_overrides./points.subscription.times']) == [1, 2]
    for name, row in PARAMETERS.items():
        if name != 'stack.joint':
            value = read[name]
            assert (value if isinstance(value, (bool, int, float, str)) else list(value)) == row.default, name


def test_text_that_is_not_valid_utf_8_is_refused():
    with pytest.raises(SocialCircleError, match='is not valid UTF-8, and cannot be saved'):
        parameter_text({'stack.joint': '\udcff'}, '/node', {})


def test_a_home_is_expanded(monkeypatch, tmp_path):
    monkeypatch.setenv('HOME', str(tmp_path))
    assert parameter_path('~/a.yaml', '/node') == tmp_path / 'a.yaml'


def test_a_relative_path_is_that_in_the_folder_of_the_node(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ROS_HOME', 'ros')
    assert parameter_path('a.yaml', '/node') == tmp_path / 'a.yaml'
    assert parameter_path('', '/node') == tmp_path / 'ros' / 'socialcircle' / 'node.yaml'
