# SPDX-License-Identifier: Apache-2.0
"""The documents: generated files are up to date, links lead somewhere, and examples in Python run."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_layers import LEVELS

from socialcircle_ros.interface import SERVICES, TOPICS, HealthValues, MeasurementValues
from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.studies.bench.ratios import GOALS

TOP = Path(__file__).resolve().parents[1]
DOCS = TOP / 'docs'
GENERATOR = runpy.run_path(str(DOCS / 'generate.py'))
PICTURES = runpy.run_path(str(DOCS / 'pictures.py'))['PICTURES']
GENERATED = GENERATOR['generated']()
PAGES = [TOP / 'README.md', TOP / 'CONTRIBUTING.md', *sorted(DOCS.glob('*.md'))]


def relative_links(page):
    """The targets of the links and pictures of a page, without those that lead to other sites."""
    targets = re.findall(r'\]\(([^)\s]+)\)', page.read_text(encoding='utf-8'))
    return [target for target in targets if not re.match(r'https?:|mailto:', target)]


def anchors_of(page):
    """The anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r'^#+ (.+)$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


def python_examples(page):
    return re.findall(r'^```python\n(.*?)^```$', page.read_text(encoding='utf-8'), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize('path', GENERATED, ids=lambda path: path.name)
def test_generated_files_are_up_to_date(path):
    assert path.read_text(encoding='utf-8') == GENERATED[path], f'{path} is out of date: python docs/generate.py'


def test_every_generated_table_stands_in_one_page():
    text = '\n'.join(page.read_text(encoding='utf-8') for page in DOCS.glob('*.md'))
    assert sorted(re.findall(r'<!-- generated: (.+?) -->', text)) == sorted(GENERATOR['TABLES'])


def test_the_parameter_file_holds_every_parameter_at_its_default():
    values = yaml.safe_load((TOP / 'config/social_circle.yaml').read_text(encoding='utf-8'))
    assert values['/**']['ros__parameters'] == {name: row.default for name, row in PARAMETERS.items()}


def test_the_pages_describe_every_topic_service_key_and_parameter():
    topics, parameters = ((DOCS / name).read_text(encoding='utf-8') for name in ('topics.md', 'parameters.md'))
    for row in (*TOPICS, *SERVICES, *MeasurementValues.keys(), *HealthValues.keys()):
        assert f'| `{row.name}` |' in topics
        assert row.sentence in topics
    for name in PARAMETERS:
        assert f'| `{name}` |' in parameters


def test_the_page_of_topics_names_the_key_of_each_stage():
    modules = (TOP / 'socialcircle_ros').rglob('*.py')
    stages = {stage for path in modules for stage in re.findall(r"\.lap\('(.+?)'\)", path.read_text('utf-8'))}
    named = re.findall(r'`time_(\w+)_ms`', (DOCS / 'topics.md').read_text(encoding='utf-8'))
    assert sorted(named) == sorted({*stages, 'total'})


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_relative_links_lead_to_existing_files_and_headings(page):
    for link in relative_links(page):
        path, _, anchor = link.partition('#')
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f'{page.name} links to {link}, which does not exist'
        assert not anchor or anchor in anchors_of(target), (
            f'{page.name} links to {link}, which has no such heading'
        )


def test_one_command_draws_every_picture_that_a_page_shows():
    shown = [picture for page in PAGES for picture in re.findall(r'!\[.+?\]\((\S+?)\)', page.read_text('utf-8'))]
    assert sorted(Path(picture).name for picture in shown) == sorted(PICTURES)
    assert {path.name for path in DOCS.glob('*.png')} == set(PICTURES)


def test_the_index_lists_every_page():
    listed = {link.partition('#')[0] for link in relative_links(DOCS / 'index.md')}
    assert {page.name for page in DOCS.glob('*.md')} - {'index.md'} <= listed


@pytest.mark.parametrize('page', [TOP / 'README.md', DOCS / 'python.md'], ids=lambda page: page.name)
def test_examples_in_python_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    y, x = np.mgrid[:70, :80].astype(np.float32)
    names = {'xyz': np.dstack([x, y, np.zeros_like(x)]), 'bags': TOP / 'bags'}
    script = tmp_path / 'examples.py'
    script.write_text('\n'.join(python_examples(page)), encoding='utf-8')
    assert names.keys() <= runpy.run_path(str(script), init_globals=names).keys()


def test_the_rooms_are_described_in_the_order_of_their_levels():
    rows = re.findall(
        r'^\| ((?:`\w+`(?:, )?)+) \|', (TOP / 'CONTRIBUTING.md').read_text(encoding='utf-8'), re.MULTILINE
    )
    assert [set(re.findall(r'\w+', row)) for row in rows] == LEVELS


@pytest.mark.parametrize(('page', 'before', 'after'), [
    ('parameters', 'can be changed while the node runs, except ', '. '),
    ('node', 'All parameters except ', ' can be changed'),
    ('security', '| change every other parameter | change ', ', which are fixed at the start'),
])  # fmt: skip
def test_the_pages_name_the_parameters_that_cannot_be_changed_while_the_node_runs(page, before, after):
    text = ' '.join((DOCS / f'{page}.md').read_text(encoding='utf-8').split())
    named = set(re.findall(r'`([^`]+)`', text.partition(before)[2].partition(after)[0]))
    assert named == {name for name, parameter in PARAMETERS.items() if parameter.read_only}


def test_the_page_of_benchmarks_has_each_ratio_with_its_goal():
    rows = re.findall(
        r'^\| (.+?) \|.*\| (at \w+ [\d.]+) \|', (DOCS / 'benchmarks.md').read_text('utf-8'), re.MULTILINE
    )
    for goal in GOALS:
        assert (goal.label, f'{goal.sense} {goal.bound:g}') in rows
