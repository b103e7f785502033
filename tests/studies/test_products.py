"""The products tradeoff and stability in small: parts, tables, charts, page; and what the charts must show."""

import json
import time

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Annotation

from studies.charts import COLOURS, MARKERS, RIGHT, advice, map_chart, medians, scatter_chart, unbeaten
from studies.comparators.smoothers import douglas_peucker, rts_smoother, smoothing_spline
from studies.compute import gather, run_part
from studies.costs import least_cpu_seconds, take_turns, wall_and_cpu_seconds
from studies.draw import draw_chart, figure_of
from studies.frame import Judgement, Outcomes, Scatter, Settings, judged, loaded
from studies.page import front_view, write_page
from studies.registry import FIGURES, PAPER, STABILITY, TRADEOFF
from studies.tradeoff.friction import CENTRE, FRICTION, MASS, SIDE, true_wrench

CHARTED = {**TRADEOFF, **STABILITY}
CHEAP = {"decimation": None, "planner": ["steering"], "open_loop": ["creep"]}
"""Charts, and their parts where not all, that are computed here in seconds."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The cheap charts, made as the workflow makes them."""
    folder = tmp_path_factory.mktemp("study")
    for chart, parts in CHEAP.items():
        written = []
        for name, part in loaded(CHARTED[chart]).parts(Settings(quick=True)).items():
            if parts is None or name in parts:
                written.append(folder / "blocks" / chart / f"{name}.csv")
                run_part(CHARTED[chart], part, written[-1], short=True)
        table = folder / f"{chart}.csv"
        gather(written, table)
        draw_chart(chart, CHARTED[chart], {}, {chart: table}, folder)
    return folder


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("chart", CHARTED)
def test_parts_are_plain_data_with_names_of_files(chart, quick):
    parts = loaded(CHARTED[chart]).parts(Settings(quick=quick))
    assert json.loads(json.dumps(parts)) == parts
    assert all(name.replace("_", "").replace("-", "").isalnum() for name in parts)


def test_names_of_studies_and_figures_are_unique():
    """They share rules of the workflow, which tell them apart by name."""
    names = [*PAPER, *TRADEOFF, *STABILITY, *FIGURES]
    assert len(set(names)) == len(names)


def test_a_cell_is_right_flagged_or_silently_wrong():
    right, flagged, wrong = Judgement
    cases = ((0.5, [], right), (2.0, [], wrong), (2.0, ["a"], flagged), (0.5, ["a"], flagged), (np.nan, [], wrong))
    for error, flags, expected in cases:
        assert judged(error, 1.0, flags)["judgement"] == expected


def test_times_are_cpu_times_taken_in_turns():
    order = []

    def spin(name, seconds):
        order.append(name)
        end = time.process_time() + seconds
        while time.process_time() < end:
            pass
        return name

    timed = take_turns({"short": lambda: spin("short", 0.01), "long": lambda: spin("long", 0.03)}, 3)
    assert order == ["short", "long", "long", "short", "short", "long"]
    assert timed["short"].result == "short"
    assert 0.01 <= timed["short"].cpu_s < timed["long"].cpu_s <= timed["long"].cpu_most_s


def test_cpu_time_leaves_waiting_out():
    wall, cpu = wall_and_cpu_seconds(lambda: time.sleep(0.05))
    assert wall >= 0.05 > 5 * cpu
    assert least_cpu_seconds(lambda: time.sleep(0.01), 2) < 0.005


def test_the_front_holds_what_nothing_beats():
    rows = pd.DataFrame({"cost": [1, 2, 3, 3, 4], "error": [5, 3, 4, 3, 1]})
    assert unbeaten(rows).index.tolist() == [0, 1, 4]


def test_the_true_wrench_is_that_of_a_sliding_block():
    """Without turning, every node slides alike: the force is μ N against the motion, the moment none."""
    force = true_wrench(0.3, 0.4, 1e-9)
    np.testing.assert_allclose(force, [-0.6 * FRICTION * MASS * 9.81, -0.8 * FRICTION * MASS * 9.81, 0], atol=1e-7)
    assert abs(CENTRE[0]) + abs(CENTRE[1]) < SIDE / 6


