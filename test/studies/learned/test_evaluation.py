# SPDX-License-Identifier: Apache-2.0
"""The comparison of a network with the rules: tables, goals and pictures, with a stand-in for the network."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')
pytest.importorskip('scipy')
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.studies.comparison.study import Plan, Study
from socialcircle_ros.studies.experiments import learned_steps
from socialcircle_ros.studies.learned import evaluation
from socialcircle_ros.studies.learned.scenes import HEIGHTS, SCENES, SIDES
from socialcircle_ros.studies.learned.surfaces import DEVELOPMENT, HELD_OUT, read_surfaces
from socialcircle_ros.studies.steps import merged


class Residual:
    """Stands for the network: far from the median of the cloud is an outlier."""

    def probabilities(self, heights):
        return (np.abs(heights - np.nanmedian(heights)) > 4) * np.uint8(255)


@pytest.fixture(scope='module')
def sections(tmp_path_factory):
    folder = tmp_path_factory.mktemp('surfaces')
    for name in (DEVELOPMENT[0], next(iter(HELD_OUT)), 'other'):
        np.savez(folder / f'{name}.npz', z=np.random.default_rng(3).normal(size=(60, 80)), dx=1.0, dy=1.5)
    np.savez(folder / 'stack.npz', frames=np.zeros((3, 4, 5), np.uint8), z=np.arange(3))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, '_TIMED', (130, 50))  # longer and narrower than the surfaces
        told, made = [], []
        for step in evaluation.learned(Study(Plan((1,), repeats=1), told.append), folder, Residual()):
            made = merged([*made, *step.make(made)])
        assert [step for step in told if 'other' in step]
        return {section.title: section for section in made}


def test_every_surface_is_judged_by_rules_and_network(sections):
    (surfaces,) = sections['Surfaces'].tables
    summary, _ = sections['All surfaces'].tables
    assert {row[0]: row[1] for row in surfaces.rows} == {
        DEVELOPMENT[0]: 'development', next(iter(HELD_OUT)): 'left out', 'other': 'training',
    }  # fmt: skip
    assert [len(table.columns) for table in (summary, surfaces)] == [11, 13]
    assert all(0 <= value <= 1 for row in surfaces.rows for value in row[2:])


def test_isolated_outliers_of_a_flat_surface_are_found_by_this_stand_in(sections):
    (surfaces,) = sections['Surfaces'].tables
    assert surfaces.rows[0][3] > 0.8


def test_scenes_and_squares_are_judged_by_rules_and_network(sections):
    (scenes,), (squares,) = sections['Simulated scenes'].tables, sections['Squares'].tables
    assert [row[0] for row in scenes.rows] == list(SCENES)
    assert len(squares.rows) == 2 * len(SIDES) * len(HEIGHTS)
    # The rules find what stands far off noise; the stand-in for the network finds whatever is far off.
    assert all(
        row[3] == row[4] == 1 for row in squares.rows if row[0] == 'as rough as the surface' and row[2] > 20
    )


def test_times_are_those_of_whole_clouds_of_the_development_surfaces_and_of_noise(sections):
    _, times = sections['All surfaces'].tables
    assert [row[0] for row in times.rows] == [DEVELOPMENT[0], 'white noise']
    for _, rules, network, ratio in times.rows:
        assert ratio == network / rules
    (goals,) = sections['Goals'].tables
    (goal,) = [row for row in goals.rows if str(row[0]).startswith('Time')]
    assert f'{times.rows[0][3]:.2f}' in goal


def test_goals_and_pictures_are_made(sections):
    assert len(sections['Goals'].findings) == 9
    pictures = sections['Worst clouds'].pictures
    assert len(pictures) == 3
    assert pictures[0].caption.startswith(next(iter(HELD_OUT)))


def test_a_network_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SocialCircleError, match=r'none\.onnx cannot be read as a network'):
        learned_steps(Study(Plan((1,)), print), tmp_path, tmp_path / 'none.onnx')


def test_every_surface_that_is_left_out_is_in_the_data_folder(real_measurements):
    names = {each.stem for each in (real_measurements / 'training').glob('*.npz')}
    assert set(HELD_OUT) <= names
    assert {each.stem for each in real_measurements.glob('*.npz')} >= set(DEVELOPMENT)
    assert not set(DEVELOPMENT) & set(HELD_OUT)


def test_stacks_are_skipped(tmp_path):
    np.savez(tmp_path / 'stack.npz', frames=np.zeros((2, 3, 4), np.uint8), z=np.arange(2.0))
    (tmp_path / 'training').mkdir()
    assert read_surfaces(tmp_path) == []
