"""How rerun.rbl was made, with rerun-sdk: python make_rerun_layout.py rerun.rbl."""

import sys

import rerun.blueprint as rrb

FLOOR = rrb.Spatial3DView(
    origin="/",
    name="floor",
    contents=["/tf", "/tf_static", "/rover/outline", "/object/outline", "/object_simulated/outline", "/tether/line"],
)
CAMERA = rrb.Spatial2DView(origin="/camera/image", name="camera")
PLOTS = (
    rrb.TimeSeriesView(
        origin="/object/error_state/position", name="error: along, across (m), heading (rad), |E|/u_val"
    ),
    rrb.TimeSeriesView(origin="/tether/state/effort", name="tension (N)"),
)

if __name__ == "__main__":
    layout = rrb.Blueprint(rrb.Horizontal(rrb.Vertical(FLOOR, CAMERA), rrb.Vertical(*PLOTS)), collapse_panels=True)
    layout.save("towval", sys.argv[1])
