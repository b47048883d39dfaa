# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node and of the filter: their declaration, their checks, and parameter files.

Nothing here needs ROS; how a running node declares and changes its parameters is in `node/parameters.py`.
"""

from .documents import (
    markdown_table,
    parameter_table,
    quoted_yaml,
    yaml_text,
)
from .groups import (
    GROUPS,
    OF_CELL,
    PARAMETERS,
    VOTERS,
    CircleSettings,
    LimitSettings,
    MeasurementSettings,
    Mode,
    NodeSettings,
    OutputSettings,
    PipelineSettings,
    RepairMethod,
    RepairSettings,
)
from .lessons import Judge
from .providers import CPU_PROVIDER, require_runtime
from .schema import (
    Limits,
    Parameter,
    RosValue,
    Settings,
    choices_in,
    sentence_and_unit,
    setting,
)
from .stack_groups import Fit, FocusSettings, StackSettings, ZSource

__all__ = [
    'CPU_PROVIDER',
    'GROUPS',
    'OF_CELL',
    'PARAMETERS',
    'VOTERS',
    'CircleSettings',
    'Fit',
    'FocusSettings',
    'Judge',
    'LimitSettings',
    'Limits',
    'MeasurementSettings',
    'Mode',
    'NodeSettings',
    'OutputSettings',
    'Parameter',
    'PipelineSettings',
    'RepairMethod',
    'RepairSettings',
    'RosValue',
    'Settings',
    'StackSettings',
    'ZSource',
    'choices_in',
    'markdown_table',
    'parameter_table',
    'quoted_yaml',
    'require_runtime',
    'sentence_and_unit',
    'setting',
    'yaml_text',
]
