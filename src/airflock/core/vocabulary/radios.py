"""What the rules of a radio may ask for."""

PACKET = {
    "distance": "true distance of the two, m",
    "clear": "1.0 if nothing that stands in the world lies between the two, else 0.0",
    "talkers": "how many others are within radio.range of the receiver: all send, the sender among them",
    "step": "number of the decision",
    "period": "time between two decisions, s",
}
CHANCES = {
    **{f"u{c}": "uniform random number between 0 and 1, new for each pair and decision" for c in range(4)},
    **{f"g{c}": "normal random number, new for each pair and decision" for c in range(4)},
}
MISSED = {
    **PACKET,
    "fast": "packets that the first of RATES sends in this decision",
    "slow": "packets that the second of RATES sends in this decision",
}
RECEIVED = {
    **PACKET,
    "dx": "true offset from the receiver to the sender, east, m",
    "dy": "true offset from the receiver to the sender, north, m",
    "dz": "true offset from the receiver to the sender, up, m",
    "vx": "true velocity of the receiver, east, m/s",
    "vy": "true velocity of the receiver, north, m/s",
    "vz": "true velocity of the receiver, up, m/s",
    "age": "age of the newest packet that the receiver has of the sender, s; 1e9 or more before the first",
    "packet": "the radio's Packet of this pair",
    **CHANCES,
}
SEEN = {
    "dx": "true offset to the other one when the picture was taken, radio.delay ago, east, m",
    "dy": "true offset to the other one when the picture was taken, radio.delay ago, north, m",
    "dz": "true offset to the other one when the picture was taken, radio.delay ago, up, m",
    "ex": "offset at which the newest estimate, carried forward, expects it in that picture, east, m",
    "ey": "offset at which the newest estimate, carried forward, expects it in that picture, north, m",
    "ez": "offset at which the newest estimate, carried forward, expects it in that picture, up, m",
    "evx": "its velocity by the newest estimate, east, m/s",
    "evy": "its velocity by the newest estimate, north, m/s",
    "evz": "its velocity by the newest estimate, up, m/s",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
    "since": "time since the last picture in which it was found, s; about 1e9 before the first",
    "period": "time between two decisions, s",
    **CHANCES,
}
CARRIED = {
    "x": "position in the newest packet, east, m",
    "y": "position in the newest packet, north, m",
    "z": "position in the newest packet, up, m",
    "vx": "velocity in the newest packet, east, m/s",
    "vy": "velocity in the newest packet, north, m/s",
    "vz": "velocity in the newest packet, up, m/s",
    "age": "age of the newest packet, s",
}
RULES = {
    "missed": {**MISSED, "k": "the radio's parameters"},
    "missed_few": {**MISSED, "k": "the radio's parameters"},
    "receive": {**RECEIVED, "k": "the radio's parameters"},
    "late": {**PACKET, **CHANCES, "k": "the radio's parameters"},
    "see": {**SEEN, "k": "the radio's parameters"},
    "carry": {**CARRIED, "k": "the radio's parameters"},
    "lasts": {"age": "age of the newest packet, s", "k": "the radio's parameters"},
}
