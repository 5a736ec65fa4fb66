import importlib.util
import subprocess
import sys

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import FORMATS, read_scan, write_scan
from scanlock.io.formats.registry import WRITABLE

_POINTS = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32) * 10
_NAMES = [extension for known in FORMATS.values() for extension in known.extensions]
_INSTALLED = [name for name in FORMATS if name != "e57" or importlib.util.find_spec("pye57")]
_WRITTEN = [name for name in WRITABLE if name in _INSTALLED]
_VTP = """<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="1"><Points>
<DataArray type="Float32" NumberOfComponents="3" format="ascii">1 2 3</DataArray>
</Points></Piece></PolyData></VTKFile>
"""


def _write(path, name):
    if name == "vtp":
        path.write_text(_VTP)
    else:
        write_scan(path, _POINTS, format=name)
    return 1 if name == "vtp" else 40


@pytest.mark.parametrize(
    "extension", [extension for name in _WRITTEN for extension in FORMATS[name].extensions]
)
def test_every_extension_is_written_and_read(tmp_path, extension):
    path = tmp_path / f"a{extension.upper()}"
    write_scan(path, _POINTS)
    scan = read_scan(path)
    assert np.abs(scan.points - _POINTS).max() < 1e-4
    assert extension in FORMATS[scan.format].extensions


def test_no_extension_belongs_to_two_formats():
    assert len(set(_NAMES)) == len(_NAMES)
    assert all(name.startswith(".") and name == name.lower() for name in _NAMES)


@pytest.mark.parametrize("name", [name for name in _INSTALLED if name != "bin"])
def test_the_format_of_unknown_extensions_is_detected_from_the_content(tmp_path, name):
    path = tmp_path / "a.scan"
    _write(path, name)
    assert read_scan(path).format == name


def test_raw_floats_need_their_extension_or_a_format(tmp_path):
    path = tmp_path / "a.scan"
    write_scan(path, _POINTS, format="bin")
    with pytest.raises(FormatError, match=r"neither the extension \(.scan\) nor the content"):
        read_scan(path)
    assert len(read_scan(path, format="bin", columns=3)) == 40


@pytest.mark.parametrize("stored", _INSTALLED)
@pytest.mark.parametrize("named", list(FORMATS))
def test_an_extension_that_disagrees_with_the_content_is_refused(tmp_path, stored, named):
    path = tmp_path / f"a{FORMATS[named].extensions[0]}"
    count = _write(path, stored)
    if stored == named or (stored, named) == ("txt", "pts"):
        assert len(read_scan(path)) == count
        return
    found = FORMATS[stored].title if stored != "bin" else "unknown binary data"
    if stored == "bin" and named in ("txt", "pts", "ptx", "obj"):
        found = "the byte 0x"
    with pytest.raises(FormatError) as caught:
        read_scan(path)
    assert found in str(caught.value)
    if stored != "bin":
        assert FORMATS[named].title in str(caught.value)
        assert f'format="{stored}"' in str(caught.value)
        assert len(read_scan(path, format=stored)) == count


@pytest.mark.parametrize("name", _NAMES)
def test_empty_files_are_refused_for_every_extension(save, name):
    with pytest.raises(FormatError, match="byte 0: expected a scan file, found an empty file"):
        read_scan(save(f"a{name}", b""))


def test_missing_files_and_folders_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such scan file") as caught:
        read_scan(tmp_path / "no.pcd")
    assert caught.value.filename == str(tmp_path / "no.pcd")
    with pytest.raises(FormatError, match="found a folder"):
        read_scan(tmp_path)


def test_unknown_formats_and_encodings_are_refused(tmp_path, save):
    path = tmp_path / "a.pcd"
    with pytest.raises(InvalidInput, match="format must be one of bin, npy"):
        write_scan(path, _POINTS, format="pdc")
    with pytest.raises(InvalidInput, match="format must be one of bin, npy"):
        read_scan(save("b.pcd", b"x"), format="pdc")
    with pytest.raises(InvalidInput, match="must be that of a scan format"):
        write_scan(tmp_path / "a.stl", _POINTS)
    with pytest.raises(InvalidInput, match="encoding of npy must be one of binary"):
        write_scan(tmp_path / "a.npy", _POINTS, encoding="ascii")
    with pytest.raises(InvalidInput, match="height and viewpoint cannot be written as ply"):
        write_scan(tmp_path / "a.ply", _POINTS, height=2)
    with pytest.raises(InvalidInput, match="VTK XML PolyData cannot be written; the formats"):
        write_scan(tmp_path / "a.vtp", _POINTS)
    assert list(tmp_path.iterdir()) == [tmp_path / "b.pcd"]


@pytest.mark.parametrize(
    "points",
    [np.zeros((4, 2)), np.zeros((4, 4)), np.zeros(3), np.zeros((0, 3)), np.full((2, 3), "a")],
)
def test_arrays_that_are_no_points_are_not_written(tmp_path, points):
    with pytest.raises(InvalidInput, match="points must"):
        write_scan(tmp_path / "a.npy", points)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_keeps_the_old_scan(tmp_path):
    path = tmp_path / "a.ply"
    write_scan(path, _POINTS)
    before = path.read_bytes()
    with pytest.raises(InvalidInput):
        write_scan(path, _POINTS, {"t": np.full(40, 2**60)})
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.ply"]


def test_written_arrays_stay_writable(tmp_path):
    points, ring = _POINTS.copy(), np.arange(40)
    write_scan(tmp_path / "a.pcd", points, {"ring": ring})
    points[0], ring[0] = 1.0, 5
    assert np.array_equal(points[1:], _POINTS[1:])


@pytest.mark.slow
def test_importing_the_readers_is_light():
    heavy = ["scipy", "numba", "laspy"]
    code = f"import sys, scanlock.io; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("[]\n", "")
