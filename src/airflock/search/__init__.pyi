# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .bounds import shipped_study_axes as shipped_study_axes
from .cmaes import CMAES as CMAES
from .genetic import (
    decode as decode,
    minimise_over_bits as minimise_over_bits,
)
from .harden import (
    MAX_ROUNDS as MAX_ROUNDS,
    harden as harden,
    hardened_document as hardened_document,
    hardening_request as hardening_request,
)
from .race import RACE_ROUNDS as RACE_ROUNDS
from .request import (
    check_sensitivity_method as check_sensitivity_method,
    check_study_device as check_study_device,
    evolve_request as evolve_request,
)
from .result import (
    BEST_FILE as BEST_FILE,
    EvolveResult as EvolveResult,
    further_best_files as further_best_files,
)
from .run import (
    resolve_device as resolve_device,
    run_study as run_study,
    study_executor as study_executor,
)
from .safe import limit_report_line as limit_report_line
from .search import SearchProgress as SearchProgress
from .study import load_study as load_study
from .tune.folder import load_plan as load_plan
from .tune.request import make_request as make_request
from .tune.run import tune as tune
from .tune.start import prepare_start as prepare_start
from .validation import (
    ValidationReport as ValidationReport,
    validate as validate,
)
