"""Layer 3: scenes as numbers: generated cities and forests, meshes of the user's, and the tree over their shapes."""
