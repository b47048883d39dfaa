# SPDX-License-Identifier: Apache-2.0
"""A stand-in for the parts of `launch` and `launch_ros` that our launch files use, for machines without them.

Names and arguments are those of the real packages (Jazzy); others fail, as they do there. The stand-in expands a
launch file into commands. It has no events, and supports no other launch files.
"""

import runpy
import sys
import types
from importlib.metadata import entry_points
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]


class LaunchContext:
    def __init__(self, arguments):
        self.given = dict(arguments)
        self.launch_configurations = {}
        self.commands = []


def perform(context, value):
    """The text of a value: text, a substitution, or a list of both, which is joined."""
    if isinstance(value, (list, tuple)):
        return ''.join(perform(context, part) for part in value)
    return value if isinstance(value, str) else value.perform(context)


class LaunchConfiguration:
    def __init__(self, variable_name):
        self.name = variable_name

    def perform(self, context):
        return context.launch_configurations[self.name]


class PathJoinSubstitution:
    def __init__(self, substitutions):
        self.parts = substitutions

    def perform(self, context):
        return str(Path(*(perform(context, part) for part in self.parts)))


class FindPackageShare:
    def __init__(self, package):
        self.package = package

    def perform(self, context):
        # setup.py installs the folders of the checkout under share/, with the same names.
        assert perform(context, self.package) == 'socialcircle_ros'
        return str(TOP)


class ExecutableInPackage:
    def __init__(self, executable, package):
        self.executable, self.package = executable, package

    def perform(self, context):
        assert perform(context, self.package) in ('socialcircle_ros', 'rviz2')
        return perform(context, self.executable)


class IfCondition:
    def __init__(self, predicate_expression):
        self.expression = predicate_expression

    def evaluate(self, context):
        text = perform(context, self.expression).strip().lower()
        assert text in ('true', 'false', '1', '0')
        return text in ('true', '1')


class Action:
    def __init__(self, *, condition=None):
        self.condition = condition

    def visit(self, context):
        if self.condition is None or self.condition.evaluate(context):
            for entity in self.execute(context) or ():
                entity.visit(context)


class LaunchDescription:
    def __init__(self, initial_entities=None):
        self.entities = initial_entities or []

    def visit(self, context):
        for entity in self.entities:
            entity.visit(context)


class DeclareLaunchArgument(Action):
    def __init__(self, name, *, default_value=None, description=None, choices=None, **options):
        super().__init__(**options)
        self.name, self.default_value, self.description, self.choices = name, default_value, description, choices

    def execute(self, context):
        given = context.given.get(self.name, context.launch_configurations.get(self.name))
        if given is None and self.default_value is None:
            raise RuntimeError(f"Required launch argument '{self.name}' (description: '{self.description}')")
        found = perform(context, self.default_value) if given is None else given
        context.launch_configurations[self.name] = found


class ExecuteProcess(Action):
    def __init__(self, *, cmd, output='log', **options):  # noqa: ARG002 - the stand-in shows no output
        super().__init__(**options)
        self.cmd = cmd

    def execute(self, context):
        context.commands.append([perform(context, part) for part in self.cmd])


class Node(ExecuteProcess):
    def __init__(
        self, *, executable, package=None, name=None, namespace=None, parameters=None, remappings=None,
        arguments=None, **options,
    ):  # fmt: skip
        cmd = [ExecutableInPackage(executable, package), *(arguments or ()), '--ros-args']
        if name is not None:
            cmd += ['-r', ['__node:=', name]]
        if namespace is not None:
            cmd += ['-r', ['__ns:=/', namespace]]
        for file in parameters or ():
            cmd += ['--params-file', file]
        for old, new in remappings or ():
            cmd += ['-r', [old, ':=', new]]
        super().__init__(cmd=cmd, **options)


class PythonLaunchDescriptionSource:
    def __init__(self, launch_file_path):
        self.path = launch_file_path

    def get_launch_description(self, context):
        return runpy.run_path(perform(context, self.path))['generate_launch_description']()


class IncludeLaunchDescription(Action):
    def __init__(self, launch_description_source, *, launch_arguments=None, **options):
        super().__init__(**options)
        self.source, self.arguments = launch_description_source, launch_arguments or ()

    def execute(self, context):
        for name, value in self.arguments:
            context.launch_configurations[perform(context, name)] = perform(context, value)
            context.given.pop(perform(context, name), None)
        return [self.source.get_launch_description(context)]


class OpaqueFunction(Action):
    def __init__(self, *, function, args=None, kwargs=None, **options):
        super().__init__(**options)
        self.function, self.args, self.kwargs = function, args or (), kwargs or {}

    def execute(self, context):
        return self.function(context, *self.args, **self.kwargs)


MODULES = {
    'launch': [LaunchDescription, LaunchContext],
    'launch.actions': [DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription, OpaqueFunction],
    'launch.conditions': [IfCondition],
    'launch.launch_context': [LaunchContext],
    'launch.launch_description_sources': [PythonLaunchDescriptionSource],
    'launch.substitutions': [LaunchConfiguration, PathJoinSubstitution],
    'launch_ros': [],
    'launch_ros.actions': [Node],
    'launch_ros.substitutions': [ExecutableInPackage, FindPackageShare],
}


def commands(file, arguments):
    """The commands that a launch file starts, in order; our own executables are run as Python modules."""
    before = {name: sys.modules.get(name) for name in MODULES}
    for name, classes in MODULES.items():
        module = sys.modules[name] = types.ModuleType(name)
        module.__dict__.update({each.__name__: each for each in classes})
    try:
        context = LaunchContext(arguments)
        PythonLaunchDescriptionSource(str(file)).get_launch_description(context).visit(context)
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
    return [_runnable(command) for command in context.commands]


def _runnable(command):
    for script in entry_points(group='console_scripts', name=command[0]):
        return [sys.executable, '-m', script.module, *command[1:]]
    return command
