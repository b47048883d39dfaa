"""Parameter files of ROS: read back what `documents.yaml_text` writes, and what people write by hand."""

import contextlib
from pathlib import Path
from typing import Any

import yaml

from socialcircle_ros.errors import SettingError, SocialCircleError

from . import PARAMETERS


def read_parameter_file(path: Path) -> dict[str, Any]:
    """The parameters of every node in the file, nested or dotted, under dotted names.

    Raises:
        SocialCircleError: the file cannot be read.
        SettingError: it is not YAML, or holds no parameters.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise SocialCircleError(f'{path} cannot be read: {error.strerror}.') from None
    except (yaml.YAMLError, UnicodeDecodeError):
        raise SettingError(f'{path} is not YAML; see config/social_circle.yaml for the form.') from None
    found: dict[str, Any] = {}

    def walk(prefix: str, item: Any) -> None:
        if isinstance(item, dict):
            for key, value in item.items():
                walk(f'{prefix}.{key}' if prefix else str(key), value)
        else:
            found[prefix] = as_ros_reads(prefix, item)

    for node in (content or {}).values() if isinstance(content, dict) else ():
        if isinstance(node, dict):
            walk('', node.get('ros__parameters', {}))
    if not found:
        raise SettingError(f'{path} holds no ros__parameters; see config/social_circle.yaml for the form.')
    return found


def as_ros_reads(name: str, value: Any) -> Any:
    """The value of a parameter as ROS reads it: YAML 1.1 takes 1e-6 for a text, ROS for a number."""
    if name in PARAMETERS and PARAMETERS[name].kind is float and isinstance(value, str):
        with contextlib.suppress(ValueError):
            return float(value)
    return value
