"""All studies and charts by name. Registering one is one line, here or in a plugin; a reference is ``module:name``.

Names are unique over all registries: rules of the workflow tell studies and figures apart by them.
"""

from __future__ import annotations

from towval.model.plugins import Registry

PAPER: Registry[str] = Registry("study of the paper")
"""Studies of the paper, whose tables its figures and the ledger of its claims are made of."""

FIGURES: Registry[str] = Registry("figure of the paper")
"""Figures of the paper, drawn from the tables of its studies."""

TRADEOFF: Registry[str] = Registry("study of error against cost")
"""Studies of error against cost, each with its chart."""

STABILITY: Registry[str] = Registry("study of stability")
"""Studies of where methods are right, flagged or silently wrong, each with its map."""

PAPER.register("contact", "studies.paper.meshes:CONTACT")
PAPER.register("meshes", "studies.paper.meshes:MESHES")
PAPER.register("nominal", "studies.paper.nominal:NOMINAL")
PAPER.register("speeds", "studies.paper.dynamics:SPEEDS")
PAPER.register("time_steps", "studies.paper.dynamics:TIME_STEPS")
PAPER.register("stiffnesses", "studies.paper.dynamics:STIFFNESSES")
PAPER.register("feedforward_paths", "studies.paper.dynamics:FEEDFORWARD_PATHS")
PAPER.register("starts", "studies.paper.dynamics:STARTS")
PAPER.register("loop", "studies.paper.closed_loop:LOOP")
PAPER.register("thresholds", "studies.paper.closed_loop:THRESHOLDS")
PAPER.register("wheelbases", "studies.paper.closed_loop:WHEELBASES")
PAPER.register("planner_steps", "studies.paper.closed_loop:PLANNER_STEPS")
PAPER.register("surface", "studies.paper.closed_loop:SURFACE")
PAPER.register("further", "studies.paper.further:STUDY")
PAPER.register("controls", "studies.paper.controls:STUDY")
PAPER.register("variants", "studies.paper.variants:STUDY")

FIGURES.register("figure_2", "studies.paper.figures.contact:FIGURE_2")
FIGURES.register("figure_3", "studies.paper.figures.rover_model:FIGURE_3")
FIGURES.register("figure_4", "studies.paper.figures.paths:FIGURE_4")
FIGURES.register("figure_5", "studies.paper.figures.paths:FIGURE_5")
FIGURES.register("figure_6", "studies.paper.figures.sensitivity:FIGURE_6")
FIGURES.register("figure_7", "studies.paper.figures.sensitivity:FIGURE_7")
FIGURES.register("figure_8", "studies.paper.figures.sensitivity:FIGURE_8")
FIGURES.register("table_1", "studies.paper.figures.mesh_table:TABLE_1")

TRADEOFF.register("friction", "studies.tradeoff.friction:STUDY")
TRADEOFF.register("dynamics", "studies.tradeoff.dynamics:STUDY")
TRADEOFF.register("calibration", "studies.tradeoff.calibration:STUDY")
TRADEOFF.register("tracking", "studies.tradeoff.tracking:STUDY")
TRADEOFF.register("decimation", "studies.tradeoff.decimation:STUDY")
TRADEOFF.register("presets", "studies.tradeoff.presets:STUDY")
TRADEOFF.register("ends_tracker", "studies.tradeoff.outcomes:TRACKER")
TRADEOFF.register("ends_decimation", "studies.tradeoff.outcomes:DECIMATION")
TRADEOFF.register("ends_calibration", "studies.tradeoff.outcomes:CALIBRATION")
TRADEOFF.register("ends_rung", "studies.tradeoff.outcomes:RUNG")
TRADEOFF.register("effects", "studies.tradeoff.effects:STUDY")

STABILITY.register("integrators", "studies.maps.integrators:STUDY")
STABILITY.register("open_loop", "studies.maps.open_loop:STUDY")
STABILITY.register("planner", "studies.maps.planner:STUDY")
STABILITY.register("tracker", "studies.maps.tracker:STUDY")
STABILITY.register("views", "studies.maps.views:STUDY")
STABILITY.register("carry_over", "studies.maps.carry_over:STUDY")
STABILITY.register("lab_tows", "studies.maps.lab_tows:STUDY")
