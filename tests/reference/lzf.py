"""LZF decompression, written from its description."""


def unpack(packed: bytes) -> bytes:
    """Return the unpacked bytes of well-formed LZF data."""
    out = bytearray()
    rest = list(packed)
    while rest:
        control = rest.pop(0)
        if control <= 0b000_11111:
            literals, rest = rest[: control + 1], rest[control + 1 :]
            assert len(literals) == control + 1
            out += bytes(literals)
            continue
        length = control >> 5
        if length == 0b111:
            length += rest.pop(0)
        distance = ((control & 0b11111) << 8 | rest.pop(0)) + 1
        assert distance <= len(out)
        for _ in range(length + 2):
            out.append(out[-distance])
    return bytes(out)
