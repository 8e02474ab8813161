# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .evolution import (
    ValidationReport as ValidationReport,
    check_sensitivity_method as check_sensitivity_method,
    check_study_device as check_study_device,
    evolve_request as evolve_request,
    resolve_device as resolve_device,
    run_study as run_study,
    study_executor as study_executor,
    validate as validate,
)
from .hardening import (
    MAX_ROUNDS as MAX_ROUNDS,
    harden as harden,
    hardened_document as hardened_document,
    hardening_request as hardening_request,
)
from .league_table import league as league
from .limit_excess import limit_report_line as limit_report_line
from .optimisers import (
    CMAES as CMAES,
    binary_genetic as binary_genetic,
    decode as decode,
)
from .study import (
    SearchSettings as SearchSettings,
    load_study as load_study,
    shipped_study_axes as shipped_study_axes,
)
from .study_result import (
    BEST_FILE as BEST_FILE,
    EvolveResult as EvolveResult,
    further_best_files as further_best_files,
)
from .tuning_run import (
    load_plan as load_plan,
    make_request as make_request,
    prepare_start as prepare_start,
    tune as tune,
)
