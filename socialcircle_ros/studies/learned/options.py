# SPDX-License-Identifier: Apache-2.0
"""Options of the commands that train."""

from pathlib import Path

import click

data = click.option(
    '--data', type=click.Path(path_type=Path, exists=True, file_okay=False), envvar='SOCIALCIRCLE_DATA',
    required=True,
    help='Directory of measured surfaces with its subdirectory training/; default: $SOCIALCIRCLE_DATA.',
)  # fmt: skip
work = click.option(
    '--work', type=click.Path(path_type=Path), required=True,
    help='Directory of the corpus and of the state of the training. With the same directory and options, the'
    ' training goes on where it was stopped.',
)  # fmt: skip
