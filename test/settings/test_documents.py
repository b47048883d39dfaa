# SPDX-License-Identifier: Apache-2.0
"""What is rendered from the table of parameters: parameter files and Markdown tables."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import GROUPS, PARAMETERS, markdown_table, parameter_table, yaml_text


def test_a_whole_parameter_file_holds_every_parameter():
    values = yaml.safe_load(yaml_text({'circle.window': 5}))['/**']['ros__parameters']
    assert values == {name: row.default for name, row in PARAMETERS.items()} | {'circle.window': 5}


def test_a_partial_parameter_file_holds_the_given_values_only():
    values = yaml.safe_load(yaml_text({'circle.window': 5}, whole=False))['/**']['ros__parameters']
    assert values == {'circle.window': 5}


def test_a_parameter_file_describes_each_parameter_in_the_line_above():
    for name, row in PARAMETERS.items():
        lines = yaml_text({name: row.default}, whole=False).splitlines()[2:]
        comment = ' '.join(line.strip().removeprefix('# ') for line in lines[:-1])
        assert comment.startswith(f'{row.sentence} Allowed: {row.allowed}.')
        assert lines[-1].strip().startswith(f'{name}: ')


@given(st.text(st.characters(exclude_categories=['Cs'])))
def test_every_text_is_quoted_and_read_back(text):
    written = yaml_text({'stack.joint': text, 'parameters_file': text}, whole=False)
    assert yaml.safe_load(written)['/**']['ros__parameters'] == {'stack.joint': text, 'parameters_file': text}
    for name in ('stack.joint', 'parameters_file'):
        (line,) = (line for line in written.split('\n') if line.startswith(f'    {name}: '))
        assert line.startswith(f'    {name}: "')
        assert line.endswith('"')


def test_text_that_no_file_can_hold_is_refused():
    with pytest.raises(SettingError, match='is not valid UTF-8, and cannot be saved'):
        yaml_text({'stack.joint': 'a\udcff'})


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_real_number_is_read_back_with_its_type(number):
    written = yaml_text({'circle.radius': number}, whole=False)
    read = yaml.safe_load(written)['/**']['ros__parameters']['circle.radius']
    assert (type(read), read) == (float, number)


def test_the_tables_hold_one_row_per_parameter():
    rows = [line for group in GROUPS for line in parameter_table(group).splitlines()[2:]]
    assert [row.split('`')[1] for row in rows] == list(PARAMETERS)
    for row, parameter in zip(rows, PARAMETERS.values(), strict=True):
        assert parameter.sentence in row


def test_a_pipe_in_a_cell_does_not_end_the_cell():
    assert markdown_table(('a', 'b'), [('1|2', '3')]) == '| a | b |\n| --- | --- |\n| 1\\|2 | 3 |\n'
