# SPDX-License-Identifier: Apache-2.0
"""The table of parameters: defaults, checks, and conversion to and from ROS values."""

import dataclasses

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays, scalar_dtypes

from socialcircle_ros import CircleSettings, SocialCircleError
from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import (
    GROUPS,
    PARAMETERS,
    LimitSettings,
    NodeSettings,
    OutputSettings,
    PipelineSettings,
    choices_in,
    sentence_and_unit,
    yaml_text,
)
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson


def test_the_parameters_that_users_rely_on_exist():
    assert {'circle.mode', 'circle.window', 'circle.vote_region', 'circle.radius', 'circle.radius_scale'} <= set(
        PARAMETERS
    )
    assert {'reprocess_last', 'autostart'} <= set(PARAMETERS)


def test_the_mode_is_adaptive_and_the_other_defaults_are_those_of_the_paper():
    assert CircleSettings() == CircleSettings(
        mode='adaptive', window=3, vote_region=None, radius=None, radius_scale=1.0
    )


def test_parameters_that_the_mode_does_not_use_are_named():
    changed = {'window': 5, 'radius': 2.0, 'radius_scale': 1.5, 'depth_of_field': 3.0}
    assert CircleSettings(**changed).without_effect() == ('circle.window', 'circle.radius', 'circle.radius_scale')
    assert CircleSettings(mode='paper', **changed).without_effect() == ()
    assert CircleSettings(depth_of_field=3.0, not_measured='nan').without_effect() == ()


def test_settings_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        CircleSettings().window = 5


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        ({'mode': 'fast'}, "circle.mode cannot be 'fast'; use one of: paper"),
        ({'window': 4}, 'circle.window must be odd, not 4; use 3 or 5'),
        ({'window': 32}, 'circle.window must be odd, not 32; use 31'),
        ({'window': 0}, 'circle.window must be odd, not 0; use 3'),
        ({'window': 1}, 'circle.window is 1, which is out of range: it must be between 3 and 31'),
        ({'window': 3.0}, 'circle.window must be a whole number, not 3.0'),
        ({'window': True}, 'circle.window must be a whole number, not True'),
        ({'radius': 0}, 'circle.radius must be above 0'),
        ({'radius': -1.0}, 'circle.radius is -1, which is out of range: it must be at least 0'),
        ({'radius': float('nan')}, 'circle.radius must be a finite number, not nan'),
        ({'radius_scale': float('inf')}, 'circle.radius_scale must be a finite number, not inf'),
        ({'radius_scale': '2'}, "circle.radius_scale must be a number, not '2': write it without quotes.$"),
        ({'radius_scale': 'two'}, "circle.radius_scale must be a number, not 'two'.$"),
        ({'window': '3'}, "circle.window must be a whole number, not '3': write it without quotes.$"),
        ({'window': '3.5'}, "circle.window must be a whole number, not '3.5'.$"),
        ({'radius': 'true'}, "circle.radius must be a number, not 'true'.$"),
        ({'radius_scale': None}, 'circle.radius_scale must be a number, not None'),
        ({'radius': 10**400}, 'circle.radius must be a number that fits 64 bits, not 10{59}…'),
        ({'radius': 10**5000}, 'circle.radius must be a number that fits 64 bits, not a number of thousands'),
        ({'radius': np.True_}, 'circle.radius must be a number, not True'),
        ({'radius': np.array([1.0, 2.0])}, 'circle.radius must be a number, not array'),
        ({'window': 10**400 + 1}, 'circle.window is 10{59}…, which is out of range: it must fit 64 bits'),
        ({'window': np.True_}, 'circle.window must be a whole number, not True'),
        ({'mode': np.array([1, 2])}, r'circle.mode cannot be array\(\[1, 2\]\); use one of: paper'),
        ({'not_measured': 0}, "circle.not_measured must be text, not 0; for this number use the text '0'"),
        ({'not_measured': -9999.0}, "must be text, not -9999.0; for this number use the text '-9999.0'"),
        ({'not_measured': False}, 'circle.not_measured must be text, not False.$'),
        ({'vote_region': (1, 2, 3)}, r'circle.vote_region must be 4 whole numbers, not \(1, 2, 3\)'),
        ({'vote_region': '1234'}, 'circle.vote_region must be 4 whole numbers'),
        ({'vote_region': (5, 5, 0, 60)}, r'circle.vote_region \[5, 5, 0, 60\] is empty; give a height'),
        ({'vote_region': (5, 5, 0, 60)}, r'or \[0, 0, 0, 0\] \(in Python None\) to let the filter choose'),
        ({'vote_region': (0, 0, 0, 0)}, 'preferably 60, or None to let the filter choose'),
        ({'vote_region': (0, -1, 60, 60)}, 'circle.vote_region is -1, which is out of range'),
        ({'vote_region': (0, 0, 300, 300)}, 'has 90000 points; at most 40000 can vote'),
    ],
)
def test_a_value_that_is_not_allowed_is_refused_with_what_is(values, sentence):
    with pytest.raises(SocialCircleError, match=sentence):
        CircleSettings(**values)


