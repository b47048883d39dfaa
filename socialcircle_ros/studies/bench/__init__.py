"""Benchmarks: time beside peers, growth with size, exactness of depth, and the live node."""
