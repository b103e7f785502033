import dataclasses

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from report_scenes import LOST, SLACK, ceiling_calibration, towed_run, uncertainty_of
from towval.model import CameraTrack, Stamp, UncertaintyMap
from towval.model.errors import InputError
from towval.model.inputs import INPUTS
from towval.report import figures
from towval.report.data import ReportSettings
from towval.report.figures.errors import intervals
from towval.report.figures.runs import map_axes
from towval.report.style import (
    COLUMN_WIDTH_IN,
    MEASURED,
    PAGE_WIDTH_IN,
    ROVER,
    SIMULATED,
    frame_of,
    save_figure,
    svg_text,
)


@pytest.fixture(scope="module")
def run():
    return towed_run()


@pytest.fixture(scope="module")
def calibration():
    return ceiling_calibration()


@pytest.mark.parametrize("size_m", [0.12, 0.3, 0.8, 2.2, 4.0, 9.0, 60.0, 4712.0])
def test_maps_of_every_size_have_some_round_numbers_on_their_axes(size_m):
    """Steps of half a metre or one gave a small map a single number, and a large one thousands."""
    axes = Figure().add_subplot()
    map_axes(axes, np.zeros(2), np.array([size_m, size_m / 2]))
    ticks = axes.get_xticks()
    assert 3 <= np.count_nonzero((ticks >= 0) & (ticks <= size_m)) <= 9


def test_statistics_stand_beside_those_of_right_models():
    run = towed_run()
    assert figures.statistics_figure(run) is None
    tested = {f"{name}_statistic": value for name, value in (("size", 1.0), ("shape", 6.0), ("input", 1.0))}
    limits = {"size_limit": 2.0, "shape_limit": 4.0, "input_limit": 4.0}
    draws = np.column_stack([np.arange(4.0), [0.2, 0.4, 0.4, 0.9]])
    comparison = dataclasses.replace(run.comparison, **tested, **limits, drawn_tests=draws)
    figure = figures.statistics_figure(dataclasses.replace(run, comparison=comparison))
    assert sum(bar.get_height() for bar in figure.axes[0].patches) == pytest.approx(100)
    marks = {drawn.get_label(): drawn.get_xdata()[0] for drawn in figure.axes[0].get_lines()[1:]}
    assert marks == {"size": 0.5, "shape": 1.5, "input": 0.25}
    few_draws = dataclasses.replace(comparison, input_statistic=0.0, input_limit=1e-9)
    figure = figures.statistics_figure(dataclasses.replace(run, comparison=few_draws))
    assert [drawn.get_label() for drawn in figure.axes[0].get_lines()[1:]] == ["size", "shape"]


def line(axes, colour, width):
    return next(a for a in axes.lines if a.get_color() == colour and a.get_linewidth() == pytest.approx(width))


def test_run_figure_draws_the_paths_it_was_given(run):
    axes = figures.run_figure(run).axes[0]
    np.testing.assert_array_equal(line(axes, SIMULATED, 1.5).get_xydata(), run.simulated.pose[:, :2])
    np.testing.assert_array_equal(line(axes, ROVER, 0.9).get_xydata(), run.rover_track.pose[:, :2])
    np.testing.assert_array_equal(line(axes, MEASURED, 1.1).get_xydata(), run.object_track.pose[:, :2])


def test_lost_frames_leave_gaps(run):
    drawn = line(figures.run_figure(run).axes[0], MEASURED, 1.1).get_xydata()
    assert np.isnan(drawn[LOST]).all()
    assert np.isfinite(np.delete(drawn, np.r_[LOST], axis=0)).all()


def test_scales_of_a_run_figure_are_equal_and_it_is_a_column_wide(run):
    figure = figures.run_figure(run)
    axes, (width, height) = figure.axes[0], figure.get_size_inches()
    box = axes.get_position()
    metres_per_inch_x = np.ptp(axes.get_xlim()) / (box.width * width)
    metres_per_inch_y = np.ptp(axes.get_ylim()) / (box.height * height)
    assert width == pytest.approx(COLUMN_WIDTH_IN)
    # A hundredth of a millimetre over the width of the column is far below the width of a line.
    assert metres_per_inch_x == pytest.approx(metres_per_inch_y, rel=2e-3)


