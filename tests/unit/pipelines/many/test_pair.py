import numpy as np
import pytest

from scanlock import FormatError, InvalidInput, Pair, Pose, read_pairs
from scanlock.pipelines.many.pair import extra_columns, pair_of


def _table(tmp_path, text):
    path = tmp_path / "list.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_paths_are_relative_to_the_folder_of_the_table(tmp_path):
    path = _table(
        tmp_path,
        '\ufeffsource, target,initial,name,place\na.bin,/b.bin,p.txt,first,"Hall 1, north"\n\n'
        "c.bin,d.bin,,,\n",
    )
    first, second = read_pairs(path)
    assert (first.source, first.target) == (str(tmp_path / "a.bin"), "/b.bin")
    assert (first.initial, first.name) == (str(tmp_path / "p.txt"), "first")
    assert first.extra == {"place": "Hall 1, north"}
    assert (second.initial, second.name, second.extra) == (None, "", {"place": ""})
    assert extra_columns(path) == ["place"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: expected a header with source and target, found an empty file"),
        ("a.bin,b.bin\n", "line 1: expected a header with source and target, found a.bin, b.bin"),
        ("source,target,source\n", "line 1: the column 'source' is repeated"),
        ("source,target,overlap\n", "the column 'overlap' is repeated or is a column of the res"),
        ("source,target\na,b\n\na,b,c\n", "line 4: expected 2 columns as in the header, found 3"),
    ],
)
def test_a_malformed_table_is_named_with_its_line(tmp_path, text, message):
    with pytest.raises(FormatError, match=message):
        list(read_pairs(_table(tmp_path, text)))


def test_names_come_from_files_or_from_the_number():
    points = np.zeros((1, 3))
    assert pair_of(("x/a.bin", "y/b.las"), 3).name == "a b"
    assert pair_of((points, points), 3).name == "pair 3"
    assert pair_of(["x/a.bin", points], 3).name == "a array 3"
    assert pair_of(Pair(source="a", target="b", name="mine"), 3).name == "mine"
    initial = Pose.identity()
    assert pair_of(Pair(source="a", target="b", initial=initial), 0).initial is initial


@pytest.mark.parametrize("item", ["a.bin", ("a", "b", "c"), 5])
def test_an_item_that_is_not_a_pair_is_named_with_its_number(item):
    with pytest.raises(InvalidInput, match=r"pairs must hold .* as number 7"):
        pair_of(item, 7)


def test_further_values_must_not_replace_results():
    with pytest.raises(InvalidInput, match=r"extra must not hold a column of the results.*'score'"):
        Pair(source="a", target="b", extra={"score": "1"})
