# SPDX-License-Identifier: Apache-2.0
"""Scores by counting point by point and pair by pair."""

import math


def confusion(found, truth, counted):
    """True positives, false positives, false negatives, true negatives."""
    counts = {(f, t): 0 for f in (True, False) for t in (True, False)}
    for f, t, c in zip(found.flat, truth.flat, counted.flat, strict=True):
        if c:
            counts[bool(f), bool(t)] += 1
    return counts[True, True], counts[True, False], counts[False, True], counts[False, False]


def roc_area(values, truth, counted):
    bad = [v for v, t, c in zip(values.flat, truth.flat, counted.flat, strict=True) if c and t]
    good = [v for v, t, c in zip(values.flat, truth.flat, counted.flat, strict=True) if c and not t]
    if not bad or not good:
        return math.nan
    won = sum(1.0 if b > g else 0.5 if b == g else 0.0 for b in bad for g in good)
    return won / (len(bad) * len(good))
