"""Player: flights on one clock, played, stopped and taken back; it knows no page."""

from collections.abc import Callable
from time import perf_counter

from airflock.engine import Snapshot
from airflock.scenarios import user_error_line
from airflock.studio.flights import ComparedFlights, FlightRequest
from airflock.studio.moments import KeptSnapshots
from airflock.studio.pace import PageClock
from airflock.studio.requests import ActionQueue
from airflock.support import AirflockError, describe_error, os_error_message

MAX_BUSY_SECONDS = 0.05  # s of real time flown at most before the page is answered again


class Player(ComparedFlights):
    """Flights, played: what a page shows and what its controls do.

    `ask` may be called from any thread; everything else belongs to the thread that calls `tick`.

    Attributes: pace, how fast they fly; moments, to go back to; paused; failure, why they stopped, or nothing.
    """

    def __init__(self, request: FlightRequest):
        self.clock, self.is_paused, self.failure_message = PageClock(1.0), False, ""
        self._steps_per_second = 1e4  # motion steps per second, as measured
        self._asked = ActionQueue()
        super().__init__(request)

    def _open(self, start: bool = False) -> None:
        super()._open(start)
        self.clock = PageClock(self.preset.flight.dt, self.clock.speed)
        self.snapshots, self.failure_message = KeptSnapshots(), ""

    def switch_to_compiled(self) -> list[Snapshot | None]:
        """Go on as compiled flights, once they are compiled; of the moments to go back to the start is left."""
        if not self.is_compiling:
            return []
        starts = super().switch_to_compiled()
        self.snapshots = KeptSnapshots()
        if None not in starts:
            self.snapshots.keep(0.0, tuple(start for start in starts if start is not None))
        return starts

    @property
    def status(self) -> str:
        """What a page says while it waits, or why it stopped; empty while all is well."""
        if self.failure_message:
            return self.failure_message
        if self.is_compiling:
            return "compiling … (meanwhile flying interpreted, with different rounding)"
        if self.over:
            return f"a page flies at most {self.time:g} s; Reset starts again"
        return "compiling …" if any(side.flight.waiting for side in self.sides) else self.note

    @property
    def over(self) -> bool:
        """Whether the longest time that a page flies has been reached."""
        return any(side.flight.over for side in self.sides)

    # ------------------------------------------------------------------------------------------------ playing

    def ask(self, action: Callable[[], None]) -> None:
        """Do something before the next frame; from any thread."""
        self._asked.put(action)

    def run_actions_within(self, seconds: float) -> bool:
        """Wait for some seconds of real time, or until something was asked for and done. Whether it was."""
        return self._asked.wait(seconds) and self._asked.answer(self._safely)

    def tick(self, elapsed: float) -> bool:
        """Do what was asked for, then fly what is due after `elapsed` s of real time. Whether anything moved."""
        asked = self._asked.answer(self._safely)
        if self.is_compiling and all(side.is_compiled for side in self.sides):
            asked = self._settled() or asked
        if self.is_paused or self.failure_message or self.over:
            return asked
        steps = min(self.clock.due(elapsed), max(1, int(self._steps_per_second * MAX_BUSY_SECONDS)))
        if not steps:
            return asked
        began, moved = perf_counter(), self.fly(steps)
        self._steps_per_second = steps / max(perf_counter() - began, 1e-6)
        return moved or asked

    def _settled(self) -> bool:
        try:
            self.switch_to_compiled()
        except AirflockError as fault:
            self.failure_message = f"stopped: {fault}"
            self.fault(self.failure_message)
        return True

    def _safely(self, action: Callable[[], None]) -> None:
        """Do something; what goes wrong is a note on the page and a line in the terminal, and the flight goes on."""
        try:
            action()
        except AirflockError as fault:
            self._report_error(str(fault))
        except OSError as fault:  # a full disk, a folder that is gone
            self._report_error(": ".join(part for part in (fault.filename, os_error_message(fault)) if part))
        except Exception as fault:  # the last resort: somebody's flight must not be lost to one press of a button
            self._report_error(f"unexpected {describe_error(fault)}; please report it")

    def _report_error(self, line: str) -> None:
        self.note = line
        self.fault(line)

    def fly(self, steps: int) -> bool:
        """Fly so many steps, and keep a moment where one is due; a flight that fails stops and says why."""
        if self.snapshots.due(self.time):
            self.snapshots.keep(self.time, tuple(side.flight.snapshot() for side in self.sides))
        clock = self.sides[0]
        end = (clock.flight.step + steps) * clock.scenario.flight.dt
        try:
            for side in self.sides:
                side.fly_to(end)
        except Exception as fault:  # a rule of the user's own may raise anything, until it is compiled
            told = str(fault) if isinstance(fault, AirflockError) else user_error_line(fault)
            if not told:
                raise
            self.failure_message = f"stopped: {told}"
            self.fault(self.failure_message)
            return False
        return True

    def step(self) -> None:
        """Pause, and fly to the next decision: one step of the flock."""
        self.is_paused = True
        scenario, flight = self.sides[0].scenario, self.sides[0].flight
        every = max(1, round(scenario.sensors.period / scenario.flight.dt))
        self.fly(every - flight.step % every)

    def toggle_pause(self) -> None:
        """Pause, or fly on."""
        self.is_paused = not self.is_paused

    def go_back(self, time: float) -> None:
        """Go back to a time, s, and wait there; what came after it is given up. Of a failed flight, to a moment before.

        Before a fork there is one flight again.
        """
        time = min(max(time, 0.0), self.time)
        moment = self.snapshots.at(time)
        if moment is None:
            self.note = "no earlier moment is kept"
            return
        del self.sides[len(moment) :]
        self.hand = min(self.hand, len(self.sides) - 1)
        failed = self.failure_message
        for side, kept in zip(self.sides, moment, strict=True):
            if failed:
                side.restore(kept)
            else:
                side.again(kept, time)
        self.snapshots.forget_after(time + 1e-6)
        least = "; no earlier moment is kept" if self.time > time + 1e-6 and not failed else ""
        self.failure_message, self.note, self.is_paused = "", f"back at t = {self.time:g} s{least}", True

    # ---------------------------------------------------------------------------------------------- comparing

    def fork(self) -> None:
        """Fly a second flight beside this one from here on; of two, moments of both together are given up."""
        two = len(self.sides) > 1
        super().fork()
        self.snapshots = KeptSnapshots() if two else self.snapshots

    def join(self) -> None:
        """End the comparison: the side that the controls act on flies on alone, and goes back no further than here."""
        super().join()
        self.snapshots = KeptSnapshots()
