"""Rules as text: what one may contain, which of its names are integers, its first call, its copy for a driver."""
