"""The engine on an NVIDIA GPU: the passes of a CPU driver lowered to blocks of threads, their memory and launches."""
