"""The cells of the live node tests, for clients of a node."""

from node.conftest import cell, shared_cell, start_cell  # noqa: F401 - fixtures
