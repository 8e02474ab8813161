"""Scenes: cities, forests, meshes and outlines of fields as rows of shapes and a flat tree."""
