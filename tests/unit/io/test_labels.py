import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_labels, write_labels


@pytest.mark.parametrize("name", ["a.npy", "a.txt", "a.csv", "a.label", "A.LABEL"])
def test_round_trip(tmp_path, name):
    labels = np.array([0, 5, 2, 40 | 7 << 16, 2**32 - 1])
    write_labels(tmp_path / name, labels)
    again = read_labels(tmp_path / name, count=5)
    assert again.dtype == np.int64
    assert np.array_equal(again, labels)


@pytest.mark.parametrize("name", ["a.npy", "a.txt", "a.csv"])
def test_negative_labels_are_kept(tmp_path, name):
    write_labels(tmp_path / name, [-1, 0, 2**62 + 1])
    assert read_labels(tmp_path / name).tolist() == [-1, 0, 2**62 + 1]


def test_files_have_the_expected_bytes(tmp_path):
    for name in ("a.npy", "a.csv", "a.txt", "a.label"):
        write_labels(tmp_path / name, np.array([True, False]))
    assert np.load(tmp_path / "a.npy").tolist() == [1, 0]
    assert (tmp_path / "a.csv").read_text() == "label\n1\n0\n"
    assert (tmp_path / "a.txt").read_text() == "1\n0\n"
    assert (tmp_path / "a.label").read_bytes() == bytes([1, 0, 0, 0, 0, 0, 0, 0])


def test_text_is_read_with_and_without_a_heading(save):
    assert read_labels(save("a.txt", "# ground\n1\n\n0 # no\n")).tolist() == [1, 0]
    assert read_labels(save("a.csv", '"class of point"\n7\n')).tolist() == [7]


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.label", bytes(7), "byte 4: expected whole uint32"),
        ("a.label", b"", "empty file"),
        ("a.txt", "1\n2 3\n", "line 2: expected 1 numbers, found 2"),
        ("a.txt", "1\n2.5\n", "numbers with fractions"),
        ("a.txt", "label\n", "whole number per point, found none"),
        ("a.npy", b"1\n2\n", "NumPy"),
    ],
)
def test_errors_name_the_invalid_content(save, name, content, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_labels(save(name, content))


@pytest.mark.parametrize("array", [np.zeros(3), np.zeros((3, 1), int), np.zeros(0, int)])
def test_arrays_that_are_no_labels_are_refused(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FormatError, match="whole number per point"):
        read_labels(tmp_path / "a.npy")
    with pytest.raises(InvalidInput, match="whole numbers of shape"):
        write_labels(tmp_path / "b.npy", array)


def test_another_number_of_labels_than_points_is_refused(tmp_path):
    write_labels(tmp_path / "a.label", [1, 2, 3])
    with pytest.raises(FormatError, match=r"expected 4 labels, one for each row .*, found 3"):
        read_labels(tmp_path / "a.label", count=4)


def test_values_and_extensions_out_of_range_are_refused(tmp_path):
    for values in ([-1, 0], [0, 2**32]):
        with pytest.raises(InvalidInput, match="between 0 and 4294967295"):
            write_labels(tmp_path / "a.label", values)
    with pytest.raises(InvalidInput, match="signed 64-bit"):
        write_labels(tmp_path / "a.npy", np.array([2**63], dtype=np.uint64))
    with pytest.raises(InvalidInput, match="extension of a label file"):
        write_labels(tmp_path / "a.pcd", [1])
    with pytest.raises(InvalidInput, match="extension of a label file"):
        read_labels(tmp_path / "a.pcd")
    assert list(tmp_path.iterdir()) == []
