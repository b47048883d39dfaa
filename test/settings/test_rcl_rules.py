# SPDX-License-Identifier: Apache-2.0
"""Parameter files by the rules of rcl: the same files are given to rcl and to our parser."""

import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from socialcircle_ros.settings.rcl_rules import RclError, parameters_of, rcl_value, read_sections

SCALARS = """
1 -5 +7 0x1F 010 08 0b11 1.5 1e-6 1E5 .5 5. -.5e3 1_0 1:30 .inf -.INF nan .nan NaN +.nan inf -Infinity infinit
nan(x) nan() 1e999 1e-320 1e-400 0e5 0.0 -0 0x1p3 0x.8 0xg yes No ~ null on off Y n true False text '5' 'yes'
99999999999999999999 9223372036854775807 9223372036854775808 -9223372036854775808 1e e5 + . 0x << = 2024-05-03
""".split()  # noqa: SIM905 - too many to quote
VALUES = [*SCALARS, '"1.5"', '""', '"\\n"', '!!str 5', '!!int 5', '!!float 5', '! 5', '&a 5', 'a b', '1 2', '*a']
LISTS = [
    '[]',
    '[1, 2]',
    '[1.0, 2]',
    '[1, 2.0]',
    '[a, b]',
    '[yes, no]',
    '["1", "2"]',
    '[1e0]',
    '[[1], 2]',
    '[{a: 1}]',
]
NODES = """
cell1 social_circle /cell1 /cell1/social_circle cell1/social_circle /** /* ** * other /cell1/* /**/social_circle
/*/social_circle /social_circle a/b / 1a x-y /a//b /a/ /**/cell1/* /cell1/** /*/* -
""".split()  # noqa: SIM905 - too many to quote
NAMES = [
    'a',
    'b',
    'circle',
    'circle.window',
    'a.b',
    'ros__parameters',
    'ros__parametersX',
    'x/y',
    '1',
    '"a b"',
    '""',
]

parameters = st.recursive(
    st.sampled_from(VALUES + LISTS),
    lambda values: st.lists(st.tuples(st.sampled_from(NAMES), values), max_size=3),
    max_leaves=6,
)
sections = st.recursive(
    st.lists(st.tuples(st.sampled_from(NAMES), parameters), max_size=3).map(
        lambda found: [('ros__parameters', found)]
    ),
    lambda found: st.lists(
        st.tuples(st.sampled_from([f'"{name}"' for name in NODES]), found), min_size=1, max_size=3
    ),
    max_leaves=4,
)


def written(tree, indent=''):
    """A tree of pairs as YAML; names may occur twice."""
    if isinstance(tree, str):
        return f' {tree}\n'
    if not tree:
        return ' {}\n'
    return '\n' + ''.join(f'{indent}{name}:{written(found, indent + "  ")}' for name, found in tree)


def by_rcl(path, namespace):
    """What rclpy gives a node; None: rcl refuses the file."""
    rclpy = pytest.importorskip('rclpy')
    context = rclpy.Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    except RuntimeError:
        return None
    try:
        node = rclpy.create_node(
            'social_circle',
            namespace=namespace,
            context=context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        found = {name: plain(item.value) for name, item in node._parameter_overrides.items()}
        node.destroy_node()
        return found
    finally:
        rclpy.shutdown(context=context)


def plain(value):
    return value if value is None or isinstance(value, (bool, int, float, str)) else list(value)


def by_us(text, namespace):
    with contextlib.suppress(RclError):
        return parameters_of(read_sections(text), f'{namespace.rstrip("/")}/social_circle')
    return None


def same(one, other):
    if isinstance(one, float) and isinstance(other, float) and math.isnan(one):
        return math.isnan(other)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


def assert_same(path, text, namespace):
    path.write_text(text)
    rcl, ours = by_rcl(path, namespace), by_us(text, namespace)
    assert (rcl is None) == (ours is None), (text, rcl, ours)
    if rcl is not None and ours is not None:
        assert rcl.keys() == ours.keys(), (text, rcl, ours)
        assert all(same(rcl[name], ours[name]) for name in rcl), (text, rcl, ours)


@settings(max_examples=200)
@given(tree=sections, namespace=st.sampled_from(['/', '/cell1', '/a/b']))
def test_sections_are_those_of_rcl(tree, namespace, tmp_path_factory):
    assert_same(tmp_path_factory.getbasetemp() / 'sections.yaml', written(tree), namespace)


@pytest.mark.parametrize('value', VALUES + LISTS)
def test_values_are_those_of_rcl(value, tmp_path):
    assert_same(tmp_path / 'values.yaml', f'/**:\n  ros__parameters:\n    a: {value}\n', '/')


@pytest.mark.parametrize('node', NODES)
def test_names_of_nodes_match_as_in_rcl(node, tmp_path):
    for namespace in ('/', '/cell1', '/x/cell1'):
        assert_same(tmp_path / 'nodes.yaml', f'"{node}":\n  ros__parameters:\n    a: 1\n', namespace)


@pytest.mark.parametrize(
    'text',
    [
        '',
        '[1, 2]',
        'a',
        'a: 1',
        '/**: {ros__parameters: {}}',
        '/**: {ros__parameters: }',
        '/**: {ros__parameters: [1]}',
        '/**:\n  ros__parameters:\n    a: |\n      5\n    b: >-\n      5\n',
        '/**:\n  ros__parameters: {a: 5}\n---\n/**:\n  ros__parameters: {a: 7}\n',
        '/**:\n  ros__parameters: {a: 5, a: 7.0, b: 7.0, b: 5}\n',
        '/**:\n  ros__parameters: {a: 5}\n/cell1/social_circle:\n  ros__parameters: {a: 7}\n',
        '/cell1/social_circle:\n  ros__parameters: {a: 7}\n/**:\n  ros__parameters: {a: 5}\n',
    ],
)
def test_odd_files_are_read_as_rcl_reads_them(text, tmp_path):
    assert_same(tmp_path / 'odd.yaml', text, '/cell1')


@pytest.mark.parametrize(
    ('text', 'value'), [('1e-6', 1e-6), ('5', 5), ('"5"', '5'), ('[1, 2]', [1, 2]), ('no', False), ('', None)]
)
def test_single_values_have_the_types_of_rcl(text, value):
    assert same(rcl_value(text), value)


@pytest.mark.parametrize(
    ('text', 'reason'), [('{a: 1}', 'mapping'), ('[1, 2.0]', 'mixes types'), ('[5', 'not YAML'), ('*a', 'alias')]
)
def test_a_value_that_rcl_refuses_is_refused_with_the_reason(text, reason):
    with pytest.raises(RclError, match=reason):
        rcl_value(text)


def test_a_node_has_a_bounded_number_of_parameters():
    text = '/**:\n  ros__parameters:\n' + ''.join(f'    a{i}: 1\n' for i in range(6000))
    with pytest.raises(RclError, match='more than 5000 parameters'):
        read_sections(text)