def test_the_network_is_refused_without_its_runtime(monkeypatch, tmp_path):
    numbers = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS), (0.0,) * WEIGHTS
    for judge in ('network', 'rules'):
        lesson = Lesson(('a',), (1.0, 2.0), judge, 0.2, *numbers, 0.5, {})
        (tmp_path / f'{judge}.teach').write_text(lesson.to_text())
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    needed = 'network needs ONNX Runtime, .* pip install onnxruntime. .* circle.judge: rules, and no circle.lesson'
    for values in (
        {},
        {'circle.judge': 'rules', 'circle.lesson': str(tmp_path / 'network.teach')},
        {'circle.provider': 'CUDAExecutionProvider'},
    ):
        with pytest.raises(SocialCircleError, match=needed):
            CircleSettings.from_ros(values)
    for values in (
        {'circle.mode': 'paper'},
        {'circle.mode': 'paper', 'circle.provider': 'CUDAExecutionProvider'},
        {'circle.judge': 'rules'},
        {'circle.depth_of_field': 3.0},
        {'circle.lesson': str(tmp_path / 'rules.teach')},
    ):
        assert not CircleSettings.from_ros(values).uses_network


def test_a_lesson_stays_in_force_until_it_is_set_again_whatever_becomes_of_its_file(tmp_path):
    numbers = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS), (0.0,) * WEIGHTS
    first, second = (Lesson((name,), (1.0, 2.0), 'rules', 0.2, *numbers, 0.5, {}) for name in ('first', 'second'))
    path = tmp_path / 'part.teach'
    path.write_text(first.to_text())
    settings = PipelineSettings.from_ros({'circle.lesson': str(path)})
    assert settings.circle.taught == first
    path.write_text(second.to_text())
    for unrelated in ({'output.mask': False}, {'circle.window': 5}):
        assert settings.with_ros(unrelated).circle.taught == first
    assert settings.circle.of_a_stack(1.0).taught == first
    again = settings.with_ros({'circle.lesson': str(path)})
    assert again.circle.taught == second
    assert again.circle != settings.circle
    path.unlink()
    for unrelated in ({'output.mask': False}, {'circle.mode': 'paper'}):
        assert settings.with_ros(unrelated).circle.taught == first
    with pytest.raises(SocialCircleError, match='No such file'):
        settings.with_ros({'circle.lesson': str(path)})
    assert settings.with_ros({'circle.lesson': ''}).circle.taught is None


def test_a_change_leaves_the_groups_that_it_does_not_concern():
    before = PipelineSettings.from_ros({'circle.window': 5})
    after = before.with_ros({'repair.largest': 7, 'silence': 6.0})
    assert (after.circle.window, after.repair.largest) == (5, 7)
    assert after.circle is before.circle
    with pytest.raises(SocialCircleError, match=r'limits.sq_min 2 is above limits.sq_max 1'):
        PipelineSettings.from_ros({'limits.sq_max': 1.0}).with_ros({'limits.sq_min': 2.0})


