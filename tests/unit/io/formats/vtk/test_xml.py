import base64
import lzma
import struct
import zlib

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan

_RNG = np.random.default_rng(0)
_POINTS = _RNG.normal(size=(50, 3)).astype("f4")
_ARRAYS = {
    "ring": _RNG.integers(0, 16, 50).astype("u1"),
    "time": _RNG.random(50),
    "RGB": _RNG.integers(0, 256, (50, 3)).astype("u1"),
    "Normals": _RNG.random((50, 3)).astype("f4"),
}
_BLOCK = 128
"""Size of the compressed blocks [bytes]."""


class _File:
    """Writer of one file, from the description of the format."""

    def __init__(self, storage, *, compress=None, order="<", header="I", encoding="raw"):
        self.storage = storage
        self.compress = compress
        self.order = order
        self.header = header
        self.encoding = encoding
        self.appended = b""

    def array(self, name, values, components):
        values = values.astype(values.dtype.newbyteorder(self.order))
        kind = {"f4": "Float32", "f8": "Float64", "u1": "UInt8", "i8": "Int64"}
        words = f'<DataArray type="{kind[values.dtype.str[1:]]}" Name="{name}" '
        words += f'NumberOfComponents="{components}" format="{self.storage}"'
        if self.storage == "ascii":
            return f"{words}>{' '.join(map(repr, values.ravel().tolist()))}</DataArray>\n"
        content = self._content(values.tobytes(), self.storage == "appended" and self.encoding)
        if self.storage == "binary":
            return f"{words}>\n  {content.decode()}\n</DataArray>\n"
        offset = len(self.appended)
        self.appended += content
        return f'{words} offset="{offset}"/>\n'

    def _content(self, raw, encoding):
        def encoded(data):
            return data if encoding == "raw" else base64.b64encode(data)

        if self.compress is None:
            return encoded(struct.pack(f"{self.order}{self.header}", len(raw)) + raw)
        blocks = [raw[k : k + _BLOCK] for k in range(0, len(raw), _BLOCK)]
        packed = [self.compress(block) for block in blocks]
        sizes = [len(blocks), _BLOCK, len(raw) % _BLOCK, *map(len, packed)]
        head = struct.pack(f"{self.order}{len(sizes)}{self.header}", *sizes)
        return encoded(head) + encoded(b"".join(packed))

    def text(self, points=_POINTS, arrays=_ARRAYS, pieces=1):
        body = ""
        for part in np.array_split(np.arange(len(points)), pieces):
            body += f'<Piece NumberOfPoints="{len(part)}" NumberOfVerts="0"><PointData>\n'
            for name, values in arrays.items():
                body += self.array(name, values[part], values[part].size // len(part))
            body += (
                f"</PointData><Points>{self.array('Points', points[part], 3)}</Points></Piece>\n"
            )
        order = {"<": "LittleEndian", ">": "BigEndian"}[self.order]
        header = {"I": "UInt32", "Q": "UInt64"}[self.header]
        names = {zlib.compress: "vtkZLibDataCompressor", lzma.compress: "vtkLZMADataCompressor"}
        packed = f' compressor="{names[self.compress]}"' if self.compress else ""
        head = f'<VTKFile type="PolyData" version="1.0" byte_order="{order}"'
        text = f'<?xml version="1.0"?>\n{head} header_type="{header}"{packed}><PolyData>\n{body}'
        text = f"{text}</PolyData>\n".encode()
        if self.appended:
            text += f'<AppendedData encoding="{self.encoding}">\n   _'.encode()
            text += self.appended + b"\n  </AppendedData>\n"
        return text + b"</VTKFile>\n"


_FILES = [
    {"storage": "ascii"},
    {"storage": "binary"},
    {"storage": "binary", "header": "Q"},
    {"storage": "binary", "compress": zlib.compress},
    {"storage": "binary", "compress": lzma.compress, "header": "Q"},
    {"storage": "appended"},
    {"storage": "appended", "order": ">", "header": "Q"},
    {"storage": "appended", "encoding": "base64"},
    {"storage": "appended", "compress": zlib.compress},
    {"storage": "appended", "compress": zlib.compress, "encoding": "base64", "order": ">"},
]


@pytest.mark.parametrize("options", _FILES)
@pytest.mark.parametrize("pieces", [1, 3])
def test_points_and_their_data_are_read(save, options, pieces):
    scan = read_scan(save("a.vtp", _File(**options).text(pieces=pieces)))
    assert np.array_equal(scan.points, _POINTS)
    assert scan.coordinate_dtype == "float32"
    assert scan.encoding == options["storage"]
    assert list(scan.fields) == ["ring", "time", "red", "green", "blue", "nx", "ny", "nz"]
    for name in ("ring", "time"):
        assert np.array_equal(scan.fields[name], _ARRAYS[name])
        assert scan.fields[name].dtype == _ARRAYS[name].dtype
    assert np.array_equal(scan.fields["green"], _ARRAYS["RGB"][:, 1])
    assert np.array_equal(scan.fields["nz"], _ARRAYS["Normals"][:, 2])
    assert read_scan(save("a.unknown", _File(**options).text())).format == "vtp"


@pytest.mark.parametrize("options", _FILES)
def test_truncated_and_damaged_files_are_refused_or_read(save, options):
    data = _File(**options).text(_POINTS[:5], {"ring": _ARRAYS["ring"][:5]})
    for end in [*range(1, len(data) - 1, 7), len(data) - 2]:
        with pytest.raises(FormatError):
            read_scan(save("a.vtp", data[:end]))
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(data), 60):
        changed = bytearray(data)
        changed[at] ^= 1 << int(rng.integers(8))
        try:
            assert len(read_scan(save("a.vtp", bytes(changed)), format="vtp")) == 5
        except FormatError:
            continue


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('NumberOfPoints="50"', 'NumberOfPoints="51"', "expected 51 numbers|expected 153 numbers"),
        ('NumberOfPoints="50"', 'NumberOfPoints="many"', "a whole number NumberOfPoints"),
        ('NumberOfPoints="50"', 'NumberOfPoints="0"', "a piece of PolyData with points"),
        ('type="PolyData"', 'type="ImageData"', "a VTKFile of type PolyData"),
        ("LittleEndian", "MiddleEndian", "byte_order LittleEndian or BigEndian"),
        ('header_type="UInt32"', 'compressor="vtkLZ4DataCompressor"', "zlib or LZMA, found vtkLZ4"),
        ('type="UInt8"', 'type="String"', "a data array of numbers"),
        ('type="UInt8" Name="ring"', 'type="Int8" Name="ring" format="x"', "well-formed XML"),
        ('<?xml version="1.0"?>', "<!DOCTYPE a []>", "without document types|neither"),
        ("</Points>", "", "well-formed XML"),
    ],
)
def test_malformed_files_are_refused(save, old, new, complaint):
    text = _File("ascii").text().decode()
    assert old in text
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.vtp", text.replace(old, new, 1)), format="vtp")


def test_columns_are_chosen_by_name(save):
    path = save("a.vtp", _File("ascii").text())
    assert list(read_scan(path, columns="x y z t=time").fields) == ["t"]
    with pytest.raises(InvalidInput, match="must be names of VTP"):
        read_scan(path, columns=3)
