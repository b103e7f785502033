"""Charts of what whole runs end with: stages made once, rows, summary, picture, and the checks of their numbers."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup
from matplotlib.backends.backend_agg import FigureCanvasAgg

from studies import end_to_end
from studies.charts import advice, outcome_summary
from studies.costs import Cost
from studies.draw import figure_of
from studies.end_to_end import Pipeline, PipelineResult
from studies.evidence import outcomes as evidence
from studies.frame import BOUND, OFF, Outcomes, Settings, loaded
from studies.page import front_view
from studies.registry import TRADEOFF
from studies.tradeoff import outcomes
from studies.tradeoff.outcomes import Variant, rows_of_campaign
from studies.worlds.campaign import random_tow
from studies.worlds.measured import measured_track
from towval.model import Choice
from towval.model.errors import RefusedError

CHARTS = {name: loaded(reference) for name, reference in TRADEOFF.items() if "outcomes" in reference}
TRUTH = {"time_s": np.array([0.0, 1.0]), "object": np.zeros((2, 3))}


@dataclass(frozen=True)
class Thing:
    """What a stage makes: equal ones are the same, whatever was chosen to get there."""

    content: str
    choices: tuple[str, ...] = ()


@pytest.fixture
def stages(monkeypatch):
    """Stages that note that they ran; the calibration is the same with 6 and with 12 folds."""
    ran = []

    def stage(name, result):
        def run(*args, **keys):
            ran.append(name)
            return result(*args)

        return run

    def calibrated(_, keys, views):
        if keys.get("lens_models") == ["none"]:
            raise RefusedError("no lens", got="none", remedy="another")
        return Thing(f"camera {views} {keys.get('misfit_ratio')}", (f"{keys.get('folds')} folds",))

    track = SimpleNamespace(time_s=[0.0, 1.0], choices=())
    motion = SimpleNamespace(pose=np.full((2, 3), 0.001), time_s=TRUTH["time_s"], choices=())
    spread = SimpleNamespace(choices=())
    comparison = SimpleNamespace(error_upper_m=0.003, verdict="agrees")
    for name, run in {
        "calibrated": stage("calibrate", calibrated),
        "_tracked": stage("track", lambda *_: {"rover": track, "object": track}),
        "_thinned": stage("decimate", lambda tracks, _: tracks),
        "simulate_selecting": stage("simulate", lambda *_: (None, motion)),
        "sample_selecting": stage("uncertainty", lambda *_: spread),
        "compare": stage("compare", lambda *_: comparison),
        "_verdict_alone": stage("compare", lambda *_: SimpleNamespace(error_upper_m=0.0005, verdict="disagrees")),
        "measurement_std_m": lambda *_: 0.001,
        "seen_places": lambda _: [],
        "Case": lambda *_: None,
        "stated_longer": lambda scene, by_m: scene,
        "_digest": lambda value: repr(replace(value, choices=()) if isinstance(value, Thing) else value),
    }.items():
        monkeypatch.setattr(end_to_end, name, run)
    return ran


def campaign():
    run = SimpleNamespace(video=SimpleNamespace(stem="a"))
    return SimpleNamespace(scene="scene", runs={"a": run}, run=lambda _: run, object=None, deviations={}, bodies=())


def test_what_was_made_of_the_same_input_is_not_made_again(stages):
    pipeline, whole = Pipeline(campaign()), list(end_to_end.STAGES)
    first = pipeline.run({})
    assert stages == whole
    pipeline.run({"calibrate": {"folds": 12}})
    assert stages == [*whole, "calibrate"]
    pipeline.run({"calibrate": {"misfit_ratio": 5.0}})
    # Tracks that are the same are thinned alike, whichever camera saw them.
    assert stages == [*whole, "calibrate", *(stage for stage in whole if stage != "decimate")]
    del stages[:]
    pipeline.run({"simulate": {"rung": "tractrix"}})
    assert stages == ["simulate"]
    assert set(first.costs) == set(whole)
    assert first.cpu_s == sum(each.cpu_s for each in first.costs.values())


def test_a_longer_tether_is_judged_anew_and_costs_nothing_of_the_right_one(stages):
    pipeline = Pipeline(campaign())
    right = pipeline.run({})
    del stages[:]
    wrong = pipeline.run({}, longer_m=0.01)
    assert stages == ["simulate", "compare"]
    assert (right.comparison.verdict, wrong.comparison.verdict) == ("agrees", "disagrees")


def test_a_row_says_whether_the_bound_held_and_what_was_refused(stages):
    variants = {"all": Variant("a"), "no lens": Variant("a", {"calibrate": {"lens_models": ["none"]}})}
    rows = pd.DataFrame(rows_of_campaign(Pipeline(campaign()), TRUTH, "track", variants, 1))
    assert rows["default"].tolist() == [True, True, False, False]
    bound, off = (rows[rows["panel"] == panel].iloc[0] for panel in (BOUND, OFF))
    assert (bound.error, bound.verdict, bound.holds) == (3.0, "agrees", True)
    assert off.error == pytest.approx(np.hypot(1, 1))
    assert (bound.wrong_error, bound.wrong_verdict, bound.wrong_holds) == (0.5, "disagrees", False)
    refused = rows.iloc[-1]
    assert (refused.verdict, refused.wrong_verdict, refused.holds) == ("refused", "refused", None)
    assert np.isnan(refused.cost)


def made_up(chart, campaigns=10):
    """Rows of a chart, every setting with numbers of its own."""
    rows = []
    stage, variants = chart.keywords["stage"], chart.keywords["variants"]
    for seed in range(campaigns):
        for k, (name, variant) in enumerate(variants.items()):
            result = PipelineResult(
                {}, np.zeros((2, 3)), TRUTH["time_s"], SimpleNamespace(), costs={stage: Cost(1.0 + 0.13 * k, 1.0)}
            )
            off, bound = 1.3 + 0.11 * k + 0.01 * seed, 3.1 + 0.23 * k
            rows += [
                {
                    "panel": panel, "series": variant.series, "setting": name, "cost": 7 + result.cpu_s,
                    "stage_cost": result.cpu_s, "error": error, "verdict": "agrees" if seed != k else "cannot tell",
                    "holds": seed % 4 != k % 4, "wrong_error": 20 + error, "wrong_holds": seed % 5 != k % 5,
                    "wrong_verdict": "disagrees" if seed % 3 else "cannot tell", "seed": seed,
                    "default": variant == Variant(variant.series),
                }
                for panel, error in ((BOUND, bound), (OFF, off))
            ]  # fmt: skip
    return pd.DataFrame(rows)


@pytest.mark.parametrize("chart", CHARTS)
def test_a_table_is_the_same_after_writing(chart, tmp_path):
    rows = made_up(CHARTS[chart].rows)
    rows.to_csv(tmp_path / "table.csv", index=False)
    summary = outcome_summary(rows)
    pd.testing.assert_frame_equal(outcome_summary(pd.read_csv(tmp_path / "table.csv")), summary, check_dtype=False)
    first = summary.iloc[0]
    assert (first["agrees"], first["cannot tell"], first["wrong_disagrees"]) == (9, 1, 6)
    assert (first.held, first.stated, first.wrong_held, first.default) == (7, 10, 8, True)
    assert (summary["bound_low"] <= summary["bound"]).all()


@pytest.mark.parametrize("chart", CHARTS)
def test_texts_of_a_chart_lie_beside_each_other(chart):
    figure = figure_of(CHARTS[chart], {}, {chart: made_up(CHARTS[chart].rows)})
    figure.set_dpi(300)
    FigureCanvasAgg(figure).draw()
    whole = figure.get_window_extent()
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    assert all(whole.x0 <= box.x0 and box.x1 <= whole.x1 for _, box in boxes)
    assert [(a, b) for i, (a, one) in enumerate(boxes) for b, other in boxes[:i] if one.overlaps(other)] == []
    legend = figure.legends[-1].get_window_extent()
    assert [text for text, box in boxes if box.overlaps(legend)] == []


@pytest.mark.parametrize("chart", CHARTS)
def test_a_chart_of_outcomes_says_what_to_take_and_why(chart):
    rows, drawn = made_up(CHARTS[chart].rows), CHARTS[chart].chart
    assert isinstance(drawn, Outcomes)
    said = advice(drawn, rows)
    assert said.startswith(drawn.take + " ")
    default = rows["default"].astype(bool)
    for changed in (
        rows.assign(error=rows["error"].where(~default, 3 * rows["error"])),
        rows.assign(wrong_verdict=rows["wrong_verdict"].where(default, "agrees")),
        rows.assign(holds=False),
    ):
        assert advice(drawn, changed) != said
    assert advice(drawn, rows.assign(short=True)) == drawn.take


def test_a_quick_variant_is_part_of_the_whole():
    for study in CHARTS.values():
        (quick,) = study.parts(Settings(quick=True)).values()
        whole = list(study.parts(Settings()).values())
        assert set(quick["settings"]) < set(whole[0]["settings"])
        assert len({seed for part in whole for seed in part["seeds"]}) == 10


def test_drives_differ_from_seed_to_seed():
    (one, towed), (other, _) = random_tow(1, 40), random_tow(2, 40)
    assert towed.shape == (40, 3)
    assert np.hypot(*(one(1.6) - other(1.6))[:2]) > 0.01


def test_the_checks_give_every_number_that_the_ledger_states(monkeypatch):
    study = CHARTS["ends_rung"]
    monkeypatch.setattr(evidence, "outcome_summary", lambda _: outcome_summary(made_up(study.rows)))
    quiet = replace(study, rows=lambda **_: [])
    found = evidence._ends(quiet)()
    assert found["rung auto, bound, median"] == pytest.approx(3.1)
    assert found["rung auto, wrong model disagrees"] == 6
    assert found["tractrix, CPU over the default's"] > found["dynamics, CPU over the default's"] > 1


def test_planted_faults_turn_what_is_said(monkeypatch):
    """The default's clock counts tenfold, tethers are taken shorter, and settings are not heeded."""
    result = PipelineResult({}, np.zeros((2, 3)), TRUTH["time_s"], None, costs={"track": Cost(1.0, 1.0)})
    heeded = []

    def outcome(pipeline, variant, truth, longer_m):
        heeded.append(variant)
        return "outcome", result

    monkeypatch.setattr(outcomes, "_outcome", outcome)
    first, second = evidence._FAULTS.values()
    other = Variant("a", {"track": {"samples": 256}})
    scene = SimpleNamespace(tether=SimpleNamespace(rest_length=0.6))
    with first():
        assert outcomes._outcome(None, Variant("a"), {}, 0.0)[1].cpu_s == 10
        assert outcomes._outcome(None, other, {}, 0.0)[1].cpu_s == 1
        monkeypatch.setattr(
            end_to_end, "replace", lambda thing, **changed: SimpleNamespace(**{**vars(thing), **changed})
        )
        longer = end_to_end.stated_longer(scene, outcomes.LONGER_M)
        assert longer.tether.rest_length == pytest.approx(0.6)
    del heeded[:]
    with second():
        outcomes._outcome(None, other, {}, 0.0)
    assert heeded == [Variant("a")]