def test_everything_drawn_lies_inside_the_frame(run):
    axes = figures.run_figure(run).axes[0]
    drawn = np.concatenate([a.get_xydata() for a in axes.lines])
    for column, (low, high) in enumerate((axes.get_xlim(), axes.get_ylim())):
        assert low < np.nanmin(drawn[:, column])
        assert np.nanmax(drawn[:, column]) < high


def test_outlines_come_at_equal_steps_along_the_path(run):
    axes = figures.run_figure(run).axes[0]
    outlines = [a.get_xydata() for a in axes.lines if len(a.get_xydata()) == 5 and a.get_color() == SIMULATED]
    centres = np.array([o[:4].mean(axis=0) for o in outlines])
    path = run.simulated.pose[:, :2]
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = arc[[np.argmin(np.linalg.norm(path - centre, axis=1)) for centre in centres]]
    # About seven outlines that do not overlap; a sample of the path is 10 mm from the next.
    size = np.ptp(run.towed.top_corners_m, axis=0).max()
    np.testing.assert_allclose(np.diff(at[:-1]), max(arc[-1] / 6, 1.1 * size), atol=0.02)
    assert at[-1] == pytest.approx(arc[-1])


def test_campaign_figure_has_a_panel_a_run_at_one_scale(run):
    figure = figures.campaign_figure([run, dataclasses.replace(run, name="b"), dataclasses.replace(run, name="c")])
    assert [axes.get_title(loc="left") for axes in figure.axes[:3]] == ["(a) run a", "(b) run b", "(c) run c"]
    assert len({round(float(np.ptp(axes.get_xlim())), 9) for axes in figure.axes[:3]}) == 1
    assert figure.get_size_inches()[0] == pytest.approx(PAGE_WIDTH_IN)


def test_campaign_figure_without_runs_is_refused():
    with pytest.raises(InputError, match="needs a run"):
        figures.campaign_figure([])


def test_error_figure_shows_millimetres_degrees_and_newton(run):
    panels = figures.error_figure(run).axes
    for panel, column, scale in ((0, 0, 1e3), (1, 1, 1e3), (2, 2, 180 / np.pi)):
        np.testing.assert_allclose(
            line(panels[panel], SIMULATED, 0.9).get_ydata(), scale * run.comparison.error[:, column]
        )
    np.testing.assert_allclose(
        line(panels[3], SIMULATED, 0.8).get_ydata(), np.hypot(*run.simulated.tether_force.T), atol=1e-12
    )


def test_error_band_is_two_standard_uncertainties_wide(run):
    panels = figures.error_figure(dataclasses.replace(run, uncertainty=uncertainty_of(run, 0.002))).axes
    for axes, half_width in ((panels[0], 4.0), (panels[1], 2.0), (panels[2], np.rad2deg(0.008))):
        assert np.abs(axes.collections[0].get_paths()[0].vertices[:, 1]).max() == pytest.approx(half_width)


def test_bands_along_and_across_are_the_turned_covariance(run):
    known = dataclasses.replace(run, uncertainty=uncertainty_of(run, 0.002))
    heading = 0.3
    c, s = np.cos(heading), np.sin(heading)
    error = run.comparison.error[:, :2]
    turned = error @ np.array([[c, -s], [s, c]])
    comparison = dataclasses.replace(run.comparison, along_across=turned)
    panels = figures.agreement_figure(dataclasses.replace(known, comparison=comparison)).axes
    expected = 4.0 * np.array([np.hypot(c, s / 2), np.hypot(s, c / 2)])
    for axes, half_width in zip(panels, expected, strict=False):
        assert np.nanmax(np.abs(axes.collections[0].get_paths()[0].vertices[:, 1])) == pytest.approx(half_width)


