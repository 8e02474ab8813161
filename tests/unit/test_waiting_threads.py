"""How long threads of a large flight wait awake is told to their library, which tells what it read."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import os
from inside import waiting_briefly
with waiting_briefly():
    from numba.np.ufunc import omppool
print(sorted(name for name in os.environ if "SPIN" in name))
"""


@pytest.mark.parametrize(
    ("chosen", "read"), [({}, "30000"), ({"GOMP_SPINCOUNT": "77"}, "77"), ({"OMP_WAIT_POLICY": "passive"}, "0")]
)
def test_the_library_of_threads_reads_what_a_user_has_chosen_or_ours(chosen, read):
    pytest.importorskip("numba.np.ufunc.omppool", reason="Numba has no OpenMP here")
    kept = {name: value for name, value in os.environ.items() if name not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    here = kept | chosen | {"OMP_DISPLAY_ENV": "verbose", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    told = subprocess.run([sys.executable, "-c", PROGRAM], env=here, capture_output=True, text=True)
    assert not told.returncode, told.stderr
    if "GOMP_SPINCOUNT" not in told.stderr:
        pytest.skip("the library of threads is not GNU's")
    assert f"GOMP_SPINCOUNT = '{read}'" in told.stderr
    assert told.stdout.strip() == str([name for name in chosen if "SPIN" in name])  # the environment is as it was
