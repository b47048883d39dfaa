"""The paper's experiments: Table 1 and Figures 4, 8, 10 and 11."""
