"""Work in several threads: its results, its faults, and that no interruption at any moment leaves it waiting."""

import subprocess
import sys
import time

import pytest

from airflock.support.threads import run_in_background, run_in_threads

INTERRUPTED = """
import faulthandler, random, signal, time
from airflock.support.threads import run_in_threads

faulthandler.dump_traceback_later(60, exit=True)
signal.signal(signal.SIGALRM, signal.default_int_handler)
random.seed(7)
heard = 0
for _ in range(30):
    try:
        signal.setitimer(signal.ITIMER_REAL, random.uniform(1e-3, 0.1))
        list(run_in_threads([lambda: time.sleep(1e-5)] * 2000, 2))
        signal.setitimer(signal.ITIMER_REAL, 0)
    except KeyboardInterrupt:
        heard += 1
assert heard > 10, heard
"""


def test_an_interruption_at_any_moment_ends_the_work():
    ended = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr[-2000:]


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_the_order_of_the_jobs(threads):
    told = []

    def job(k):
        time.sleep(1e-3 * (k % 3))
        return k

    jobs = [lambda k=k: job(k) for k in range(40)]
    assert list(run_in_threads(jobs, threads, lambda: told.append(1))) == list(range(40))
    assert len(told) == 40


@pytest.mark.parametrize("threads", [1, 3])
def test_a_fault_reaches_who_asks_and_no_further_job_begins(threads):
    begun = []

    def job(k):
        begun.append(k)
        if k == 5:
            raise ValueError("the sixth")
        time.sleep(0.01)
        return k

    found = []
    with pytest.raises(ValueError, match="the sixth"):
        for result in run_in_threads([lambda k=k: job(k) for k in range(400)], threads):
            found.append(result)
    assert found == [0, 1, 2, 3, 4]
    assert len(begun) < 400


def test_work_in_the_background_begins_when_its_caller_goes_on():
    done, usual = [], sys.getswitchinterval()
    sys.setswitchinterval(10.0)  # s; a thread that has the interpreter keeps it
    try:
        work = run_in_background(lambda: done.append("work"))
        done.append("caller")
        work.result(60.0)
    finally:
        sys.setswitchinterval(usual)
    assert done == ["caller", "work"]
