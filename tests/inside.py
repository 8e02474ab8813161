"""The one door through which tests reach the inside of the engine; what others may use of it is in `airflock.engine`.

A name is imported when a test asks for it: the inside of the GPU's part is not there on every machine.
"""

from importlib import import_module
from typing import Any

MODULES = {
    "course": "course",
    "cpu": "cpu",
    "drivers": "drivers",
    "cuda_cells": "cuda.cells",
    "cuda_kernel": "cuda.kernel",
    "interpreted": "interpreted",
    "measuring": "measuring",
    "needs": "needs",
    "passes_build": "passes.build",
    "passes_decide": "passes.decide",
    "passes_driver": "passes.driver",
    "passes_grid": "passes.grid",
    "passes_measure": "passes.measure",
    "passes_perceive": "passes.perceive",
    "simulate": "simulate",
    "specialise_values": "specialise.values",
    "stages": "stages",
    "stages_clusters": "stages.clusters",
    "stages_decide": "stages.decide",
    "stages_flight": "stages.flight",
    "stages_gusts": "stages.gusts",
    "stages_measure": "stages.measure",
    "stages_meet": "stages.meet",
    "stages_move": "stages.move",
    "stages_neighbours": "stages.neighbours",
    "stages_noise": "stages.noise",
    "stages_perceive": "stages.perceive",
    "stages_receive": "stages.receive",
    "stages_scene": "stages.scene",
    "stages_start": "stages.start",
    "stages_surfaces": "stages.surfaces",
    "stages_words": "stages.words",
    "store": "store",
    "tables_module": "tables",
}
NAMES = {
    "CALLED": ("compiler", "CALLED"),
    "INNER": ("compiler", "INNER"),
    "Flown": ("cpu", "Flown"),
    "alone": ("locked", "alone"),
    "driver_of": ("drivers", "driver_of"),
    "flight_driver": ("drivers", "flight_driver"),
    "CudaBuilder": ("cuda.build", "CudaBuilder"),
    "signatures": ("cuda.cells", "signatures"),
    "ptx": ("cuda.compiled", "ptx"),
    "signature": ("cuda.compiled", "signature"),
    "Crowd": ("cuda.crowd", "Crowd"),
    "cells_of": ("cuda.crowd", "cells_of"),
    "crowd_driver": ("cuda.crowd", "crowd_driver"),
    "fly_crowd": ("cuda.crowd", "fly_crowd"),
    "kernel_text": ("cuda.kernel", "flight"),
    "fly_many": ("cuda.launch", "fly_many"),
    "kernel_driver": ("cuda.launch", "flight_driver"),
    "layout_of": ("cuda.launch", "layout_of"),
    "head": ("cuda.primitives", "head"),
    "Forms": ("cuda.reciprocals", "Forms"),
    "Across": ("cuda.rows", "Across"),
    "spelled": ("cuda.reciprocals", "spelled"),
    "with_reciprocals": ("cuda.reciprocals", "with_reciprocals"),
    "MOST_THREADS": ("cuda.shape", "MOST_THREADS"),
    "Shape": ("cuda.shape", "Shape"),
    "shape_of": ("cuda.shape", "shape_of"),
    "no_cuda": ("devices", "no_cuda"),
    "no_room": ("devices", "no_room"),
    "Builder": ("passes.build", "Builder"),
    "JIT": ("passes.build", "JIT"),
    "columns": ("passes.build", "columns"),
    "HEAD": ("passes.driver", "HEAD"),
    "driver_stages": ("passes.driver", "stages"),
    "measured": ("passes.measure", "measured"),
    "slotted": ("passes.slots", "slotted"),
    "WHOLE": ("plan", "WHOLE"),
    "primitives": ("primitives", "primitives"),
    "ReplacementError": ("replace", "ReplacementError"),
    "must_replace": ("replace", "must_replace"),
    "ORDER": ("schedule", "ORDER"),
    "in_turn": ("schedule", "in_turn"),
    "order": ("schedule", "order"),
    "specialise": ("specialise.stage", "specialise"),
    "StageError": ("specialise.values", "StageError"),
    "argument": ("specialise.values", "argument"),
    "clusters_of": ("stages.clusters", "clusters_of"),
    "EVERY": ("stages.flight", "EVERY"),
    "Flock": ("stages.state", "Flock"),
    "Itself": ("stages.words", "Itself"),
    "ZERO": ("stages.words", "ZERO"),
    "ask": ("stages.words", "ask"),
    "least": ("stages.words", "least"),
    "most": ("stages.words", "most"),
    "repeat": ("stages.words", "repeat"),
    "vector": ("stages.words", "vector"),
    "load_driver": ("store", "load_driver"),
    "extents": ("tables", "extents"),
    "tables": ("tables", "tables"),
}


def __getattr__(name: str) -> Any:
    """A module of the engine, or what stands in one."""
    if name in MODULES:
        return import_module(f"airflock.engine.{MODULES[name]}")
    if name in NAMES:
        module, inner = NAMES[name]
        return getattr(import_module(f"airflock.engine.{module}"), inner)
    raise AttributeError(f"tests reach nothing of the engine by the name {name!r}")
