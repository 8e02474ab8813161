"""Recordings for other tools: CSV, Parquet, and netCDF in both layouts of `movement`."""
