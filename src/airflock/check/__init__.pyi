# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .models import check_types as check_types
