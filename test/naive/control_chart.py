# SPDX-License-Identifier: Apache-2.0
"""The Western Electric rules, value by value, as the handbook words them."""


def signals(values, centre, sigma):
    found = []
    for end in range(1, len(values) + 1):
        completed = [rule(values[:end], centre, sigma) for rule in RULES]
        found.append(sum(1 << bit for bit, each in enumerate(completed) if each))
    return found


def beyond(values, centre, sigma, distance, side):
    return [side * (value - centre) > distance * sigma for value in values]


def rule(enough, window, distance):
    def completes(values, centre, sigma):
        for side in (1, -1):
            last = beyond(values[-window:], centre, sigma, distance, side)
            if last[-1] and sum(last) >= enough:
                return True
        return False

    return completes


RULES = (rule(1, 1, 3.0), rule(2, 3, 2.0), rule(4, 5, 1.0), rule(8, 8, 0.0))