def test_the_boundary_integral_beats_cells_in_cost_and_error():
    keys = {"element_sizes_m": [0.01], "parts": [16], "rounds": 2}
    rows = pd.DataFrame(loaded(TRADEOFF["friction"]).rows(**keys))
    exact = rows[rows["default"].astype(bool)].iloc[0]
    mesh = rows[rows["series"] == "mesh (Table 1)"].iloc[0]
    assert exact["error"] < 1e-9
    assert mesh["error"] > 1e-5
    assert exact["cost"] < mesh["cost"]


def test_the_rule_of_the_stage_is_not_beaten_by_what_keeps_fewer_points(folder):
    """Smoothers of all poses may be better; what decimates is not, nor is the path simulated behind it."""
    rows = medians(pd.read_csv(folder / "decimation.csv"))
    for _, panel in rows.groupby("panel"):
        default = panel[panel["default"].astype(bool)].iloc[0]
        others = panel[~panel["series"].isin(["stage decimate", "RTS smoother, white jerk", "smoothing spline"])]
        assert (others["error"] > 1.5 * default["error"]).all()
    assert rows.loc[rows["panel"].str.startswith("Points") & rows["default"].astype(bool), "cost"].item() < 30


def test_smoothers_and_thinning_follow_a_line():
    """On a straight, even motion without noise all of them are exact, and Douglas and Peucker keep its ends."""
    time_s = np.arange(100) / 25
    values, moments = np.column_stack([0.1 * time_s, 0.2 - 0.05 * time_s]), np.linspace(0, 3.9, 57)
    exact = np.column_stack([0.1 * moments, 0.2 - 0.05 * moments])
    np.testing.assert_allclose(rts_smoother(time_s, values, np.array([1e-3, 1e-3]), 1e-3, moments), exact, atol=1e-6)
    np.testing.assert_allclose(smoothing_spline(time_s, values, moments), exact, atol=1e-9)
    assert douglas_peucker(values, 1e-6).tolist() == [0, 99]
    bent = np.column_stack([time_s, np.abs(time_s - 2)])
    assert douglas_peucker(bent, 1e-6).tolist() == [0, 50, 99]


def test_a_smoother_takes_noise_off():
    rng, time_s = np.random.default_rng(3), np.arange(500) / 25
    truth = np.sin(time_s)[:, None]
    noisy = truth + 1e-3 * rng.standard_normal(truth.shape)
    smooth = rts_smoother(time_s, noisy, np.array([1e-3]), 1e-2, time_s)
    assert np.std(smooth - truth) < 0.5e-3


def test_no_cell_of_ours_is_silently_wrong(folder):
    for chart in ("planner", "open_loop"):
        rows = pd.read_csv(folder / f"{chart}.csv")
        assert not (rows["judgement"] == Judgement.SILENTLY_WRONG).any()
        assert (rows["judgement"] == Judgement.RIGHT).any()
        assert (rows["judgement"] == Judgement.FLAGGED).any()


def test_charts_tables_and_page_are_there(folder):
    names = {"tradeoff": ["decimation"], "stability": ["planner", "open_loop"]}
    products = {product: {chart: CHARTED[chart] for chart in charts} for product, charts in names.items()}
    for product in products:
        write_page(product, products, folder, folder / f"{product}.md")
    assert "0 silently wrong" in (folder / "stability.md").read_text(encoding="utf-8")
    page = (folder / "study.html").read_text(encoding="utf-8")
    for chart in CHEAP:
        assert loaded(CHARTED[chart]).chart.title in page
        for ending in ("csv", "pdf", "svg", "png"):
            assert (folder / f"{chart}.{ending}").stat().st_size > 0
    assert "http-equiv" in page
    assert "src=" not in page.replace("default-src", "")
    rows = pd.read_csv(folder / "decimation.csv")
    assert rows["machine"].str.contains("cores").all()
    assert rows["versions"].str.contains("towval").all()


