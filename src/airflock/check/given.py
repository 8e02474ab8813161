"""What a caller of a check gives beside the rules: values of their numbers, refused in lines as of a scenario."""

from typing import Any

from airflock.scenarios import schema, settings_dict
from airflock.support import ScenarioError


def parameters_with_values(record: type, values: Any, section: str) -> Any:
    """A record of parameters with the values that a caller gives by name; the others keep their defaults."""
    made, faults = schema.read_section(section, settings_dict(values, f"check of {section}"), record)
    if faults:
        raise ScenarioError(faults)
    return made
