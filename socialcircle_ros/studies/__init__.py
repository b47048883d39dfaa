"""Research and benchmarks, apart from the product."""