@pytest.mark.parametrize("chart", list(CHEAP))
def test_labels_lie_beside_each_other(folder, chart):
    """No shown label covers another, and none leaves the figure."""
    figure = figure_of(loaded(CHARTED[chart]), {}, {chart: pd.read_csv(folder / f"{chart}.csv")})
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    whole = figure.get_window_extent()
    for axes in figure.axes:
        shown = [text for text in axes.texts if isinstance(text, Annotation) and text.get_visible()]
        named = [axes.title, axes.xaxis.label, axes.yaxis.label]
        boxes = [text.get_window_extent() for text in (*shown, *(text for text in named if text.get_text()))]
        assert all(whole.x0 <= box.x0 and box.x1 <= whole.x1 for box in boxes)
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    figure.set_dpi(300)  # as saved: at 100 dots an inch letters are wider than in print
    canvas.draw()
    whole = figure.get_window_extent()
    lines = [text.get_window_extent() for text in figure.texts]
    assert all(whole.x0 <= box.x0 and box.x1 <= whole.x1 for box in lines)
    assert not any(a.overlaps(b) for i, a in enumerate(lines) for b in lines[:i])


def test_labels_make_room_for_marks_and_for_each_other():
    """Three points side by side, nearer than a label is wide, and one at the right edge, all with their quartiles."""
    rows = pd.DataFrame(
        {"panel": "", "series": list("abcd"), "setting": ["one", "two", "three", "last"], "default": False}
        | {"cost": [1.0, 1.02, 1.04, 2.0], "error": [1.0, 1.01, 1.0, 0.5]}
    )
    rows = pd.concat([rows.assign(error=spread * rows["error"]) for spread in (0.8, 1.0, 1.25)])
    figure = scatter_chart(rows, "Title", ("cost", "error"), "Note.")
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    labels = [text for text in axes.texts if text.get_visible()]
    assert {text.get_text() for text in labels} == {"one", "two", "three", "last"}
    # Without the lines that lead from a point to its label: they end at the edge of the label's box.
    drawn = [line for line in axes.lines if line.get_lw() != 0.5]
    marks = [point for line in drawn for point in axes.transData.transform(np.column_stack(line.get_data()))]
    bars = [axes.transData.transform(bar) for lines in axes.collections for bar in lines.get_segments()]
    assert any(np.ptp(bar, axis=0).max() > 20 for bar in bars)
    marks += [point for start, end in bars for point in start + np.linspace(0, 1, 50)[:, None] * (end - start)]
    for label in labels:
        box = label.get_window_extent()
        assert not any(box.contains(*mark) for mark in marks)
        assert axes.get_window_extent().contains(box.x0, box.y0)
        assert axes.get_window_extent().contains(box.x1, box.y1)


def test_a_crowded_label_is_led_to_its_point():
    """Five points within the width of a label: all are named, and no line to a point crosses a name."""
    settings = [f"setting {k}" for k in range(5)]
    rows = pd.DataFrame({"panel": "", "series": settings, "setting": settings, "default": False, "error": 1.0})
    figure = scatter_chart(rows.assign(cost=1 + 0.02 * np.arange(5)), "Title", ("cost", "error"), "Note.")
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    shown = {text.get_text(): text.get_window_extent() for text in axes.texts if text.get_visible()}
    assert len(shown) == 5
    leads = [axes.transData.transform(np.column_stack(line.get_data())) for line in axes.lines if line.get_lw() == 0.5]
    assert 0 < len(leads) < 5
    for start, end in leads:
        steps = start + np.linspace(0, 0.8, 200)[:, None] * (end - start)
        assert not any(box.contains(*step) for box in shown.values() for step in steps)


def test_the_series_with_the_default_looks_alike_in_all_charts():
    rows = pd.DataFrame({"panel": "", "series": ["a", "b"], "setting": "x", "cost": 1.0, "error": [1.0, 2.0]})
    for default in ("a", "b"):
        figure = scatter_chart(rows.assign(default=rows["series"] == default), "Title", ("cost", "error"), "Note.")
        handles = {line.get_label(): line for line in figure.legends[0].legend_handles}
        assert (handles[default].get_color(), handles[default].get_marker()) == (COLOURS[0], MARKERS[0])


