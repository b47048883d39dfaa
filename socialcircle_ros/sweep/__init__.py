"""Trying many settings on the same clouds, and showing which did best."""
