import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.lzf import unpack
from scanlock.kernels.io.lzf import lzf_decode, lzf_encode

_FEW_LETTERS = st.lists(st.sampled_from(b"ab\0"), max_size=600).map(bytes)


def _bytes(data):
    return np.frombuffer(data, np.uint8)


def _decoded(packed, size):
    raw, status = lzf_decode(_bytes(packed), size)
    return raw.tobytes(), status


@pytest.mark.parametrize(
    ("packed", "raw"),
    [
        (b"\x00a", b"a"),
        (b"\x02abc", b"abc"),
        (b"\x00a\x20\x00", b"aaaa"),  # three bytes from one back, overlapping the output
        (b"\x02abc\x20\x02", b"abcabc"),
        (b"\x00a\xe0\x00\x00", b"a" * 10),  # 7 + 0 + 2 bytes
        (b"\x00a\xe0\xff\x00", b"a" * 265),
    ],
)
def test_hand_made_data_are_decoded(packed, raw):
    assert unpack(packed) == raw
    assert _decoded(packed, len(raw)) == (raw, len(raw))


@given(st.binary(max_size=600) | _FEW_LETTERS)
def test_the_reference_unpacks_encoded_data(raw):
    packed = lzf_encode(_bytes(raw)).tobytes()
    assert unpack(packed) == raw
    assert _decoded(packed, len(raw)) == (raw, len(raw))
    assert len(packed) <= len(raw) + len(raw) // 32 + 2


def test_distant_and_long_repetitions_round_trip():
    rng = np.random.default_rng(5)
    block = rng.integers(0, 256, 8192, dtype=np.uint8).tobytes()
    raw = block + block + bytes(5000) + block[:300] + b"end"
    packed = lzf_encode(_bytes(raw)).tobytes()
    assert len(packed) < 0.6 * len(raw)
    assert unpack(packed) == raw
    assert _decoded(packed, len(raw))[0] == raw


@given(st.binary(max_size=60), st.integers(0, 100))
def test_damaged_data_do_not_exceed_the_arrays(packed, size):
    raw, status = lzf_decode(_bytes(packed), size)
    assert len(raw) == size
    assert -len(packed) <= status <= size
    if status > 0:
        assert unpack(packed) == raw[:status].tobytes()


@pytest.mark.parametrize(
    ("packed", "size"),
    [
        (b"\x05abc", 6),  # fewer literals than announced
        (b"\x02abc", 2),  # more than the size
        (b"\x20\x00", 3),  # a reference before the start
        (b"\x00a\x20", 4),  # an incomplete reference
        (b"\x00a\xe0", 9),
    ],
)
def test_invalid_data_have_a_negative_status(packed, size):
    _, status = lzf_decode(_bytes(packed), size)
    assert status < 0
