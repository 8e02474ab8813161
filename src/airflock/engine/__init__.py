"""Layer 3: the only place that knows compilers, arrays and devices."""
