import errno

import pytest

from scanlock.cli.errors import complain, nearest, one_line
from scanlock.errors import InvalidInput


def test_the_nearest_choice_is_suggested():
    assert nearest("pdc", ["bin", "pcd", "ply"]) == "; did you mean pcd?"
    assert nearest("quite else", ["bin", "pcd", "ply"]) == ""


def test_messages_become_one_line():
    assert one_line(InvalidInput("first\n  second")) == "first second"


def test_a_missing_file_suggests_a_similar_name(tmp_path):
    (tmp_path / "scan_0001.bin").touch()
    path = tmp_path / "scan_001.bin"
    error = FileNotFoundError(errno.ENOENT, "No such file or directory", str(path))
    assert one_line(error) == (f"{path}: no such file or directory; did you mean scan_0001.bin?")


def test_a_missing_folder_has_no_suggestion(tmp_path):
    path = tmp_path / "nowhere" / "scan.bin"
    error = FileNotFoundError(errno.ENOENT, "No such file or directory", str(path))
    assert one_line(error) == f"{path}: no such file or directory"


def test_a_permission_error_names_the_file():
    error = PermissionError(errno.EACCES, "Permission denied", "/secret")
    assert one_line(error) == "/secret: permission denied; check its permissions"


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "no space left on device"),
        (OSError("odd"), "odd"),
    ],
)
def test_other_system_errors_keep_their_message(error, line):
    assert one_line(error) == line


def test_errors_are_printed_on_one_line_without_markup(capsys):
    complain("[red]x " * 40)
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"scanlock: {'[red]x ' * 40}\n")
