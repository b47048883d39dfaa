# SPDX-License-Identifier: Apache-2.0
"""The parameter files of a command line, where rcl would be silent or answer with its source code. No rclpy."""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from socialcircle_ros.settings.plain_yaml import PlainYamlError, load_plain_yaml
from socialcircle_ros.settings.rcl_rules import RclError, parameters_of, read_sections


def fault_of_a_file(arguments: Sequence[str]) -> str | None:
    """Why the first faulty parameter file cannot be used, as a sentence; None: rcl is left to read the files.

    rcl shows its source code for a file that it cannot open, and takes a file with another text for one without
    parameters. An empty file may be intended. rcl reports other faults.

    Args:
        arguments: of the process, such as `--ros-args --params-file a.yaml`.
    """
    for path in _files(arguments):
        try:
            content = load_plain_yaml(path.read_bytes())
        except OSError as error:
            return f'{path} cannot be read: {error.strerror}.'
        except PlainYamlError:
            continue
        if content is not None and not isinstance(content, dict):
            return f'{path} holds no parameters; see config/social_circle.yaml for the form.'
    return None


def files_for_other_nodes(arguments: Sequence[str], node: str) -> list[str]:
    """A sentence for each parameter file that has parameters, but none for this node: rcl passes it over.

    Args:
        arguments: as for `fault_of_a_file`.
        node: full name of the node, such as `/cell1/social_circle`.
    """
    sentences = []
    for path in _files(arguments):
        with suppress(OSError, RclError):
            sections = read_sections(path.read_bytes())
            if any(values for _, values in sections) and not parameters_of(sections, node):
                names = ', '.join(dict.fromkeys(pattern for pattern, values in sections if values))
                sentences.append(
                    f'{path} has no effect: it holds no parameters for {node}, only for {names}. Are name and'
                    ' namespace as intended?'
                )
    return sentences


def _files(arguments: Sequence[str]) -> Iterator[Path]:
    return (Path(path) for option, path in itertools.pairwise(arguments) if option == '--params-file')
