"""The sensors that a scenario can name: the key sensors.kind."""

from airflock.core import Sensor, sensor
from airflock.parts.sensors import delayed, gnss, langevin, perfect

SENSORS: dict[str, Sensor] = {
    "langevin": sensor(langevin, "langevin"),
    "gnss": sensor(gnss, "gnss"),
    "delayed": sensor(delayed, "delayed"),
    "perfect": sensor(perfect, "perfect"),
}
DEFAULT_SENSOR = "langevin"  # the sensor of a scenario without sensors.kind
