# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all, and what else may have their name."""

import os
import signal
import socket
import stat
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import (
    SignalExit,
    Unfinished,
    check_place,
    open_in_place,
    remove_leftovers_below,
    write_file,
)


def a_folder(path):
    path.mkdir()
    (path / 'inside').write_text('old')


def a_symbolic_link(path):
    (path.parent / 'elsewhere').write_text('old')
    path.symlink_to(path.parent / 'elsewhere')


def a_dangling_link(path):
    path.symlink_to(path.parent / 'nowhere')


def a_named_pipe(path):
    os.mkfifo(path)


def a_socket(path):
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))


def a_device(path):
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
    except PermissionError:
        pytest.skip('devices cannot be made here')


UNUSUAL = [a_folder, a_symbolic_link, a_dangling_link, a_named_pipe, a_socket, a_device]


def state_of(folder):
    """Every entry below a folder: its kind, and its content if it is a file."""
    return {
        path.relative_to(folder): (stat.S_IFMT(path.lstat().st_mode), path.is_symlink() or not path.is_file())
        if path.is_symlink() or not path.is_file()
        else path.read_bytes()
        for path in folder.rglob('*')
    }


def in_a_process(program, folder, **options):
    """Start a program in a process of its own, which says `ready` when it waits."""
    process = subprocess.Popen(
        [sys.executable, '-c', textwrap.dedent(program)],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip
    assert process.stdout.readline() == 'ready\n', process.communicate()
    return process


WAITING = """\
    import sys, time
    from pathlib import Path
    from socialcircle_ros.storage import Unfinished
    with Unfinished(Path('a.html'){options}) as file:
        print('ready', flush=True)
        sys.stdin.readline()
        file.complete()
    """


TWO_AT_A_TIME = """\
    import signal
    from pathlib import Path
    from socialcircle_ros.storage import Unfinished
    with Unfinished(Path('a')), Unfinished(Path('b')) as other:
        assert callable(signal.getsignal(signal.SIGTERM))
        other.complete()
        assert callable(signal.getsignal(signal.SIGTERM))
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL
    print('ready')
    """


@given(content=st.binary(max_size=5000) | st.text(st.characters(exclude_categories=['Cs'])))
def test_what_is_written_is_what_was_given(content, tmp_path_factory):
    path = tmp_path_factory.mktemp('content') / 'a.txt'
    write_file(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert list(path.parent.iterdir()) == [path]


def test_a_file_is_replaced_and_keeps_its_permissions(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('old')
    path.chmod(0o640)
    write_file(path, 'new')
    assert path.read_text() == 'new'
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_new_file_has_the_permissions_that_the_process_gives(tmp_path):
    before = os.umask(0o027)
    try:
        write_file(tmp_path / 'a.yaml', '')
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'a.yaml').stat().st_mode) == 0o640


@pytest.mark.parametrize('unusual', UNUSUAL)
def test_what_is_not_a_file_is_neither_followed_nor_replaced(tmp_path, unusual):
    path = tmp_path / 'a.yaml'
    unusual(path)
    before = state_of(tmp_path)
    with pytest.raises(SocialCircleError, match=r'a\.yaml is .*, and is not overwritten: give another name'):
        write_file(path, 'new')
    assert state_of(tmp_path) == before


@pytest.mark.parametrize('unusual', UNUSUAL)
def test_a_place_that_cannot_be_written_is_told_beforehand(tmp_path, unusual):
    unusual(tmp_path / 'a.yaml')
    before = state_of(tmp_path)
    with pytest.raises(SocialCircleError, match=r'a\.yaml is .*, and is not overwritten'):
        check_place(tmp_path / 'a.yaml')
    with pytest.raises(SocialCircleError, match='cannot be written: No such file or directory'):
        check_place(tmp_path / 'nowhere/a.yaml')
    assert state_of(tmp_path) == before


def test_a_place_that_can_be_written_keeps_what_is_there(tmp_path):
    check_place(tmp_path / 'new.yaml')
    (tmp_path / 'old.yaml').write_text('old')
    check_place(tmp_path / 'old.yaml')
    assert state_of(tmp_path) == {Path('old.yaml'): b'old'}


@pytest.mark.parametrize('unusual', UNUSUAL)
def test_a_file_that_grows_in_place_is_a_file(tmp_path, unusual):
    unusual(tmp_path / 'node.log')
    before = state_of(tmp_path)
    with pytest.raises(SocialCircleError, match=r'node\.log is .*, and is not overwritten'):
        open_in_place(tmp_path / 'node.log')
    assert state_of(tmp_path) == before


def test_a_file_in_place_begins_anew_or_goes_on(tmp_path):
    for append, content in [(False, b'1'), (True, b'11'), (False, b'1')]:
        with open_in_place(tmp_path / 'node.log', append=append) as log:
            log.write(b'1')
        assert (tmp_path / 'node.log').read_bytes() == content


@pytest.mark.parametrize('unusual', UNUSUAL)
def test_what_takes_the_name_meanwhile_is_not_replaced(tmp_path, unusual):
    with Unfinished(tmp_path / 'a.yaml') as file:
        unusual(tmp_path / 'a.yaml')
        with pytest.raises(SocialCircleError, match='is not overwritten'):
            file.complete()
    assert not list(tmp_path.glob('*.partial'))


@pytest.mark.parametrize('unusual', [a_symbolic_link, a_named_pipe, a_device])
def test_what_waits_under_the_temporary_name_is_not_opened(tmp_path, unusual, monkeypatch):
    monkeypatch.setattr('secrets.token_hex', lambda length: 'ab' * length)
    waiting = tmp_path / 'a.yaml.abababab.partial'
    unusual(waiting)
    before = state_of(tmp_path)
    with pytest.raises(SocialCircleError, match=r'a\.yaml cannot be written: File exists'):
        write_file(tmp_path / 'a.yaml', 'new')
    assert state_of(tmp_path) == before


@pytest.mark.parametrize('error', [KeyboardInterrupt, ValueError, SignalExit(signal.SIGTERM)])
def test_an_error_leaves_what_was_there(tmp_path, error):
    (tmp_path / 'a.html').write_text('old')
    with pytest.raises((KeyboardInterrupt, ValueError, SystemExit)), Unfinished(tmp_path / 'a.html') as file:
        os.write(file.descriptor, b'new')
        raise error
    assert state_of(tmp_path) == {(tmp_path / 'a.html').relative_to(tmp_path): b'old'}


def test_an_object_that_is_lost_leaves_nothing(tmp_path):
    Unfinished(tmp_path / 'a.html')
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_told(tmp_path):
    with pytest.raises(SocialCircleError, match='cannot be written: No such file or directory'):
        write_file(tmp_path / 'none' / 'a.html', '')


@pytest.mark.parametrize('folder', [False, True])
def test_a_name_that_was_taken_meanwhile_is_not_taken_back(tmp_path, folder):
    with Unfinished(tmp_path / 'a.x', folder=folder) as file:
        a_folder(tmp_path / 'a.x') if folder else (tmp_path / 'a.x').write_text('old')
        with pytest.raises(FileExistsError):
            file.complete(replace=False)
        assert file.keep() == tmp_path / 'a_2.x'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['a.x', 'a_2.x']


def test_a_folder_takes_the_place_of_a_folder(tmp_path):
    a_folder(tmp_path / 'bag')
    with Unfinished(tmp_path / 'bag', folder=True) as folder:
        (folder.path / 'new').write_text('new')
        folder.complete()
    assert [path.name for path in (tmp_path / 'bag').iterdir()] == ['new']
    assert [path.name for path in tmp_path.iterdir()] == ['bag']


@pytest.mark.parametrize('ending', [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.parametrize('options', ['', ', folder=True', ', kept=True'])
def test_a_signal_removes_it_and_ends_the_process(tmp_path, ending, options):
    process = in_a_process(WAITING.format(options=options), tmp_path, stdin=subprocess.PIPE)
    assert len(list(tmp_path.iterdir())) == 1
    process.send_signal(ending)
    process.communicate(timeout=300)
    assert process.returncode == (-ending if ending == signal.SIGINT else 128 + ending)
    assert list(tmp_path.iterdir()) == []


def test_a_signal_that_is_ignored_stays_ignored(tmp_path):
    process = in_a_process(
        'import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n'
        + textwrap.dedent(WAITING.format(options='')),
        tmp_path,
        stdin=subprocess.PIPE,
    )
    process.send_signal(signal.SIGHUP)
    process.communicate('\n', timeout=300)
    assert process.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ['a.html']


def test_the_signals_act_as_before_when_all_is_written(tmp_path):
    process = in_a_process(TWO_AT_A_TIME, tmp_path)
    process.communicate(timeout=300)
    assert process.returncode == 0


def test_a_thread_writes_too(tmp_path):
    thread = threading.Thread(target=write_file, args=(tmp_path / 'a', 'new'))
    thread.start()
    thread.join()
    assert (tmp_path / 'a').read_text() == 'new'


@pytest.mark.parametrize('options', ['', ', folder=True'])
def test_what_a_killed_process_left_is_removed_by_the_next_with_a_word(tmp_path, caplog, options):
    process = in_a_process(WAITING.format(options=options), tmp_path, stdin=subprocess.PIPE)
    process.kill()
    process.communicate()
    (left,) = tmp_path.iterdir()
    write_file(tmp_path / 'other.html', '')
    assert left.exists()
    write_file(tmp_path / 'a.html', 'new')
    assert not left.exists()
    assert f'{left} was left by a process that was killed; it is removed.' in caplog.text


def test_what_killed_processes_left_below_a_folder_is_removed_and_what_is_in_use_stays(tmp_path):
    below = tmp_path / 'recordings'
    below.mkdir()
    killed, writing = (in_a_process(WAITING.format(options=''), below, stdin=subprocess.PIPE) for _ in range(2))
    (below / 'a.html').write_text('done by another process')
    killed.kill()
    killed.communicate()
    assert len(list(below.iterdir())) == 3
    remove_leftovers_below(tmp_path)
    assert len(list(below.iterdir())) == 2
    assert (below / 'a.html').read_text() == 'done by another process'
    writing.kill()
    writing.communicate()
    remove_leftovers_below(tmp_path)
    assert list(below.iterdir()) == [below / 'a.html']


@pytest.mark.parametrize('options', [', kept=True', ', kept=True, folder=True'])
def test_what_was_to_be_kept_of_a_killed_process_gets_a_name(tmp_path, caplog, options):
    for name in ('a_unfinished.html', 'a_unfinished_2.html'):
        process = in_a_process(WAITING.format(options=options), tmp_path, stdin=subprocess.PIPE)
        process.kill()
        process.communicate()
        write_file(tmp_path / 'a.html', 'new')
        assert (tmp_path / name).exists()
        assert f'it is kept as {tmp_path / name}' in caplog.text
        (tmp_path / 'a.html').unlink()
    assert len(list(tmp_path.iterdir())) == 2


def test_what_another_process_writes_is_left_alone(tmp_path):
    process = in_a_process(WAITING.format(options=''), tmp_path, stdin=subprocess.PIPE)
    write_file(tmp_path / 'a.html', 'first')
    assert len(list(tmp_path.iterdir())) == 2
    process.communicate('\n', timeout=300)
    assert process.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ['a.html']


def test_a_folder_that_lost_its_name_when_a_process_was_killed_has_it_again(tmp_path, caplog):
    a_folder(tmp_path / 'bag.0123abcd.replaced')
    with Unfinished(tmp_path / 'bag', folder=True):
        pass
    assert (tmp_path / 'bag' / 'inside').read_text() == 'old'
    assert 'has its name again' in caplog.text