@pytest.mark.parametrize("short", [True, False])
def test_a_chart_of_the_short_variant_says_so_and_how_many_seeds_it_has(short):
    """Below the picture and on the page: what to take was concluded from the whole study."""
    rows = pd.DataFrame({"panel": "", "series": "a", "setting": "x", "default": True, "cost": 1.0, "error": [1.0, 2]})
    for count in (1, 2):
        given = rows[:count].assign(short=short)
        below = " ".join(text.get_text() for text in scatter_chart(given, "Title", ("c", "e"), "Note.").texts)
        assert ("Short variant" in below) == short
        assert ("over 2 seeds" in below) == (count == 2)
        view = front_view("chart", Scatter("Title", "cost", "error", "Note.", "Take x."), given, Markup(""))
        assert view.summary.startswith("Take x. Short variant" if short else "Take x. 1 point")


@pytest.mark.parametrize("chart", TRADEOFF)
def test_a_chart_of_error_against_cost_says_what_to_take_and_what_its_truth_is(chart):
    drawn = loaded(TRADEOFF[chart]).chart
    assert drawn.take.startswith("Take")
    assert "ruth" in drawn.truth or "share" in drawn.truth


FEET, TOW, STAGE = "four feet", "CPU time of decimating and simulating [s]", "selected by the stage"
PLANES = ("floor", "top at 0.35 m")
NAMED = {
    "friction": [
        ("", "boundary integral", "edges whole"), ("", "boundary integral", "edges in 2"),
        ("", "boundary integral", "edges in 4"), ("", "mesh (Table 1)", "1 mm"),
        ("", "limit surface", "ellipsoid"), ("", "table of wrenches", "128 × 64"),
    ],
    "dynamics": [
        ("", "towval, dynamics", "1e-7"), ("", "towval, dynamics", "1e-6"), ("", "towval, no inertia", "tractrix"),
        ("", "towval, no inertia", "limit surface"),
    ],
    "calibration": [
        *((panel, STAGE, f"{views} views") for views in (12, 4, 20) for panel in PLANES),
        *((panel, lens, "12 views") for lens in ("k1", "k1 k2", "rational") for panel in PLANES),
    ],
    "tracking": [("", name, "all") for name in ("plane, 1024 points", "plane, 4096 points", "plane, 256 points")]
    + [("", "KLT, anchored", "all")],
    "decimation": [
        (TOW, "stage decimate", "3"), (TOW, "stage decimate", "10"), (TOW, "RTS smoother, white jerk", "0.1"),
        (TOW, "RTS smoother, white jerk", "0.001"), (TOW, "Douglas-Peucker, linear", "1 mm"),
        (TOW, "smoothing spline", "cross-validated"),
    ],
    "presets": [("measured path", name, name) for name in ("standard", "draft", "fine", "auto")],
    "effects": [
        (FEET, "all taken", "all"), (FEET, "all taken", "rise 0.01 mm/s"), (FEET, "one left out", "no slope"),
        (FEET, "one left out", "no heights"),
    ],
}  # fmt: skip
"""Points that each chart's reasons name, the default first; for the charts of outcomes see test_outcomes.py."""


def test_the_points_that_reasons_name_are_known_of_all_charts():
    assert {name for name in TRADEOFF if not isinstance(loaded(TRADEOFF[name]).chart, Outcomes)} == set(NAMED)


@pytest.mark.parametrize("chart", NAMED)
def test_the_reasons_below_a_chart_follow_from_its_rows(chart):
    rows = pd.DataFrame(NAMED[chart], columns=["panel", "series", "setting"])
    errors = 1.7 * 2.0 ** -np.arange(len(rows))
    rows = rows.assign(error=errors, cost=np.linspace(1, 2, len(rows)), default=rows.index == 0)
    if chart == "dynamics":
        rows = pd.concat([rows, rows.iloc[-1:].assign(series="SciPy Radau", setting="1e-6", cost=7.0, error=1e-3)])
        rows = rows.reset_index(drop=True)
    drawn = loaded(TRADEOFF[chart]).chart
    said = advice(drawn, rows)
    assert said.startswith(drawn.take + " ")
    for k in rows.index:
        changed = rows.copy()
        changed.loc[k, ["error", "cost"]] *= [0.3, 3.0]
        assert advice(drawn, changed) != said, rows.loc[k]
    assert advice(drawn, rows.assign(short=True)) == drawn.take


