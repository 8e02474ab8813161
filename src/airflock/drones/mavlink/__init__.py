"""Layer 3: bytes and their meaning: MAVLink 2 frames, signatures, coordinates, status packets, autopilots."""
