"""What the rule of a topology may ask for."""

RULES = {
    "meet": {
        "n": "number of others",
        "dx": "offsets to the others as believed, east, m; dx[j] is that to number j",
        "dy": "offsets to the others as believed, north, m; dy[j] is that to number j",
        "dz": "offsets to the others as believed, up, m; dz[j] is that to number j",
        "r2": "squares of their lengths, m²; 1e30 of whom is not heard",
        "hidden": "1.0 of whom something hides that stands in the world, else 0.0",
        "fade": "normal random numbers of the signals",
        "met": "to fill: 1.0 for whom the agent meets, else 0.0",
        "heap": "scratch of n numbers",
        "weak": "scratch of n further numbers",
        "t": "the topology's parameters",
    },
}
