"""Filters compared on clouds of known truth: the methods, the clouds, and the search for the best settings."""
