"""Focus variation (section 3.1): focus measure, peak fit, and the assembly of a stack into a cloud."""