@pytest.mark.parametrize("chart", STABILITY)
def test_a_map_says_what_to_conclude(chart):
    assert loaded(STABILITY[chart]).chart.take.endswith(".")


def test_the_default_of_a_map_is_framed():
    rows = pd.DataFrame({"map": "m", "x": [1.0, 2.0, 1.0, 2.0], "y": [1.0, 1.0, 5.0, 5.0], "judgement": RIGHT})
    figure = map_chart(rows, "Title", {"m": ("x", "y")}, "Note.", "Take it.", {"m": {"y": 5.0, "x": 7.0}})
    (axes,) = figure.axes
    (frame,) = [patch for patch in axes.patches if not patch.get_fill()]
    assert frame.get_bbox().bounds == (-0.5, 0.5, 2.0, 1.0)
    assert "default" in [text.get_text() for text in figure.legends[0].get_texts()]
    figure = map_chart(rows, "Title", {"m": ("x", "y")}, "Note.", "Take it.", {"another map": {"y": 5.0}})
    assert "default" not in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize(
    ("cost", "errors", "beaten"),
    [(0.5, [1.0, 1.1, 1.2], True), (0.5, [1.0, 2.5, 4.0], False), (3.0, [1.0, 1.1, 1.2], False)],
)
def test_the_page_names_what_is_cheaper_than_the_default_and_better_beyond_scatter(cost, errors, beaten):
    given = [("standard", 1.0, [2.0, 3.0, 4.0], True), ("other", cost, errors, False)]
    rows = [
        {"panel": "", "series": name, "setting": "x", "cost": spent, "error": error, "default": default}
        for name, spent, each, default in given
        for error in each
    ]
    view = front_view("chart", Scatter("Title", "cost", "error", "Note."), pd.DataFrame(rows), Markup(""))
    assert ("better beyond scatter: other x." in view.summary) == beaten
    assert ("Nothing is cheaper" in view.summary) != beaten


def test_advice_stands_out_and_scatter_is_drawn_between_the_quartiles():
    rows = pd.DataFrame(
        {"panel": "", "series": "a", "setting": "x", "default": True, "cost": 1.0, "error": [1.0, 2, 3, 4, 5]}
    )
    figure = scatter_chart(rows, "Title", ("cost", "error"), "Note.", "Take x.")
    (axes,) = figure.axes
    (line,) = [segment for lines in axes.collections for segment in lines.get_segments()]
    assert line[:, 1].tolist() == [2.0, 4.0]
    weights = {text.get_text(): text.get_weight() for text in figure.texts}
    assert weights["Take x."] == "bold"
    assert weights["Medians and quartiles over 5 seeds. Note."] != "bold"


def test_repeated_points_are_drawn_as_their_median():
    repeated = {"panel": "", "series": "a", "setting": "x", "default": False}
    rows = pd.DataFrame(repeated | {"cost": [1.0, 2.0, 9.0], "error": [3.0, 5.0, 4.0]})
    assert medians(rows)[["cost", "error"]].to_numpy().tolist() == [[2.0, 4.0]]


@pytest.mark.parametrize("default", [True, False])
def test_the_legend_names_a_default_only_where_one_is_drawn(default):
    rows = pd.DataFrame({"panel": "", "series": list("ab"), "setting": "one", "default": [default, False]})
    figure = scatter_chart(rows.assign(cost=[1.0, 2.0], error=[2.0, 1.0]), "Title", ("cost", "error"), "Note.")
    assert ("default" in [text.get_text() for text in figure.legends[-1].get_texts()]) == default


@pytest.mark.parametrize("seeds", [1, 3])
def test_the_page_speaks_of_scatter_only_where_seeds_repeat(seeds):
    rows = pd.DataFrame({"panel": "", "series": list("ab"), "setting": "one", "default": [True, False]})
    table = pd.concat([rows.assign(cost=[1.0, 2.0], error=[2.0, 1.0])] * seeds)
    counts = front_view("name", Scatter("Title", "cost", "error", "Note."), table, Markup("")).counts
    assert "Nothing is cheaper" in counts
    assert ("scatter" in counts) == (seeds > 1)
