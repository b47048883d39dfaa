"""How kernels are compiled and shared among threads and cores, and the small algorithms that several rooms use."""
