"""Filling the holes that the filter leaves (section 4.2), and saying which points were filled."""
