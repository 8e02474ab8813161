"""The sensors that a scenario can name: the key sensors.kind."""

from airflock.core import Sensor, find_members, sensor

SENSORS: dict[str, Sensor] = find_members("airflock.parts.sensors", ["measure", "error"], sensor)
DEFAULT_SENSOR = "langevin"  # the sensor of a scenario without sensors.kind
