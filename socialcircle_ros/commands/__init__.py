"""The `socialcircle` command line."""
