# SPDX-License-Identifier: Apache-2.0
"""What is done, as files."""

import json

import pytest

from socialcircle_ros.archive.inputs import ArchiveInput
from socialcircle_ros.archive.ledger import Ledger, LedgerEntry


@pytest.fixture
def ledger(tmp_path):
    return Ledger(tmp_path)


def rows(folder, *names):
    """Files in the place of rows."""
    for name in names:
        (folder / name).write_text('')
    return names


def test_an_entry_knows_its_content_and_one_of_an_earlier_version_does_too(ledger, tmp_path):
    ledger.record('aa', LedgerEntry('a.mcap', 1, '1', 'd'))
    record = json.loads((tmp_path / 'inputs/aa.json').read_text())
    del record['content']
    (tmp_path / 'inputs/bb.json').write_text(json.dumps({**record, 'location': 'b.mcap'}))
    (tmp_path / 'inputs/cc.json').write_text('half an ent')
    ledger.record_failure(LedgerEntry('c.mcap', 1, '1', 'd', failure='It is no recording.'))
    contents = {entry.location: entry.content for entry in ledger.entries()}
    assert contents == {'a.mcap': 'aa', 'b.mcap': 'bb', 'c.mcap': ''}
    assert ledger.of_content('bb').content == 'bb'


def test_what_an_earlier_version_may_have_made_goes_only_under_its_own_name(ledger, tmp_path):
    """It did not say what it made, and results of several inputs could have one name."""
    for name in ('recordings/a.mcap', 'reports/a.mcap.html', 'reports/b.mcap.html'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text('')
    for content in 'ab':
        ledger.record(content, LedgerEntry(f'{content}.mcap', 1, '1', 'd', name=f'{content}.mcap'))
    ledger.record('a', LedgerEntry('a.mcap', 1, '1', 'e', name='a.mcap', outputs=('recordings/a.mcap',)))
    ledger.record('b', LedgerEntry('b.mcap', 1, '1', 'e', name='b.mcap-12ab', outputs=()))
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob('re*/*'))
    assert left == ['recordings/a.mcap', 'reports/b.mcap.html']


def test_other_contents_and_failures_of_a_location_are_forgotten_with_their_rows(ledger, tmp_path):
    for content in ('half', 'whole'):
        ledger.record(content, LedgerEntry('a.mcap', 1, '1', 'd', files=rows(tmp_path, content)))
    failed = LedgerEntry('a.mcap', 1, '1', 'd', files=rows(tmp_path, 'failed'), failure='It is no recording.')
    ledger.record_failure(failed)
    ledger.record('other', LedgerEntry('b.mcap', 1, '1', 'd', files=rows(tmp_path, 'other')))
    ledger.forget_others([each for each in ledger.entries() if each.location == 'a.mcap'], 'a.mcap', 'whole')
    assert sorted(entry.content for entry in ledger.entries()) == ['other', 'whole']
    assert sorted(path.name for path in tmp_path.iterdir()) == ['inputs', 'other', 'whole']


def test_a_content_that_another_worker_found_elsewhere_meanwhile_is_not_forgotten(ledger, tmp_path):
    earlier = LedgerEntry('a.mcap', 1, '1', 'd', files=rows(tmp_path, 'moved'), content='moved')
    ledger.record('moved', LedgerEntry('b.mcap', 1, '1', 'd', files=earlier.files))
    ledger.forget_others([earlier], 'a.mcap', 'new')
    assert [entry.location for entry in ledger.entries()] == ['b.mcap']
    assert (tmp_path / 'moved').exists()


def entry_at(folder, name, **changes):
    """An entry of an input with a recording, which is written."""
    output = f'recordings/{name}'
    (folder / 'recordings').mkdir(exist_ok=True)
    (folder / output).write_text('')
    return LedgerEntry(name, 1, '1', 'd', **{'name': name, 'outputs': (output,), **changes})


def made_in(folder):
    return sorted(path.name for path in folder.glob('recordings/*'))


def test_what_is_recorded_of_another_content_is_not_removed(ledger, tmp_path):
    """As when a.mcap becomes b.mcap, and there is a new a.mcap."""
    ledger.record('old', entry_at(tmp_path, 'a.mcap'))
    ledger.record('new', entry_at(tmp_path, 'a.mcap'))
    ledger.record('old', entry_at(tmp_path, 'b.mcap'))
    assert made_in(tmp_path) == ['a.mcap', 'b.mcap']


def test_a_moved_content_gives_the_names_of_its_old_location_back_before_it_is_filtered(ledger, tmp_path):
    before = entry_at(tmp_path, 'a.mcap', files=rows(tmp_path, 'rows'))
    ledger.record('old', before)
    ledger.begin('old', ArchiveInput('b.mcap', 'b.mcap', 1, '1', 0), moved=True)
    assert made_in(tmp_path) == []
    ledger.forget_others([before], 'a.mcap', 'new')
    assert ledger.of_content('old').digest == ''
    assert (tmp_path / 'rows').exists()
    entry_at(tmp_path, 'a.mcap')  # the new content at a.mcap is written and not yet recorded
    ledger.record('old', entry_at(tmp_path, 'b.mcap', files=before.files))
    assert made_in(tmp_path) == ['a.mcap', 'b.mcap']


def test_what_a_moved_content_makes_again_under_its_name_stays_and_goes_if_it_is_not_made(ledger, tmp_path):
    ledger.record('old', entry_at(tmp_path, 'a.mcap'))
    ledger.begin('old', ArchiveInput('cell2/a.mcap', 'a.mcap', 1, '1', 0), moved=True)
    assert made_in(tmp_path) == ['a.mcap']
    ledger.record('old', LedgerEntry('cell2/a.mcap', 1, '1', 'd', name='a.mcap', outputs=()))
    assert made_in(tmp_path) == []
