# SPDX-License-Identifier: Apache-2.0
"""Surfaces for property tests, and how they are compared: bit for bit."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from socialcircle_ros.formats import MeasuredSurface


@st.composite
def surfaces(draw, dtypes=('f4', 'f8'), unit='m', *, marks=True, least=2):
    """Surfaces of a few points with any finite heights and holes, and at least `least` measured rows and columns.

    Without `marks`, no height is among the largest numbers of its type, some of which mean "not measured" in SDF.
    """
    dtype = np.dtype(draw(st.sampled_from(dtypes)))
    shape = draw(st.tuples(st.integers(least, 7), st.integers(least, 7)))
    largest = float(np.finfo(dtype).max) / (1 if marks else 2)
    finite = st.floats(-largest, largest, width=dtype.itemsize * 8)
    heights = draw(hnp.arrays(dtype, shape, elements=finite | st.just(float('nan'))))
    heights[[0, -1], [0, -1]] = draw(finite), draw(finite)
    pitches = st.floats(1e-9, 1e3) | st.decimals('0.001', '9', places=3).map(float)
    fields = draw(
        st.dictionaries(
            st.sampled_from(('intensity', 'quality')),
            st.sampled_from(('u1', 'i2', 'u4', 'f4', 'f8')).flatmap(lambda kind: hnp.arrays(kind, shape)),
        )
    )
    texts = st.dictionaries(st.text(max_size=5), st.text(max_size=9), max_size=2)
    return MeasuredSurface(heights, (draw(pitches), draw(pitches)), unit, fields, draw(texts))


def same_bits(one, other):
    """Whether two arrays have the same type, shape and bits, every NaN taken as one value."""
    one, other = plain(np.asarray(one)), plain(np.asarray(other))
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def plain(values):
    """The values with every NaN as one value."""
    return values if values.dtype.kind != 'f' else np.where(np.isnan(values), values.dtype.type(np.nan), values)
