"""The filters that the paper compares with (section 4.1), and the residual to a median window."""
