# SPDX-License-Identifier: Apache-2.0
"""A cell for live tests: the real node in a process of its own, and a peer that talks to it over DDS."""

import contextlib
import itertools
import os
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from forked import ForkedNode
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from socialcircle_ros import interface
from socialcircle_ros.clients.message_types import message_class
from socialcircle_ros.clients.qos import reliable
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.image import decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud

PATIENCE = 300.0  # s: on a fresh checkout all test processes compile at once, which took over a minute
NUMBERS = itertools.count()
RELIABLE = reliable()
TOPICS = (interface.FILTERED, interface.MASK, interface.MEASUREMENT)
RESULTS = tuple(topic.within('').removeprefix('/') for topic in TOPICS)


class Cell:
    """A node in a namespace of its own, and a peer.

    The node is forked, unless `begin` is `NodeProcess`, as for tests of how it ends.
    """

    def __init__(self, folder, parameters=None, arguments=(), *, active=True, begin=ForkedNode):
        number = next(NUMBERS)
        self.namespace = f'/cell{os.getpid()}_{number}'
        self.name = f'{self.namespace}/{interface.NODE_NAME}'
        self.node_process = begin(self.namespace, folder / f'node{number}.log', parameters, arguments)
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.peer = Node('peer', namespace=self.namespace, context=self.context)
        self.changed = threading.Condition()
        self.services = {}
        self.orphans = set()
        self.inbox = {name: [] for name in (*RESULTS, 'diagnostics')}
        for topic, name in zip(TOPICS, RESULTS, strict=True):
            self.peer.create_subscription(message_class(topic.type), name, self.keep(name), RELIABLE, raw=True)
        self.peer.create_subscription(DiagnosticArray, interface.DIAGNOSTICS.name, self.diagnosed, 10)
        self.clouds = self.peer.create_publisher(PointCloud2, interface.POINTS.name, RELIABLE)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.peer)
        self.thread = threading.Thread(target=self.spin)
        self.thread.start()
        if active:
            self.wait_for_state('active')
            self.wait_for(lambda: self.clouds.get_subscription_count() == 1)

    def spin(self):
        with contextlib.suppress(rclpy.executors.ExternalShutdownException):
            self.executor.spin()

    def keep(self, name):
        def keep(message):
            with self.changed:
                self.inbox[name].append(message)
                self.changed.notify_all()

        return keep

    def diagnosed(self, array):
        for status in array.status:
            if status.hardware_id == self.name:
                values = {pair.key: pair.value for pair in status.values}
                with self.changed:
                    self.inbox['diagnostics'].append(SimpleNamespace(status=status, values=values))
                    self.changed.notify_all()

    def wait_for(self, condition):
        """The first true value of `condition`, which is tried at each message and every 50 ms."""
        found = None
        for _ in range(int(PATIENCE / 0.05)):
            with self.changed:
                found = condition()
                if found:
                    return found
                self.changed.wait(0.05)
        log = self.node_process.log.read_text()
        raise AssertionError(f'the condition did not hold within {PATIENCE:.0f} s; the log of the node:\n{log}')

    def call(self, kind, name, request):
        """Call a service of the node.

        A call without a response is repeated: a response is lost if the server has not yet discovered its reader
        (rmw_fastrtps logs this).
        """
        if name not in self.services:
            self.services[name] = self.peer.create_client(kind, f'{interface.NODE_NAME}/{name}')
        client = self.services[name]
        self.wait_for(client.service_is_ready)
        futures = []

        def answered():
            if not futures or time.monotonic() > futures[-1][0] + 5:
                futures.append((time.monotonic(), client.call_async(request)))
            return next((future.result() for _, future in futures if future.done()), None)

        return self.wait_for(answered)

    def state(self):
        return self.call(GetState, 'get_state', GetState.Request()).current_state.label

    def wait_for_state(self, wanted):
        self.wait_for(lambda: self.state() == wanted)

    def transition(self, number):
        request = ChangeState.Request()
        request.transition.id = number
        return self.call(ChangeState, 'change_state', request).success

    def set(self, **values):
        """Set parameters one at a time, as `ros2 param set` does; `__` in a name stands for the dot."""
        request = SetParameters.Request(parameters=self.messages(values))
        return self.call(SetParameters, 'set_parameters', request).results

    def set_together(self, **values):
        request = SetParametersAtomically.Request(parameters=self.messages(values))
        return self.call(SetParametersAtomically, 'set_parameters_atomically', request).result

    @staticmethod
    def messages(values):
        return [
            Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
            if value is not None
            else ParameterMessage(name=name.replace('__', '.'))
            for name, value in values.items()
        ]

    def get(self, name):
        (value,) = self.call(GetParameters, 'get_parameters', GetParameters.Request(names=[name])).values
        return parameter_value_to_python(value)

    def describe(self, name):
        request = DescribeParameters.Request(names=[name])
        return self.call(DescribeParameters, 'describe_parameters', request).descriptors[0]

    def trigger(self, name):
        return self.call(Trigger, name, Trigger.Request())

    def forget(self):
        with self.changed:
            for messages in self.inbox.values():
                messages.clear()

    def publish(self, cloud):
        self.clouds.publish(cloud)

    def answer(self):
        """The next complete result: cloud, mask and measurement."""
        self.wait_for(lambda: all(self.inbox[name] for name in RESULTS))
        cloud, mask, measurement = (self.inbox[name][-1] for name in RESULTS)
        self.forget()
        return PointCloud.decode(cloud), decode_mono8(mask), Status.decode(measurement)

    def clean(self, cloud):
        self.forget()
        self.publish(cloud)
        return self.answer()

    def diagnosis(self, condition):
        """The next diagnosis that meets `condition`."""
        return self.wait_for(
            lambda: next((found for found in self.inbox['diagnostics'] if condition(found)), None)
        )

    def kill(self):
        """Kill the node. Its shared memory remains until `close` removes it."""
        process = self.node_process.process
        self.orphans |= mapped_by(process.pid)
        process.kill()
        process.wait()

    def close(self):
        code = self.node_process.stop()
        rclpy.shutdown(context=self.context)
        self.thread.join()
        self.peer.destroy_node()
        for path in self.orphans - mapped_by('*'):
            for file in (path, path.with_name(f'{path.name}_el')):
                file.unlink(missing_ok=True)
        return code


def mapped_by(process):
    """The shared memory that a process has mapped; '*': that any process has mapped."""
    found = set()
    for maps in Path('/proc').glob(f'{process}/maps'):
        with contextlib.suppress(OSError):
            found |= {
                Path(line.split(maxsplit=5)[5]) for line in maps.read_text().splitlines() if '/dev/shm' in line
            }
    return found


@pytest.fixture
def start_cell(tmp_path):
    """Starts cells, and closes them at the end of the test."""
    cells = []

    def start(*args, **kwargs):
        cells.append(Cell(tmp_path, *args, **kwargs))
        return cells[-1]

    yield start
    for cell in cells:
        cell.close()


@pytest.fixture(scope='module')
def shared_cell(tmp_path_factory):
    cell = Cell(tmp_path_factory.mktemp('cell'))
    yield cell
    cell.close()


@pytest.fixture
def cell(shared_cell):
    """An active node with default parameters that has not received a cloud."""
    shared_cell.set(
        circle__mode='paper', circle__window=3, circle__radius=0.0, circle__radius_scale=1.0,
        circle__vote_region=[0] * 4, reprocess_last=True, output__mask=True, output__score=False,
    )  # fmt: skip
    shared_cell.trigger('reset')
    shared_cell.forget()
    return shared_cell
