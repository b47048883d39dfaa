"""The filter (section 3.2): votes elect a seed, the ring round it gives the radius, the circle expands."""