def test_limits_that_nothing_meets_are_refused():
    with pytest.raises(SocialCircleError, match=r'limits.sq_min 2 is above limits.sq_max 1: no surface passes'):
        LimitSettings(sq_min=2.0, sq_max=1.0)
    with pytest.raises(SocialCircleError, match=r'limits.sz_max must be above 0; use None for no limit'):
        LimitSettings(sz_max=0.0)
    assert not LimitSettings.from_ros({'limits.sz_max': 0.0}).are_set
    assert LimitSettings.from_ros({'limits.sz_max': 1e-6}).are_set


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.integers(300, 6000).map(lambda digits: 10**digits)
    | st.floats()
    | st.complex_numbers()
    | st.text()
    | st.binary()
    | scalar_dtypes().flatmap(lambda kind: arrays(kind, array_shapes(min_dims=0, max_side=3))),
    lambda values: st.lists(values, max_size=5) | st.tuples(values, values, values, values),
    max_leaves=5,
)


@given(st.sampled_from([(group, row.field) for group in GROUPS for row in group.parameters()]), anything)
def test_a_value_of_any_kind_is_taken_or_refused_in_one_line(parameter, value):
    group, field = parameter
    try:
        found = group(**{field: value})
    except SettingError as refusal:
        assert field in str(refusal)
        assert '\n' not in str(refusal)
        assert len(str(refusal)) < 500
    else:
        assert type(getattr(found, field)) in (bool, int, float, str, tuple, type(None))
        assert group.from_ros(found.to_ros()) == found


@pytest.mark.parametrize('wrong', [1, 'yes', None])
def test_a_bool_parameter_takes_only_true_or_false(wrong):
    with pytest.raises(SocialCircleError, match='output.mask must be true or false'):
        OutputSettings(mask=wrong)


def test_scalars_of_numpy_are_those_of_python():
    settings = CircleSettings(mode=np.str_('paper'), window=np.int64(5), radius=np.float32(0.5))
    assert (settings.mode, settings.window, settings.radius) == ('paper', 5, 0.5)
    assert OutputSettings(mask=np.True_) == OutputSettings(mask=True)


def test_a_text_parameter_takes_only_text():
    with pytest.raises(SocialCircleError, match='parameters_file must be text, not 7'):
        NodeSettings(parameters_file=7)


def test_parameters_are_saved_to_yaml_files_only():
    assert NodeSettings(parameters_file='~/a.yaml').parameters_file == '~/a.yaml'
    for path in ('/etc/profile.d/x.sh', '.bashrc', '.', 'a.yaml/', 'a.YAML'):
        with pytest.raises(SocialCircleError, match='parameters_file must end in .yaml, which'):
            NodeSettings(parameters_file=path)


def test_numbers_are_converted_to_the_python_type_of_the_parameter():
    settings = CircleSettings(radius=1, window=np.int64(5), radius_scale=np.float32(2))
    assert (settings.radius, settings.window, settings.radius_scale) == (1.0, 5, 2.0)
    assert [type(value) for value in (settings.radius, settings.window)] == [float, int]


def test_zeros_in_ros_stand_for_none():
    values = {'circle.radius': 0.0, 'circle.vote_region': [0, 0, 0, 0]}
    assert CircleSettings.from_ros(values) == CircleSettings(radius=None, vote_region=None)
    assert CircleSettings().to_ros() | values == CircleSettings().to_ros()


@given(
    window=st.integers(1, 15).map(lambda k: 2 * k + 1),
    region=st.none() | st.tuples(*[st.integers(0, 5000)] * 2, *[st.integers(1, 200)] * 2),
    radius=st.none() | st.floats(1e-12, 1e12),
    scale=st.floats(0.01, 100),
)
def test_settings_are_the_same_after_a_round_trip_through_ros_and_yaml(window, region, radius, scale):
    settings = CircleSettings(window=window, vote_region=region, radius=radius, radius_scale=scale)
    text = yaml_text(settings.to_ros())
    values = yaml.safe_load(text)['/**']['ros__parameters']
    assert CircleSettings.from_ros(values) == settings


def test_every_parameter_has_a_sentence_and_a_default_of_its_type():
    for name, row in PARAMETERS.items():
        assert row.sentence.endswith('.'), name
        assert isinstance(row.default, row.kind), name


def test_a_description_splits_into_sentence_and_unit():
    for row in PARAMETERS.values():
        assert sentence_and_unit(row.description) == (row.sentence, row.unit)
        assert row.kind is not str or choices_in(row.allowed) == row.limits.choices


def test_every_default_is_allowed():
    for group in GROUPS:
        assert group.from_ros({row.name: row.default for row in group.parameters()}) == group()
