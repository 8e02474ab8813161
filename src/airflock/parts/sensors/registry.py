"""The sensors that a scenario can name: the key sensors.kind."""

from airflock.core.sensor import Sensor, sensor
from airflock.parts.sensors import delayed, gnss, langevin, perfect

SENSORS: dict[str, Sensor] = {
    "langevin": sensor(langevin, "langevin"),
    "gnss": sensor(gnss, "gnss"),
    "delayed": sensor(delayed, "delayed"),
    "perfect": sensor(perfect, "perfect"),
}
USUAL = "langevin"  # the sensor of a scenario without sensors.kind
