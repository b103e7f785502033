"""How rerun.rbl was made, with rerun-sdk: python make_rerun_layout.py rerun.rbl.

Rerun applies a layout to recordings of the same application, which `rerun mcap convert --application-id` names.
"""

import sys

import rerun as rr
import rerun.blueprint as rrb

APPLICATION = "towval"
"""That of the recordings which the layout opens."""

ROVER, MEASURED, SIMULATED, TETHER = (0x21, 0x66, 0xAC), (0xD6, 0x27, 0x28), (0x1B, 0x1B, 0x1B), (0x8A, 0x8A, 0x8A)
SERIES = [(0x3B, 0x8E, 0xE0), (0xE0, 0x52, 0x3A), (0x3B, 0x8E, 0xE0), (0x3B, 0x8E, 0xE0)]
"""Of along, across, heading and ratio; seen on the viewer's dark ground and on its light one."""
WHITE = (0xFF, 0xFF, 0xFF)
HIDDEN = rrb.PlotLegend(visible=False)

ERRORS = "/object/error_state/position"
"""One entity of four series: along, across, heading, ratio; each plot shows some of them."""


def points(colour):
    """Points of one colour, a line when seen from above."""
    return rr.Points3D.from_fields(colors=[colour], radii=[0.006])


def plot(name, shown):
    """A plot of some of the error's four series."""
    lines = rr.SeriesLines.from_fields(colors=SERIES, visible_series=[k in shown for k in range(4)], widths=[1.5] * 4)
    return rrb.TimeSeriesView(origin=ERRORS, name=name, overrides={ERRORS: lines}, plot_legend=HIDDEN)


FLOOR = rrb.Spatial3DView(
    origin="/",
    name="floor: rover blue, object measured red, simulated black",
    contents=["/tf", "/tf_static", "/rover/outline", "/object/outline", "/object_simulated/outline", "/tether/line"],
    overrides={
        "/rover/outline": points(ROVER),
        "/object/outline": points(MEASURED),
        "/object_simulated/outline": points(SIMULATED),
        "/tether/line": points(TETHER),
    },
    spatial_information=rrb.SpatialInformation("floor"),
    # From above, as the camera sees it.
    eye_controls=rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=(0.0, 0.0, 4.5), look_target=(0.0, 0.0, 0.0), eye_up=(0.0, 1.0, 0.0)
    ),
    background=WHITE,
    line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(0xB0, 0xB0, 0xB0)),
)
CAMERA = rrb.Spatial2DView(origin="/camera/image", name="camera")
PLOTS = (
    plot("error along (blue), across (red), m", {0, 1}),
    plot("error of the heading, rad", {2}),
    plot("|E| / u_val", {3}),
    rrb.TimeSeriesView(
        origin="/tether/state/effort",
        name="tension of the tether, N",
        overrides={"/tether/state/effort": rr.SeriesLines(colors=SERIES[0], widths=1.5)},
        plot_legend=HIDDEN,
    ),
)

if __name__ == "__main__":
    layout = rrb.Blueprint(rrb.Horizontal(rrb.Vertical(FLOOR, CAMERA), rrb.Vertical(*PLOTS)), collapse_panels=True)
    layout.save(APPLICATION, sys.argv[1])
