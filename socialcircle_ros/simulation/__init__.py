"""A virtual focus-variation instrument: stacks and clouds with known truth."""
