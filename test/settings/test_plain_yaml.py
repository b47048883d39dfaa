# SPDX-License-Identifier: Apache-2.0
"""Loading YAML that cannot fill the memory."""

import re
import tracemalloc
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import socialcircle_ros
from socialcircle_ros.settings.plain_yaml import PlainYamlError, load_plain_yaml

PACKAGE = Path(socialcircle_ros.__file__).parent

BOMB = 'a0: &a0 [x, x]\n' + ''.join(f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 9)}]\n' for i in range(1, 10))


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
        lambda items: st.lists(items, max_size=4) | st.dictionaries(st.text(), items, max_size=4),
    )
)
def test_what_is_dumped_without_aliases_is_loaded(value):
    class Dumper(yaml.SafeDumper):
        def ignore_aliases(self, _):
            return True

    assert load_plain_yaml(yaml.dump(value, Dumper=Dumper)) == value


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('a: &x 1\nb: *x\n', 'it has an alias in line 2'),
        (BOMB, 'it has an alias in line 2'),
        ('a: &x {b: *x}', 'it has an alias'),
        ('[' * 60 + ']' * 60, 'nested deeper'),
        ('[' * 100_000, 'nested deeper|not YAML'),
        ('- 1\n' * 200_000, 'too large'),
        ('a: [', 'it is not YAML'),
        (b'\xff\xfe\xfa', 'it is not YAML'),
        ('a: 2001-99-99', 'a value that YAML cannot read'),
        ('a: !!int x', 'a value that YAML cannot read'),
        ('a: !!bool x', 'a value that YAML cannot read'),
        ('a: !!timestamp x', 'a value that YAML cannot read'),
        ('a: !!python/object:os.system {}', 'a value that YAML cannot read'),
        ('a: ' + '9' * 5000, 'a value that YAML cannot read'),
    ],
)
def test_other_texts_are_refused_with_the_reason_and_in_little_memory(text, reason):
    tracemalloc.start()
    with pytest.raises(PlainYamlError, match=reason):
        load_plain_yaml(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_no_other_module_loads_yaml():
    loads = re.compile(r'yaml\.(?:\w*load\w*|parse|compose|scan)\(')
    loading = [path.name for path in PACKAGE.rglob('*.py') if loads.search(path.read_text(encoding='utf-8'))]
    assert loading == ['plain_yaml.py']


SIGNS = st.text('ab01.:-,?|>[]{}&*!#%@\'"\\ \n\t~', max_size=30)


def as_the_library_loads(text):
    """The value as text, since NaN is not equal to itself; '' where the library fails."""
    try:
        return repr(yaml.load(text, getattr(yaml, 'CSafeLoader', yaml.SafeLoader)))  # noqa: S506 - a safe loader
    except Exception:  # noqa: BLE001 - of any kind
        return ''


@given(SIGNS | st.text(max_size=60) | st.binary(max_size=60))
def test_any_text_without_aliases_is_loaded_as_by_the_library_and_refused_where_that_fails(text):
    expected = as_the_library_loads(text)
    try:
        found = repr(load_plain_yaml(text))
    except PlainYamlError as error:
        assert str(error).startswith('it ')
        assert not expected or 'it has an alias' in str(error)
    else:
        assert found == expected
