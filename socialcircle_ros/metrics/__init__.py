"""Numbers that describe a mask or a surface: scores against the truth, areal texture."""
