"""Outlier removal for organized point clouds of optical microscopes, by the social circle method."""
