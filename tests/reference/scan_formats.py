"""Slow readers of scan formats, written from their descriptions."""

import struct
from pathlib import Path

import numpy as np

from reference.lzf import unpack

_PCD_CODES = {
    ("F", 4): "f",
    ("F", 8): "d",
    ("U", 1): "B",
    ("U", 2): "H",
    ("U", 4): "I",
    ("U", 8): "Q",
    ("I", 1): "b",
    ("I", 2): "h",
    ("I", 4): "i",
    ("I", 8): "q",
}
_PLY_CODES = {
    "char": "b",
    "uchar": "B",
    "short": "h",
    "ushort": "H",
    "int": "i",
    "uint": "I",
    "float": "f",
    "double": "d",
    "float32": "f",
    "float64": "d",
    "uint8": "B",
    "int32": "i",
}


def read_pcd(path: Path) -> dict[str, np.ndarray]:
    """Read all fields by name; fields of several values have shape (n, count)."""
    data = path.read_bytes()
    header = {}
    offset = 0
    while "DATA" not in header:
        end = data.index(b"\n", offset)
        key, *values = data[offset:end].decode().split() or ["#"]
        header[key] = values
        offset = end + 1
    names = header["FIELDS"]
    sizes = [int(word) for word in header["SIZE"]]
    counts = [int(word) for word in header.get("COUNT", ["1"] * len(names))]
    codes = [_PCD_CODES[pair] for pair in zip(header["TYPE"], sizes, strict=True)]
    points = int(header["POINTS"][0])
    columns = [[] for _ in names]
    if header["DATA"] == ["ascii"]:
        for line in data[offset:].decode().splitlines():
            words = iter(line.split())
            for column, count, code in zip(columns, counts, codes, strict=True):
                for _ in range(count):
                    number = float if code in "fd" else int
                    column.append(number(next(words)))
    elif header["DATA"] == ["binary"]:
        for _ in range(points):
            for column, count, code in zip(columns, counts, codes, strict=True):
                column += struct.unpack_from(f"<{count}{code}", data, offset)
                offset += struct.calcsize(f"<{count}{code}")
    else:
        packed, size = struct.unpack_from("<II", data, offset)
        raw = unpack(data[offset + 8 : offset + 8 + packed])
        assert len(raw) == size
        at = 0
        for column, count, code in zip(columns, counts, codes, strict=True):
            column += struct.unpack_from(f"<{points * count}{code}", raw, at)
            at += struct.calcsize(f"<{points * count}{code}")
    return {
        name: np.array(column, dtype=code if code != "f" else np.float32).reshape(
            (points,) if count == 1 else (points, count)
        )
        for name, column, count, code in zip(names, columns, counts, codes, strict=True)
    }


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """Read the scalar properties of the vertices, as float64."""
    data = path.read_bytes()
    end = data.index(b"end_header")
    end = data.index(b"\n", end) + 1
    order, elements = "<", []
    ascii_words = None
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "format":
            order = ">" if "big" in words[1] else "<"
            if words[1] == "ascii":
                ascii_words = iter(data[end:].decode().split())
        elif words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            elements[-1][2].append(words[1:])
    offset = end

    def number(kind):
        nonlocal offset
        if ascii_words is not None:
            word = next(ascii_words)
            if kind in ("float", "float32"):
                return float(np.float32(word))
            return float(word) if kind in ("double", "float64") else int(word)
        code = order + _PLY_CODES[kind]
        (value,) = struct.unpack_from(code, data, offset)
        offset += struct.calcsize(code)
        return value

    found = {}
    for name, count, properties in elements:
        rows = {entry[-1]: [] for entry in properties}
        for _ in range(count):
            for entry in properties:
                if entry[0] == "list":
                    for _ in range(number(entry[1])):
                        number(entry[2])
                else:
                    rows[entry[1]].append(number(entry[0]))
        if name == "vertex":
            found = {key: np.array(values, dtype=np.float64) for key, values in rows.items()}
    return found


def read_float32(path: Path, width: int) -> np.ndarray:
    """Read rows of `width` little-endian float32, as float64."""
    data = path.read_bytes()
    return np.array(list(struct.iter_unpack(f"<{width}f", data)), dtype=np.float64)


def read_table(path: Path, separators: str, header_lines: int) -> np.ndarray:
    """Read the numbers of a text table, line by line."""
    rows = []
    for line in path.read_text().splitlines()[header_lines:]:
        for mark in separators:
            line = line.replace(mark, " ")
        rows.append([float(word) for word in line.split()])
    return np.array(rows)