def test_ratio_is_that_of_the_comparison_gaps_and_all(run):
    ratio = np.linspace(0, 3, len(run.comparison.time_s))
    ratio[:15] = np.nan
    known = dataclasses.replace(
        run, uncertainty=uncertainty_of(run, 0.002), comparison=dataclasses.replace(run.comparison, ratio=ratio)
    )
    drawn = line(figures.agreement_figure(known).axes[2], SIMULATED, 0.9).get_ydata()
    np.testing.assert_array_equal(drawn, ratio)


def test_shares_are_sorted_and_in_per_cent(run):
    known = dataclasses.replace(run, uncertainty=uncertainty_of(run))
    axes = figures.shares_figure([known, run]).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["friction", "rest length", "camera"]
    np.testing.assert_allclose([bar.get_width() for bar in axes.patches], [60, 25, 10])


def test_small_shares_are_one_row_and_what_no_input_explains_is_the_last(run):
    shares = {"a": 0.002, "noise and interactions": 0.5, "b": 0.3, "c": 0.19, "d": 0.008}
    known = dataclasses.replace(run, uncertainty=dataclasses.replace(uncertainty_of(run), shares=shares))
    axes = figures.shares_figure([known]).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["b", "c", "2 others together", "noise and interactions"]
    np.testing.assert_allclose([bar.get_width() for bar in axes.patches], [30, 19, 1, 50])
    colours = [bar.get_facecolor() for bar in axes.patches]
    assert colours[0] == colours[2] != colours[3]
    del shares["a"]
    assert "d" in [label.get_text() for label in figures.shares_figure([known]).axes[0].get_yticklabels()]


def test_a_rejected_run_says_so_where_its_error_is_drawn(run):
    known = dataclasses.replace(run, uncertainty=uncertainty_of(run))
    tests = dataclasses.replace(known.comparison, shape_statistic=9.0, shape_limit=4.0)
    rejected = dataclasses.replace(known, comparison=tests)
    titles = [figures.agreement_figure(each).axes[0].get_title(loc="left") for each in (known, rejected)]
    assert titles == ["Run a: error, with its validation uncertainty", "Run a: error, rejected by its shape"]


def test_axes_of_deviations_are_logarithmic_where_a_few_hide_the_others(run):
    track = run.rover_track
    assert figures.tracking_figure(track).axes[2].get_yscale() == "linear"
    covariance = track.covariance.copy()
    covariance[7, 0, 0] *= 1e4
    axes = figures.tracking_figure(dataclasses.replace(track, covariance=covariance)).axes
    assert [axes[k].get_yscale() for k in (2, 3)] == ["log", "linear"]


def test_words_of_the_shares_are_whole_and_apart(run):
    """With the longest names: within the figure, and the legend beside them."""
    names = ["noise and interactions", *(row.label for row in INPUTS.values())]
    known = dataclasses.replace(uncertainty_of(run), shares={name: 0.5**i for i, name in enumerate(names)})
    figure = figures.shares_figure([dataclasses.replace(run, uncertainty=known)])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes, renderer = figure.axes[0], canvas.get_renderer()
    labels = [label.get_window_extent(renderer) for label in axes.get_yticklabels()]
    title = axes.title if axes.title.get_text() else axes._right_title
    whole = [*labels, title.get_window_extent(renderer), axes.xaxis.label.get_window_extent(renderer)]
    assert min(box.x0 for box in whole) >= 0
    assert max(box.x1 for box in whole) <= figure.bbox.x1
    legend = figure.legends[0].get_window_extent(renderer)
    assert not any(legend.overlaps(label) for label in whole)


@pytest.mark.parametrize("names", ["ab", "abcdefghij", ["a_run_with_a_name", "another_of_that_length"]])
def test_the_legend_of_the_shares_covers_nothing(run, names):
    """It lay over the bars where one input had nearly all of the variance."""
    shares = {"anchor": 0.9, "friction": 0.04, "noise and interactions": 0.06}
    known = dataclasses.replace(uncertainty_of(run), shares=shares)
    figure = figures.shares_figure([dataclasses.replace(run, name=name, uncertainty=known) for name in names])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes, renderer = figure.axes[0], canvas.get_renderer()
    legend = figure.legends[0].get_window_extent(renderer)
    assert 0 <= legend.x0 < legend.x1 <= figure.bbox.x1
    assert legend.y0 >= 0
    assert legend.y1 <= axes.xaxis.label.get_window_extent(renderer).y0


