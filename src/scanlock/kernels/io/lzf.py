"""LZF, the compression of PCD files: literals, and matches up to 8 KiB back."""

import numpy as np
from numpy.typing import NDArray

from scanlock.kernels._compile import helper, kernel

Bytes = NDArray[np.uint8]
"""(n,) raw bytes."""

_MAX_LITERAL = 32
_MAX_MATCH = 264
_MAX_DISTANCE = 8192
_HASH_BITS = 14


@kernel
def lzf_decode(packed: Bytes, size: int) -> tuple[Bytes, int]:
    """Return the `size` unpacked bytes and the number written, or minus the offset of an error.

    A control byte below 32 is followed by ``control + 1`` literals. Any other has a length in its
    upper three bits (7: one more byte is added) and, with the next byte, a 13-bit distance:
    ``length + 2`` bytes are repeated from ``distance + 1`` bytes back.
    """
    out = np.empty(size, np.uint8)
    n = packed.shape[0]
    i = 0
    o = 0
    while i < n:
        control = int(packed[i])
        i += 1
        if control < 32:
            length = control + 1
            if i + length > n or o + length > size:
                return out, -i
            for k in range(length):
                out[o + k] = packed[i + k]
            i += length
        else:
            length = (control >> 5) + 2
            if length == 9:
                if i >= n:
                    return out, -i
                length += int(packed[i])
                i += 1
            if i >= n:
                return out, -i
            back = ((control & 31) << 8) + int(packed[i]) + 1
            i += 1
            if back > o or o + length > size:
                return out, -i
            # Byte by byte: a match may overlap the bytes that it writes.
            for k in range(length):
                out[o + k] = out[o + k - back]
        o += length
    return out, o


@helper
def _write_literals(raw: Bytes, start: int, stop: int, out: Bytes, o: int) -> int:
    while start < stop:
        length = min(_MAX_LITERAL, stop - start)
        out[o] = length - 1
        for k in range(length):
            out[o + 1 + k] = raw[start + k]
        o += length + 1
        start += length
    return o


@helper
def _match_length(raw: Bytes, earlier: int, i: int) -> int:
    limit = min(_MAX_MATCH, raw.shape[0] - i)
    length = 0
    while length < limit and raw[earlier + length] == raw[i + length]:
        length += 1
    return length


@kernel
def lzf_encode(raw: Bytes) -> Bytes:
    """Return bytes that `lzf_decode` decodes to `raw`, at most 33/32 of its length plus 2.

    Greedy: a table of the last position of each three-byte prefix proposes one match per position.
    """
    n = raw.shape[0]
    out = np.empty(n + n // _MAX_LITERAL + 2, np.uint8)
    last_positions = np.full(1 << _HASH_BITS, -1, np.int64)
    o = 0
    i = 0
    start = 0
    while i + 2 < n:
        prefix = (int(raw[i]) << 16) | (int(raw[i + 1]) << 8) | int(raw[i + 2])
        slot = ((prefix * 2654435761) >> 15) & ((1 << _HASH_BITS) - 1)
        earlier = last_positions[slot]
        last_positions[slot] = i
        length = 0
        if earlier >= 0 and i - earlier <= _MAX_DISTANCE:
            length = _match_length(raw, earlier, i)
        if length < 3:
            i += 1
            continue
        o = _write_literals(raw, start, i, out, o)
        distance = i - earlier - 1
        if length - 2 < 7:
            out[o] = ((length - 2) << 5) | (distance >> 8)
        else:
            out[o] = (7 << 5) | (distance >> 8)
            o += 1
            out[o] = length - 9
        out[o + 1] = distance & 255
        o += 2
        i += length
        start = i
    o = _write_literals(raw, start, n, out, o)
    return out[:o].copy()
