"""Research on the filter and benchmarks, separate from the product; nothing but `commands` imports them."""