def test_figures_without_their_data_are_left_out(run):
    assert figures.agreement_figure(run) is None
    assert figures.shares_figure([run]) is None
    assert figures.decimate_figure(dataclasses.replace(run, decimated=None)) is None


def test_slack_is_shaded_from_start_to_tension(run):
    time_s = run.simulated.time_s
    slack = intervals(time_s, np.hypot(*run.simulated.tether_force.T) == 0)
    assert slack == [(0.0, pytest.approx((time_s[SLACK.stop - 1] + time_s[SLACK.stop]) / 2))]


def test_intervals_of_nothing_and_of_everything():
    time_s = np.array([0.0, 1.0, 2.0])
    assert intervals(time_s, np.zeros(3, bool)) == []
    assert intervals(time_s, np.ones(3, bool)) == [(0.0, 2.0)]
    assert intervals(time_s, np.array([False, True, False])) == [(0.5, 1.5)]


def test_frame_of_a_figure_says_where_its_axes_are(run):
    frame = frame_of(figures.error_figure(run))
    assert (frame.x_low, frame.x_high) == (run.comparison.time_s[0], run.comparison.time_s[-1])
    assert 0 < frame.left < frame.right <= 1
    assert 0 < frame.top < frame.bottom < 1


def test_coverage_states_the_factor_it_exaggerates_by(calibration):
    figure = figures.coverage_figure(calibration)
    axes = figure.axes[0]
    residuals = next(a for a in axes.lines if a.get_label() == "residual").get_xydata().reshape(-1, 3, 2)
    drawn = residuals[:, 1] - residuals[:, 0]
    used = np.concatenate([v.residuals_px for v in calibration.views if not v.dropped])
    factor = float(axes.get_title(loc="left").split("×")[1])
    np.testing.assert_allclose(drawn, factor * used, atol=1e-9)


def test_image_axes_run_downward_over_the_whole_image(calibration):
    axes = figures.coverage_figure(calibration).axes[0]
    assert axes.get_xlim() == (-0.5, 1919.5)
    assert axes.get_ylim() == (1079.5, -0.5)


def test_reprojection_figure_names_every_view_and_why_it_was_dropped(calibration):
    errors = figures.reprojection_figure(calibration).axes[0]
    assert [label.get_text() for label in errors.get_yticklabels()] == [v.name for v in calibration.views]
    assert "corners not found" in errors.texts[0].get_text()


def test_uncertainty_figure_spans_the_deviations_of_the_map(calibration):
    pixels = np.stack(np.meshgrid([0.0, 960, 1919], [0.0, 1079]), axis=-1)
    std_m = np.array([[1e-3, 5e-4, 1e-3], [1e-3, np.nan, 1e-3]])
    covariance_m2 = 0.5 * std_m[..., None, None] ** 2 * np.eye(2)
    grid = UncertaintyMap(0.25, pixels, covariance_m2)
    np.testing.assert_allclose(grid.std_m, std_m)
    filled = figures.uncertainty_figure(calibration, grid).axes[0].collections[0]
    assert filled.get_clim() == (pytest.approx(0.5), pytest.approx(1.0))


def test_uncertainty_map_checks_its_shape():
    with pytest.raises(InputError, match=r"UncertaintyMap\.covariance_m2"):
        UncertaintyMap(0.25, np.zeros((2, 3, 2)), np.zeros((3, 2, 2, 2)))


def test_tracking_figure_counts_frames_by_status(run):
    legend = figures.tracking_figure(run.object_track).legends[0]
    assert [text.get_text() for text in legend.get_texts()] == ["tracked (188)", "lost (12)"]


def test_decimate_figure_counts_points_and_shows_the_distance_from_the_spline(run):
    figure = figures.decimate_figure(run)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["measured (200)", "kept (26)"]
    misfit = next(a for a in figure.axes[1].lines if a.get_marker() == ".").get_ydata()
    spline = run.decimated.poses_at(run.rover_track.time_s)
    np.testing.assert_allclose(misfit, 1e3 * (run.rover_track.pose - spline)[:, 0], atol=1e-9)


