"""The adaptive mode's experiments, held against its goals."""
