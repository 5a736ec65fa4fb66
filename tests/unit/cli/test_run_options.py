import pytest

from scanlock import METHODS, Gicp
from scanlock.cli.run_options import NAME, changed_options, digest, write_options

OPTIONS = {"method": "auto", "voxel_size": 0.1, "covariance": None, "agree": False}


def test_differences_are_named_with_both_values(tmp_path):
    assert changed_options(tmp_path, OPTIONS) is None
    write_options(tmp_path, OPTIONS)
    assert changed_options(tmp_path, OPTIONS) == []
    other = OPTIONS | {"voxel_size": 0.2, "covariance": "sandwich"}
    assert changed_options(tmp_path, other) == [
        "voxel_size was 0.1, is 0.2",
        "covariance was None, is sandwich",
    ]


@pytest.mark.parametrize("content", ["{", "[1]", ""])
def test_a_damaged_file_is_a_difference(tmp_path, content):
    (tmp_path / NAME).write_text(content)
    assert changed_options(tmp_path, OPTIONS) == [f"{NAME} is not readable"]


def test_equal_settings_have_equal_digests():
    assert digest(Gicp(), "a") == digest(METHODS["gicp"], "a")
    assert digest(Gicp(), "a") != digest(Gicp(voxel_size=0.3), "a")
