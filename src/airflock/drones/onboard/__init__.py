"""Layer 4: what one drone runs beside its autopilot: card, mission, limiter, log. Plain Python and pymavlink."""
