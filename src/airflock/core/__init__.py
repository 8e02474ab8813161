"""Layer 0: plain scalar Python. Nothing here knows arrays, compilers or files."""
