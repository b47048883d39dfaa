# SPDX-License-Identifier: Apache-2.0
"""Which inputs are found, and under which names."""

import os
from datetime import datetime, timedelta, timezone

import pytest
from archive.archives import BAGS, object_store

from socialcircle_ros.archive import find_inputs
from socialcircle_ros.archive.inputs import content_hash, local_copy
from socialcircle_ros.archive.results import FOLDERS, ResultFolder, result_name
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.measurements import FOLDER


@pytest.fixture
def archive(tmp_path):
    for name in ('a.mcap', 'cell1/b.mcap', 'cell1/c.al3d', 'cell1/readme.txt', '.hidden.mcap', 'x [1].mcap.zstd'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
    for name in ('bag/metadata.yaml', 'bag/bag_0.mcap', 'bag/bag_1.mcap', 'cell2/b.mcap'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b'12345')
    return tmp_path


def names(*given):
    return [each.name for each in find_inputs(given)]


def test_a_folder_is_searched_and_a_rosbag2_directory_is_one_input(archive):
    found = find_inputs([archive])
    assert [each.name for each in found] == [
        'a.mcap', 'bag', 'cell1/b.mcap', 'cell1/c.al3d', 'cell2/b.mcap', 'x [1].mcap.zstd',
    ]  # fmt: skip
    assert found[1].size == 15
    assert found[0].location == str(archive / 'a.mcap')
    assert found[0].time_ns == (archive / 'a.mcap').stat().st_mtime_ns


def test_files_globs_and_file_urls(archive):
    assert names(archive / 'cell1/readme.txt') == ['readme.txt']
    assert names(f'{archive}/cell*/*.mcap') == names(f'{archive}/**/b.mcap')
    assert names(f'file://{archive}/a.mcap', archive / 'a.mcap') == ['a.mcap']
    assert names(archive / 'x [1].mcap.zstd') == ['x [1].mcap.zstd']


def test_inputs_of_one_name_get_different_names(archive):
    found = names(archive / 'cell1/b.mcap', archive / 'cell2/b.mcap')
    assert len(set(found)) == 2
    assert all(name.startswith('b.mcap-') for name in found)


def test_a_directory_and_a_file_whose_results_would_be_one_file_get_different_names(archive):
    (archive / 'bag.mcap').write_bytes(b'1')
    found = [each.name for each in find_inputs([archive])]
    assert [name.partition('-')[0] for name in found[1:3]] == ['bag', 'bag.mcap']
    assert len({result_name(name) for name in found}) == len(found)


def test_no_input_gets_a_name_that_belongs_to_another_location(archive):
    owners = {'b': [str(archive / 'cell1/b.mcap')]}
    (owner,) = find_inputs([archive / 'cell1/b.mcap'], owners=owners)
    (other,) = find_inputs([archive / 'cell2/b.mcap'], owners=owners)
    assert owner.name == 'b.mcap'
    assert other.name.startswith('b.mcap-')


@pytest.mark.parametrize(
    ('given', 'sentence'),
    [
        ('missing.mcap', 'missing.mcap does not exist'),
        ('cell1/*.x3p', 'holds no recording and no measurement file'),
        ('none', 'holds no recording and no measurement file'),
    ],
)
def test_what_is_not_there_is_told(archive, given, sentence):
    (archive / 'none').mkdir()
    with pytest.raises(SocialCircleError, match=sentence):
        find_inputs([f'{archive}/{given}'])


def test_the_hash_changes_with_the_content_only(archive):
    before = content_hash(archive / 'bag')
    os.utime(archive / 'bag/bag_0.mcap', ns=(1, 1))
    assert content_hash(archive / 'bag') == before
    (archive / 'bag/bag_1.mcap').rename(archive / 'bag/bag_2.mcap')
    assert content_hash(archive / 'bag') != before


class TestOwnResults:
    """The folder of the results lies in the folder that is searched."""

    @pytest.fixture
    def nights(self, tmp_path, monkeypatch):
        names = ('a.mcap', 'recordings/b.mcap', 'out/mine.mcap', *(f'out/{folder}/c.mcap' for folder in FOLDERS))
        for name in names:
            path = tmp_path / 'nights' / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(name.encode())
        monkeypatch.chdir(tmp_path / 'nights')
        (tmp_path / 'link').symlink_to(tmp_path / 'nights/out')
        (tmp_path / 'nights/other').symlink_to(tmp_path / 'nights/out/recordings')
        return tmp_path / 'nights'

    @pytest.mark.parametrize('output', ['out', './x/../out', '../link', 'file://{}/out', 'local://{}/out/'])
    @pytest.mark.parametrize('given', ['.', '{}', '../nights/', 'file://{}', 'local://{}', '**/*.mcap'])
    def test_they_are_no_inputs_however_they_are_named(self, nights, given, output):
        if 'local:' in given + output:
            pytest.importorskip('fsspec')
        found = find_inputs([given.format(nights)], results=ResultFolder(output.format(nights)))
        expected = ['a.mcap', 'out/mine.mcap', 'recordings/b.mcap']
        assert [os.path.realpath(each.location) for each in found] == [str(nights / name) for name in expected]

    def test_all_folders_of_results_are_known(self):
        assert FOLDER in FOLDERS

    @pytest.mark.parametrize('given', ['out/recordings', 'out/recordings/c.mcap', 'other'])
    def test_alone_they_are_refused(self, nights, given):
        with pytest.raises(
            SocialCircleError, match=f'^{given} holds nothing but the results: give the recordings'
        ):
            find_inputs([given], results=ResultFolder('out'))
        assert [each.name for each in find_inputs([given], results=ResultFolder(nights / 'new'))] == ['c.mcap']

    def test_they_are_told(self, nights):
        left_out = []
        find_inputs(['.'], results=ResultFolder('out'), left_out=left_out.append)
        folders = [f'out/{folder}' for folder in sorted(FOLDERS)]  # `other` leads to one of them
        assert left_out == [str(nights / folder / 'c.mcap') for folder in folders]

    def test_the_folder_that_is_searched_can_take_them(self, nights):
        assert [each.name for each in find_inputs(['out'], results=ResultFolder(nights / 'out'))] == ['mine.mcap']

    def test_a_shell_may_give_their_folder(self, nights):
        (nights / 'empty').mkdir()
        assert [each.name for each in find_inputs(['a.mcap', 'empty'], results=ResultFolder('empty'))] == [
            'a.mcap'
        ]
        with pytest.raises(SocialCircleError, match='empty holds no recording'):
            find_inputs(['a.mcap', 'empty'], results=ResultFolder('out'))

    def test_a_folder_above_the_inputs_can_take_them(self, nights):
        found = find_inputs([nights / 'out'], results=ResultFolder(nights.parent))
        assert len(found) == 1 + len(FOLDERS)

    def test_a_recording_that_is_a_directory_cannot_take_them(self, archive):
        for output in ('bag', 'bag/out'):
            with pytest.raises(
                SocialCircleError, match=f'{output} is in the recording {archive}/bag: give another'
            ):
                find_inputs([archive], results=ResultFolder(archive / output))

    def test_results_at_a_url_are_no_inputs(self):
        fsspec = pytest.importorskip('fsspec')
        files = fsspec.filesystem('memory')
        for name in ('a.mcap', 'out/recordings/a.mcap', 'out/mine.mcap', 'bag/bag_0.mcap', 'bag/metadata.yaml'):
            files.pipe(f'/n/{name}', b'1')
        try:
            for given in ('memory://n', 'memory:///n/*'):
                found = find_inputs([given], results=ResultFolder('memory://n/out/'))
                names = [each.location.removeprefix('memory:///n/') for each in found]
                assert names == ['a.mcap', 'bag', 'out/mine.mcap']
            with pytest.raises(SocialCircleError, match='memory://n/bag/out is in the recording'):
                find_inputs(['memory://n/'], results=ResultFolder('memory://n/bag/out'))
        finally:
            files.rm('/n', recursive=True)


class TestUrls:
    @pytest.fixture
    def files(self):
        fsspec = pytest.importorskip('fsspec')
        files = fsspec.filesystem('memory')
        for name in ('n/cell1/a.mcap', 'n/bag/bag_0.mcap', 'n/bag/metadata.yaml', 'n/notes.txt'):
            files.pipe(f'/{name}', (BAGS / 'padded.mcap').read_bytes())
        yield files
        files.rm('/n', recursive=True)

    @pytest.mark.usefixtures('files')
    def test_folders_and_globs_are_searched(self):
        assert names('memory://n') == ['bag', 'cell1/a.mcap']
        assert names('memory://n/*/a.mcap') == ['a.mcap']
        assert find_inputs(['memory://n/cell1/a.mcap'])[0].location == 'memory:///n/cell1/a.mcap'

    def test_their_time_is_that_of_the_store_to_the_microsecond(self, files):
        changed = files.info('/n/cell1/a.mcap')['created']
        since = (changed - datetime(1970, 1, 1, tzinfo=timezone.utc)) // timedelta(microseconds=1)
        assert find_inputs(['memory://n/cell1/a.mcap'])[0].time_ns == since * 1000

    @pytest.mark.usefixtures('files')
    def test_a_copy_is_there_for_a_while(self):
        with local_copy('memory:///n/cell1/a.mcap') as path:
            assert path.read_bytes() == (BAGS / 'padded.mcap').read_bytes()
        assert not path.exists()
        with local_copy('memory:///n/bag') as path:
            assert sorted(each.name for each in path.iterdir()) == ['bag_0.mcap', 'metadata.yaml']

    @pytest.mark.parametrize(
        ('url', 'sentence'),
        [('memory://missing.mcap', 'does not exist'), ('nothing://a.mcap', 'cannot be opened: ValueError')],
    )
    def test_what_is_not_there_is_told(self, url, sentence):
        pytest.importorskip('fsspec')
        with pytest.raises(SocialCircleError, match=sentence):
            find_inputs([url])


def test_an_object_store_is_searched_anew_each_time(monkeypatch):
    pytest.importorskip('moto.server')
    pytest.importorskip('s3fs')
    with object_store(monkeypatch) as files:
        for name in ('cell1/a.mcap', 'bag/bag_0.mcap', 'bag/metadata.yaml', 'notes.txt'):
            files.pipe(f'plant/{name}', name.encode())
        before = find_inputs(['s3://plant'])
        assert [(each.location, each.name) for each in before] == [
            ('s3://plant/bag', 'bag'),
            ('s3://plant/cell1/a.mcap', 'cell1/a.mcap'),
        ]
        assert all(each.changed and each.time_ns for each in before)
        with local_copy('s3://plant/bag') as path:
            assert sorted(each.name for each in path.iterdir()) == ['bag_0.mcap', 'metadata.yaml']
        files.pipe('plant/cell1/a.mcap', b'longer than it was')
        files.pipe('plant/cell1/b.mcap', b'new')
        after = find_inputs(['s3://plant/cell1/*'])
        assert [(each.name, each.size) for each in after] == [('a.mcap', 18), ('b.mcap', 3)]
        assert after[0].changed != before[1].changed
        with pytest.raises(SocialCircleError, match='s3://other does not exist'):
            find_inputs(['s3://other'])


def test_a_single_input_is_no_list_of_letters(archive, monkeypatch):
    monkeypatch.chdir(archive)
    assert find_inputs('a.mcap') == find_inputs(archive / 'a.mcap') == find_inputs(['a.mcap'])


def test_no_input_is_told():
    with pytest.raises(SocialCircleError, match='There is no input'):
        find_inputs([])


def test_folders_that_link_to_each_other_are_searched_once(archive):
    (archive / 'cell1/up').symlink_to(archive)
    (archive / 'cell1/other').symlink_to('../cell2')
    (archive / 'cell2/other').symlink_to('../cell1')
    (archive / 'a link').symlink_to('bag')
    assert names(archive) == [
        'a.mcap', 'bag', 'cell1/b.mcap', 'cell1/c.al3d', 'cell2/b.mcap', 'x [1].mcap.zstd',
    ]  # fmt: skip


@pytest.mark.parametrize('target', ['b.mcap', 'gone.mcap'])
def test_a_link_that_leads_nowhere_is_told(tmp_path, target):
    (tmp_path / 'b.mcap').symlink_to(target)
    for given in (tmp_path, tmp_path / 'b.mcap'):
        with pytest.raises(
            SocialCircleError, match=r'b\.mcap cannot be read \(.*\): check its permissions and links'
        ):
            find_inputs([given])


def test_a_link_to_a_folder_elsewhere_is_followed(archive, tmp_path_factory):
    top = tmp_path_factory.mktemp('top')
    (top / 'night').symlink_to(archive / 'cell2')
    assert names(top) == ['night/b.mcap']