def test_what_was_chosen_does_not_tell_results_apart():
    times = np.arange(40) / 25
    track = measured_track("object", times, np.zeros((40, 3)), np.full(3, 1e-3))
    chosen = replace(track, choices=(Choice("tracking", "1024", "4096", 1e-4, "RMS"),))
    other = replace(track, pose=track.pose + 1e-12)
    one, same, third = (end_to_end._digest({"object": each}) for each in (track, chosen, other))
    assert one == same != third
    assert end_to_end._digest(Thing("a", ("b",))) == end_to_end._digest(Thing("a")) != end_to_end._digest(Thing("b"))


def test_keys_that_are_to_be_chosen_are_told_from_values_of_that_name():
    keys = {"simulate": {"rung": "auto", "tolerance_m": "auto"}, "uncertainty": {"samples": "auto"}}
    assert end_to_end._without_auto(keys, "simulate") == ({"rung": "auto"}, ("tolerance_m",))
    assert end_to_end._without_auto(keys, "uncertainty") == ({"samples": "auto"}, ())
    assert end_to_end._without_auto(keys, "track") == ({}, ())


@pytest.mark.parametrize(
    ("ratio", "bound", "explained"), [(2.0, 0.03, False), (2.0, 0.01, True), (0.5, 0.03, True), (np.nan, 0.03, True)]
)
def test_causes_are_looked_for_only_where_they_can_change_the_verdict(monkeypatch, ratio, bound, explained):
    found = SimpleNamespace(tested_ratio=ratio, error_upper_m=bound, tolerance_m=0.02)
    sampling = SimpleNamespace(sampled=lambda: ("few", 0.0), completed=lambda known: f"{known}, explained")
    monkeypatch.setattr(end_to_end, "UncertaintySampling", lambda *_: sampling)
    compared = []
    end_to_end._verdict_alone(None, None, lambda known: compared.append(known) or found)
    assert compared == (["few", "few, explained"] if explained else ["few"])


def test_what_is_better_or_worse_than_the_default_is_so_beyond_scatter():
    shifts = {"default": 0.0, "alike": 0.1, "better": -2.0, "worse": 2.0}
    table = pd.DataFrame({f"{name}_{end}": 3.0 for name in ("bound", "off") for end in ("low", "high")}, index=shifts)
    table["off_low"], table["off_high"] = (
        3.0 + np.array([*shifts.values()]) - 0.5,
        3.0 + np.array([*shifts.values()]) + 0.5,
    )
    assert outcomes.beyond_scatter(table.assign(default=table.index == "default")) == (["better"], ["worse"])


@pytest.mark.parametrize("chart", CHARTS)
def test_the_page_names_the_default_and_what_nothing_beats(chart):
    rows, drawn = made_up(CHARTS[chart].rows), CHARTS[chart].chart
    view = front_view(chart, drawn, rows, Markup(""))
    default = rows.loc[rows["default"].astype(bool), "setting"].iloc[0]
    assert f"default: {rows['series'].iloc[0]}, {default}." in view.counts
    assert {row[0] for row in view.rows} == {BOUND, OFF}
    assert view.summary.startswith(drawn.take)
