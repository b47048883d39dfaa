"""What is rendered from the table of parameters: parameter files and Markdown tables."""

import yaml

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


def test_the_tables_hold_one_row_per_parameter():
    rows = [line for group in GROUPS for line in parameter_table(group).splitlines()[2:]]
    assert [row.split('`')[1] for row in rows] == list(PARAMETERS)
    for row, parameter in zip(rows, PARAMETERS.values(), strict=True):
        assert parameter.sentence in row


def test_a_pipe_in_a_cell_does_not_end_the_cell():
    assert markdown_table(('a', 'b'), [('1|2', '3')]) == '| a | b |\n| --- | --- |\n| 1\\|2 | 3 |\n'
