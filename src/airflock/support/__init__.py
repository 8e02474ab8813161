"""Support: errors, files, locks, cache, threads, spelling, the machine. Knows nothing of flocks."""
