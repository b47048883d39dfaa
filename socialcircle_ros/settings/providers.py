# SPDX-License-Identifier: Apache-2.0
"""The execution providers of ONNX Runtime, which compute the network."""

import importlib.util

from socialcircle_ros.errors import SettingError, shown

CPU_PROVIDER = 'CPUExecutionProvider'
"""The execution provider that every ONNX Runtime offers."""


def require_runtime() -> None:
    """Fail if ONNX Runtime is not installed.

    Raises:
        SettingError: It is not; the message says what to do.
    """
    if importlib.util.find_spec('onnxruntime') is None:
        raise SettingError(
            'The network needs ONNX Runtime, which is not installed: pip install onnxruntime. Or do without it:'
            ' circle.judge: rules, and no circle.lesson that was taught with the network.'
        )


def check_provider(name: str, *, is_used: bool) -> None:
    """Fail if a text names no execution provider, or one that is used and not offered on this machine.

    Raises:
        SettingError: It is so; the message says which are offered.
    """
    if not name.endswith('ExecutionProvider'):
        raise SettingError(
            f'circle.provider is {shown(name)}, which names no execution provider; all end in ExecutionProvider,'
            f' as {CPU_PROVIDER} does.'
        )
    if not is_used or name == CPU_PROVIDER:
        return
    require_runtime()
    from socialcircle_ros.onnx_runtime import onnxruntime  # noqa: PLC0415 - slow to load

    offered = onnxruntime.get_available_providers()
    if name not in offered:
        raise SettingError(
            f'circle.provider: {name} is not offered by the ONNX Runtime of this machine; it offers'
            f' {", ".join(offered)}. Install an ONNX Runtime with that provider, or use {CPU_PROVIDER}.'
        )
