import os

import pytest

from scanlock.io import atomic_file


def test_writes_and_replaces(tmp_path):
    path = tmp_path / "a.txt"
    for content in (b"one", b"two"):
        with atomic_file(path) as handle:
            handle.write(content)
        assert path.read_bytes() == content
    assert os.listdir(tmp_path) == ["a.txt"]


def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path):
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


def test_the_old_file_stands_until_the_new_one_is_complete(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")
    with atomic_file(path) as handle:
        handle.write(b"new")
        handle.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"


@pytest.mark.skipif(os.name != "posix", reason="modes and links of POSIX file systems")
def test_keeps_modes_and_follows_links(tmp_path):
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


def test_says_which_folder_is_missing(tmp_path):
    with (
        pytest.raises(FileNotFoundError, match="folder to write into"),
        atomic_file(tmp_path / "no" / "a.txt"),
    ):
        pass
    with pytest.raises(IsADirectoryError), atomic_file(tmp_path):
        pass