def test_files_are_the_same_to_the_byte_when_drawn_again(run, tmp_path):
    first = save_figure(figures.error_figure(run), tmp_path / "one", "errors")
    again = save_figure(figures.error_figure(run), tmp_path / "two", "errors")
    assert [path.name for path in first] == ["errors.pdf", "errors.svg", "errors.png"]
    for one, two in zip(first, again, strict=True):
        assert one.read_bytes() == two.read_bytes(), one.name


def test_files_in_formats_that_are_not_asked_for_are_removed(run, tmp_path):
    figure = figures.error_figure(run)
    before = save_figure(figure, tmp_path, "errors")[1].read_bytes()
    assert save_figure(figure, tmp_path, "errors", formats=["svg"]) == (tmp_path / "errors.svg",)
    assert [path.name for path in tmp_path.iterdir()] == ["errors.svg"]
    assert (tmp_path / "errors.svg").read_bytes() == before


def test_a_format_that_figures_do_not_have_is_named():
    assert ReportSettings(formats=[]).formats == ()
    for formats in (["eps"], ["png", "png"]):
        with pytest.raises(InputError, match="of pdf, svg, png, each once"):
            ReportSettings(formats=formats)


def test_drawing_leaves_the_settings_of_matplotlib_alone(run):
    before = dict(matplotlib.rcParams)
    svg_text(figures.tracking_figure(run.rover_track))
    assert dict(matplotlib.rcParams) == before


def test_a_folder_that_cannot_be_written_is_named(run, tmp_path):
    (tmp_path / "taken").write_text("a file where the folder should be")
    with pytest.raises(InputError, match="could not be saved"):
        save_figure(figures.decimate_figure(run), tmp_path / "taken", "figure")


def moved_camera(run, **changes):
    """A camera that creeps by 8 px, turns, and is not found again in ten frames."""
    n = len(run.rover_track.time_s)
    picture = np.outer(np.linspace(0, 1, n), [8.0, -3.0, 0.01, 0.002])
    picture[40:50] = np.nan
    stamps = np.zeros(n, dtype=np.uint8)
    stamps[[20, 90]] = Stamp.REPEATED, Stamp.CONTRADICTED
    full = ceiling_calibration()
    fields = {"motion": np.zeros((n, 9)), "picture": picture, "picture_std": 0.02 + 0 * picture, "stamps": stamps}
    camera = CameraTrack(full.camera, full.floor, **(fields | changes))
    return dataclasses.replace(run, rover_track=dataclasses.replace(run.rover_track, camera=camera))


def test_the_camera_figure_draws_what_was_corrected(run):
    moved = moved_camera(run)
    figure = figures.camera_figure(moved)
    camera = moved.rover_track.camera
    shift, turn, growth, strip = figure.axes
    np.testing.assert_array_equal(line(shift, SIMULATED, 0.6).get_ydata(), camera.picture[:, 0])
    np.testing.assert_array_equal(line(shift, ROVER, 1.6).get_ydata(), camera.picture[:, 1])
    np.testing.assert_allclose(line(turn, SIMULATED, 0.6).get_ydata(), np.rad2deg(camera.picture[:, 2]))
    np.testing.assert_allclose(line(growth, SIMULATED, 0.6).get_ydata(), 100 * camera.picture[:, 3])
    assert len(strip.patches) >= 2
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["as written (198)", "repeated (1)", "contradicted (1)", "band: ± 2 standard deviations"]


def test_a_camera_that_nothing_is_known_of_has_no_figure(run):
    assert figures.camera_figure(run) is None
    unseen = np.full((len(run.rover_track.time_s), 4), np.nan)
    sound = np.zeros(len(unseen), dtype=np.uint8)
    assert figures.camera_figure(moved_camera(run, picture=unseen, picture_std=unseen, stamps=sound)) is None
    assert figures.camera_figure(moved_camera(run, picture=unseen, picture_std=unseen)) is not None
