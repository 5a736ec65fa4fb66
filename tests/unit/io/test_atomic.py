import multiprocessing
import os
import sys

import numpy as np
import pytest

from scanlock.io import atomic, atomic_file, read_labels, write_labels


def test_files_are_written_and_replaced(tmp_path):
    path = tmp_path / "a.txt"
    for content in (b"one", b"two"):
        with atomic_file(path) as handle:
            handle.write(content)
        assert path.read_bytes() == content
    assert os.listdir(tmp_path) == ["a.txt"]


def test_an_error_leaves_only_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")

    def fail():
        with atomic_file(path) as handle:
            handle.write(b"half of the n")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_old_file_exists_until_the_new_one_is_complete(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")
    with atomic_file(path) as handle:
        handle.write(b"new")
        handle.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"


@pytest.mark.skipif(os.name != "posix", reason="modes and links of POSIX file systems")
def test_modes_are_kept_and_links_followed(tmp_path):
    plain = tmp_path / "plain.txt"
    plain.touch()
    path = tmp_path / "a.txt"
    link = tmp_path / "link.txt"
    with atomic_file(path) as handle:
        handle.write(b"1")
    assert path.stat().st_mode == plain.stat().st_mode
    path.chmod(0o600)
    link.symlink_to(path)
    with atomic_file(link) as handle:
        handle.write(b"2")
    assert link.is_symlink()
    assert path.read_bytes() == b"2"
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_missing_folder_is_named(tmp_path):
    with (
        pytest.raises(FileNotFoundError, match="folder to write into"),
        atomic_file(tmp_path / "no" / "a.txt"),
    ):
        pass
    with pytest.raises(IsADirectoryError), atomic_file(tmp_path):
        pass


def test_names_of_the_maximum_length_are_written(tmp_path):
    path = tmp_path / ("\N{LATIN SMALL LETTER SHARP S}" * 125 + ".txt")
    with atomic_file(path) as handle:
        handle.write(b"1")
    assert path.read_bytes() == b"1"


def _interrupted(path, moment):
    """Write a file, interrupted before an instruction; return whether it is reached."""
    left = moment

    def follow(frame, event, _):
        nonlocal left
        if frame.f_code.co_filename != atomic.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            left -= 1
            if left < 0:
                raise KeyboardInterrupt
        return follow

    before = sys.gettrace()
    sys.settrace(follow)
    try:
        with atomic_file(path) as handle:
            handle.write(b"new")
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="a file that is open cannot be removed there")
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_an_interrupt_at_any_instruction_leaves_the_old_or_the_new_file(tmp_path):
    path = tmp_path / "a.txt"
    seen = []
    while True:
        path.write_bytes(b"old")
        if not _interrupted(path, len(seen)):
            break
        assert os.listdir(tmp_path) == ["a.txt"]
        seen.append(path.read_bytes())
    # The old file up to some instruction, and the new one after it.
    assert seen == sorted(seen, reverse=True)
    assert set(seen) == {b"old", b"new"}
    assert len(seen) > 100


_LABELS = 20_000
_WRITERS = 8


def _write_repeatedly(path, value, start):
    start.wait()
    for _ in range(25):
        write_labels(path, np.full(_LABELS, value))


@pytest.mark.slow
@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_concurrent_writers_leave_a_complete_file(tmp_path):
    path = tmp_path / "labels.npy"
    write_labels(path, np.zeros(_LABELS, np.int64))
    context = multiprocessing.get_context("fork")
    start = context.Barrier(_WRITERS)
    writers = [
        context.Process(target=_write_repeatedly, args=(path, value, start))
        for value in range(_WRITERS)
    ]
    for writer in writers:
        writer.start()
    seen = set()
    while any(writer.is_alive() for writer in writers):
        found = set(read_labels(path, count=_LABELS).tolist())
        assert len(found) == 1
        seen |= found
    assert [writer.exitcode for writer in writers] == [0] * _WRITERS
    assert os.listdir(tmp_path) == ["labels.npy"]
    assert len(seen) > 1
