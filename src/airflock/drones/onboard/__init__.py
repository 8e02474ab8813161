"""The program on board, beside the autopilot: card, mission, limiter, log. Plain Python and pymavlink."""
