import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan

_TEXT = """# made by hand
mtllib a.mtl
o wall
v 1 2.5 3
vn 0 0 1
  v 4 5 6 # the second
vt 0.5 0.5
v -7 8 9
usemtl vivid
f 1//1 2//1 3//1
"""


def test_vertices_are_read_and_all_else_is_noted(save):
    scan = read_scan(save("a.obj", _TEXT))
    assert scan.points.tolist() == [[1, 2.5, 3], [4, 5, 6], [-7, 8, 9]]
    assert dict(scan.fields) == {}
    assert scan.notes == ("faces, normals, textures left out",)
    assert read_scan(save("b.unknown", _TEXT)).format == "obj"


def test_colours_and_weights_of_vertices_are_fields(save):
    scan = read_scan(save("a.obj", "v 1 2 3 0.5 0 1\nv 4 5 6 1 1 1\n"))
    assert scan.fields["red"].tolist() == [0.5, 1]
    assert read_scan(save("a.obj", "v 1 2 3 1\nv 4 5 6 1\n")).fields["w"].tolist() == [1, 1]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("o a\nf 1 2 3\n", "vertices v x y z"),
        ("v 1 2\n", "vertices v x y z.*found vertices of 2 numbers"),
        ("o a\nv 1 2 3\nvn 0 0 1\nv 1 2\n", "line 4: expected 3 numbers as on line 2"),
        ("v 1 2 x\n", "expected a number, found 'x'"),
        ("v 1 2 3\0\n", "the byte 0x00"),
    ],
)
def test_malformed_vertices_are_refused(save, text, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.obj", text), format="obj")


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_round_trip(tmp_path, dtype):
    points = (np.random.default_rng(0).normal(size=(6, 3)) * 30).astype(dtype)
    points[2, 1] = np.nan
    write_scan(tmp_path / "a.obj", points)
    assert np.array_equal(
        read_scan(tmp_path / "a.obj").points.astype(dtype), points, equal_nan=True
    )
    colours = {name: np.arange(6, dtype=np.uint8) * 51 for name in ("red", "green", "blue")}
    write_scan(tmp_path / "a.obj", points, colours)
    again = read_scan(tmp_path / "a.obj")
    assert np.allclose(again.fields["red"], np.arange(6) / 5, atol=1e-7)
    with pytest.raises(InvalidInput, match=r"fields of \.obj must be red, green and blue"):
        write_scan(tmp_path / "a.obj", points, {"ring": np.arange(6)})
