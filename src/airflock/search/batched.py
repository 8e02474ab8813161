"""All flights of a batch at once, on a device that flies thousands side by side: a GPU."""

import time
from collections.abc import Iterator, Sequence

from airflock.runs import Flight, FlightResult, with_parameters
from airflock.search.study import Study
from airflock.support import AirflockError


class BatchExecutor:
    """One call of the engine for each batch; a flight that goes wrong is found by halves, and the others stand."""

    def __init__(self, study: Study, device: str):
        """`device` as `airflock.engine.score_flights` takes it."""
        self.study, self.device = study, device

    def fly(self, tasks: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield all flights of a scenario once they are over."""
        for place in sorted({flight.place for flight in tasks}):
            yield from self._fly([flight for flight in tasks if flight.place == place])

    def _fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        from airflock.engine import score_flights

        begin = time.perf_counter()
        try:
            scenarios = [with_parameters(self.study.scenarios[flight.place], flight.parameters) for flight in flights]
            precision = int(self.study.search.precision)
            rows = score_flights(scenarios, [f.seed for f in flights], precision=precision, device=self.device)
        except (AirflockError, ArithmeticError) as fault:
            if len(flights) == 1:
                reason = str(fault).splitlines()[0] if str(fault) else type(fault).__name__
                yield FlightResult(flights[0], None, reason, time.perf_counter() - begin, self.device)
                return
            half = len(flights) // 2
            yield from self._fly(flights[:half])
            yield from self._fly(flights[half:])
            return
        each = (time.perf_counter() - begin) / len(flights)
        for flight, values in zip(flights, rows, strict=True):
            yield FlightResult(flight, values, "", each, self.device)

    def close(self) -> None:
        """Nothing was taken."""
