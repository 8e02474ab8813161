"""Our laws."""
