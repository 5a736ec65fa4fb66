import os
import socket

import pytest

from scanlock.errors import FormatError
from scanlock.io import errors, read_pose, read_scan


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="needs Unix devices")
@pytest.mark.parametrize("read", [read_scan, read_pose])
def test_endless_devices_are_refused_without_reading(read):
    with pytest.raises(FormatError, match=r"/dev/zero: expected a .* found a character device"):
        read("/dev/zero")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs Unix pipes")
def test_pipes_and_sockets_are_refused_without_reading(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # names of sockets must be short
    os.mkfifo(tmp_path / "a.pcd")
    with pytest.raises(FormatError, match="found a pipe"):
        read_scan(tmp_path / "a.pcd")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("s")
        with pytest.raises(FormatError, match="found a socket"):
            read_scan("s")


def test_files_above_the_free_memory_are_refused_by_their_size(tmp_path, save):
    path = save("a.bin", bytes(12))
    with path.open("r+b") as file:
        file.truncate(1 << 42)
    with pytest.raises(FormatError, match=r"the free memory, found one of 4398\.0 GB"):
        read_scan(path)
    assert errors.free_memory() > 1 << 20


def test_a_file_used_as_a_folder_does_not_exist(save):
    with pytest.raises(FileNotFoundError, match="no such scan file"):
        read_scan(save("a.bin", bytes(12)) / "b.bin")
