"""The flight that compiles a driver and every later one, from the disk, have the same bits."""

import os
import subprocess
import sys

FLIGHT = """
import hashlib, airflock
from airflock.engine import fly_world as fly
scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 20.0, "agents": 30, "metrics.kind": "order"})
print(hashlib.sha256(fly(scenario, 5, record=True).frames.tobytes()).hexdigest())
"""


def test_first_process_and_later_ones_fly_the_same_bits(tmp_path):
    environment = {**os.environ, "AIRFLOCK_CACHE": str(tmp_path)}
    bits = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", FLIGHT], env=environment, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
        bits.append(done.stdout.strip())
    assert bits[0] == bits[1]
