"""Scores, experiments and benchmarks."""
