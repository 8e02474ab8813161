"""Landing: who comes to the ground with an empty battery is absent from then on.

Bodies tell how long their batteries last at least (`endures`), so a flight is watched step by step only while somebody
falls. An agent is put away before the first step at which it is empty and on the ground, whatever the cuts.
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from airflock.core import Body, choices, number_names
from airflock.engine.presence import remove_agents
from airflock.scenarios import Scenario

if TYPE_CHECKING:
    from airflock.engine.state import DriverState

SURE = 0.5  # share of the time that batteries last at least after which they are looked at again: drivers round


@dataclass(frozen=True)
class GroundContact:
    """What tells who has landed.

    ground  : its height, m
    body    : the rules; numbers : those of each agent, as drivers read them; wing : of all
    """

    ground: float
    body: Body
    numbers: tuple[Any, ...]
    wing: Any

    def battery_times(self, state: "DriverState") -> dict[int, float]:
        """Of each agent that is there how long its battery lasts at least, s."""
        names = self.body.Memory._fields  # type: ignore[union-attr]
        rows = state.rows([f"body{c}" for c in range(len(names))]).astype(float).T.tolist()
        return {
            agent: self.body.lasts(memory=self.body.Memory(*rows[agent]), b=self.numbers[agent], wing=self.wing)  # type: ignore[misc]
            for agent in state.present.nonzero()[0].tolist()
        }

    def land(self, state: "DriverState") -> None:
        """Put away whoever is empty and on the ground."""
        empty = [agent for agent, lasts in self.battery_times(state).items() if lasts <= 0.0]
        if empty:
            height = state.rows(["z"])[0]
            remove_agents(state, [agent for agent in empty if height[agent] <= self.ground])

    def steps_without_landing(self, state: "DriverState") -> int:
        """For how many steps nobody can land, at least; 1 while somebody falls."""
        lasts = self.battery_times(state).values()
        return max(1, int(SURE * min(lasts, default=0.0) / state.dt))


def ground_contact(scenario: Scenario, seed: int, real: Any) -> GroundContact | None:
    """Who can land in a scenario; None where nobody can. real : type of the driver's numbers."""
    if not scenario.can_land or scenario.ground is None:
        return None
    body = scenario.body
    same = {name: float(real(getattr(body, name) or 0.0)) for name in number_names(type(body))}
    own = {
        name: [float(real(value)) for value in scenario.agent_values("b", name, seed)]
        for letter, name in scenario.varied
        if letter == "b"
    }
    numbers = tuple(
        SimpleNamespace(**choices(body), **(same | {name: values[agent] for name, values in own.items()}))
        for agent in range(scenario.agents)
    )
    return GroundContact(scenario.ground, scenario.vehicle, numbers, scenario.wing)
