"""All studies and charts by name; registering one is one line. A reference is ``module:name``."""

from __future__ import annotations

PAPER = {
    "contact": "studies.paper.meshes:CONTACT",
    "meshes": "studies.paper.meshes:MESHES",
    "nominal": "studies.paper.nominal:NOMINAL",
    "speeds": "studies.paper.dynamics:SPEEDS",
    "time_steps": "studies.paper.dynamics:TIME_STEPS",
    "stiffnesses": "studies.paper.dynamics:STIFFNESSES",
    "feedforward_paths": "studies.paper.dynamics:FEEDFORWARD_PATHS",
    "starts": "studies.paper.dynamics:STARTS",
    "loop": "studies.paper.closed_loop:LOOP",
    "thresholds": "studies.paper.closed_loop:THRESHOLDS",
    "wheelbases": "studies.paper.closed_loop:WHEELBASES",
    "surface": "studies.paper.closed_loop:SURFACE",
}
"""Studies of the paper, whose tables its figures and the ledger of its claims are made of."""

FIGURES = {
    "figure_2": "studies.paper.figures.contact:FIGURE_2",
    "figure_3": "studies.paper.figures.rover_model:FIGURE_3",
    "figure_4": "studies.paper.figures.paths:FIGURE_4",
    "figure_5": "studies.paper.figures.paths:FIGURE_5",
    "figure_6": "studies.paper.figures.sensitivity:FIGURE_6",
    "figure_7": "studies.paper.figures.sensitivity:FIGURE_7",
    "figure_8": "studies.paper.figures.sensitivity:FIGURE_8",
    "table_1": "studies.paper.figures.mesh_table:TABLE_1",
}
"""Figures of the paper, drawn from the tables of its studies."""

TRADEOFF = {
    "friction": "studies.tradeoff.friction:STUDY",
    "dynamics": "studies.tradeoff.dynamics:STUDY",
    "calibration": "studies.tradeoff.calibration:STUDY",
    "tracking": "studies.tradeoff.tracking:STUDY",
    "decimation": "studies.tradeoff.decimation:STUDY",
    "presets": "studies.tradeoff.presets:STUDY",
}
"""Studies of error against cost, each with its chart."""

STABILITY = {
    "integrators": "studies.maps.integrators:STUDY",
    "open_loop": "studies.maps.open_loop:STUDY",
    "planner": "studies.maps.planner:STUDY",
    "tracker": "studies.maps.tracker:STUDY",
    "views": "studies.maps.views:STUDY",
    "carry_over": "studies.maps.carry_over:STUDY",
}
"""Studies of where methods are right, flagged or silently wrong, each with its map."""
