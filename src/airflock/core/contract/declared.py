"""Words by which files of rules declare what they are: COMMAND and ACCEPTS, REDUCE, OVER_TIME, CLOCK."""

COMMANDS = {"velocity": "m/s", "acceleration": "m/s^2", "heading": "1"}  # and their units
REDUCTIONS = ("sum", "min", "max")
OVER_TIME = ("mean", *REDUCTIONS)  # how the samples of a flight combine
CLOCKS = ("sample", "collision")  # metrics.period and metrics.collision_period
