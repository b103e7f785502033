"""The paper's studies in small: parts and rows, figures drawn from them, the ledger decided on them."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from scipy.integrate import solve_ivp

from paper_plan import paper_plan, quick_plan
from studies.compute import gather, run_part
from studies.draw import draw_chart, figure_of
from studies.evidence.compute import shared_folder
from studies.frame import Settings, loaded
from studies.paper import law_shapes, meshes, model_checks
from studies.paper.claims import CLAIMS
from studies.paper.claims_page import markdown, write_ledger
from studies.paper.closed_loop import surface_grid
from studies.paper.conclusions import conclude, conclusion
from studies.paper.controls import CONTROLS, OPPOSITES, control_rows
from studies.paper.finite_volumes import meshed_patch
from studies.paper.ledger import ClaimOutcome, decided
from studies.paper.scene import paper_scene
from studies.paper.variants import Variant, variant_rows
from studies.registry import FIGURES, PAPER
from towval.model import TimedPath
from towval.model.errors import InputError, RefusedError
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import fitted_law
from towval.planning.scene import object_with_load


@pytest.fixture(scope="module")
def plan():
    return quick_plan()


@pytest.fixture(scope="module")
def tables(plan, tmp_path_factory):
    """Tables of all studies, made as the workflow makes them."""
    folder = tmp_path_factory.mktemp("tables")
    files = {}
    for study, reference in PAPER.items():
        if study in ("controls", "variants"):
            continue  # They compute the other studies again, tests of their own follow.
        written = []
        for name, part in loaded(reference).parts(Settings(plan=plan)).items():
            written.append(folder / f"{study}_{name}.csv")
            run_part(reference, part, written[-1])
        files[study] = folder / f"{study}.csv"
        gather(written, files[study])
    return files


def read(tables):
    return {name: pd.read_csv(file) for name, file in tables.items()}


def test_parts_are_plain_data_and_blocks_cover_the_response_surface():
    plan = paper_plan()
    parts = {study: loaded(reference).parts(Settings(plan=plan)) for study, reference in PAPER.items()}
    assert json.loads(json.dumps(parts)) == parts
    blocks = [part for part in parts["surface"].values() if part["curve"] == "lemniscate"]
    assert len(blocks) == plan["sensitivity"]["surface_blocks"]
    covered = np.concatenate([block["thresholds"] for block in blocks])
    np.testing.assert_allclose(covered, np.linspace(0.02, 1.5, 40))


def test_a_longer_sweep_leaves_the_parts_of_a_shorter_one_as_they_are():
    """Else the workflow would compute them again."""
    plan = paper_plan()
    before = loaded(PAPER["time_steps"]).parts(Settings(plan=plan))
    plan["sensitivity"]["time_steps_s"] = [*plan["sensitivity"]["time_steps_s"], 1.0]
    after = loaded(PAPER["time_steps"]).parts(Settings(plan=plan))
    assert len(after) == len(before) + 1
    assert before.items() <= after.items()


def test_the_general_footprint_holds_the_three_centres_of_mass():
    scene = paper_scene(paper_plan())
    for towed in scene.general.values():
        assert np.isfinite(towed.inertia)
        assert (towed.patch.outline.max(axis=0) >= towed.centre_of_mass).all()


def test_inertia_is_that_of_the_plate_with_steiners_term():
    square = 0.2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    towed = object_with_load(square, 5.0, [0.03, 0.04], [0.2, 0.0])
    assert towed.inertia == pytest.approx(5.0 * (0.4**2 / 6 + 0.05**2))


def test_every_figure_of_the_paper_is_registered():
    assert set(FIGURES) == {*(f"figure_{number}" for number in range(2, 9)), "table_1"}


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_has_content_and_labels_within_its_page(name, plan, tables):
    drawing = loaded(FIGURES[name])
    figure = figure_of(drawing, plan, {study: pd.read_csv(tables[study]) for study in drawing.tables})
    figure.draw_without_rendering()
    page = figure.bbox
    for axes in figure.findobj(Axes):
        assert axes.has_data() or axes.patches or axes.texts
        for text in (axes.xaxis.label, axes.yaxis.label, axes.title):
            box = text.get_window_extent()
            assert not text.get_text() or (box.x0 >= page.x0 - 1 and box.x1 <= page.x1 + 1), text.get_text()


def test_panels_that_share_a_scale_show_all_points(plan, tables):
    """In Fig. 6 the errors over the time step are below those over the speed."""
    drawing = loaded(FIGURES["figure_6"])
    figure = figure_of(drawing, plan, {study: pd.read_csv(tables[study]) for study in drawing.tables})
    for axes in figure.subfigs[0].axes[:3]:
        low, high = axes.get_ylim()
        assert all(low <= value <= high for line in axes.lines for value in line.get_ydata())


def test_the_time_of_a_mesh_does_not_depend_on_how_many_of_its_steps_are_timed(plan, monkeypatch):
    """What is done once for a mesh would count for as many times as the timed steps are scaled by."""
    scene = paper_scene(Settings(plan=plan).scene)
    seconds = []
    for budget in (3e5, 2e7):
        monkeypatch.setattr(meshes, "CELL_BUDGET", budget)
        (row,) = meshes.mesh_rows(scene, 0.0075)
        seconds.append(row["seconds"])
    assert seconds[0] == pytest.approx(seconds[1], rel=0.6)


def test_a_figure_is_saved_in_three_formats(plan, tables, tmp_path):
    draw_chart("table_1", FIGURES["table_1"], plan, {"meshes": tables["meshes"]}, tmp_path)
    assert {file.suffix for file in tmp_path.iterdir()} == {".pdf", ".svg", ".png"}


def test_a_figure_of_the_paper_says_which_claims_its_tables_bear_out(plan, tables):
    drawing = loaded(FIGURES["figure_5"])
    read = {study: pd.read_csv(tables[study]) for study in drawing.tables}
    reproduced, *_, where = conclusion("figure_5", read)
    assert reproduced.startswith("Reproduced: ")
    assert "planner stays in case A" in reproduced
    assert "settings of Fig. 5" not in reproduced, "it is decided on another table as well"
    assert "docs/claims.md" in where
    assert "no claim" in conclusion("figure_3", {})[0]
    figure = figure_of(drawing, plan, read)
    height = figure.get_size_inches()[1]
    conclude(figure, ["one", "two"])
    figure.draw_without_rendering()
    (said,) = figure.texts
    lowest = said.get_window_extent().y0
    assert figure.get_size_inches()[1] > height
    assert all(axes.title.get_window_extent().y1 < lowest for axes in figure.axes)
    assert all(axes.get_window_extent().y1 < lowest for axes in figure.axes)


def turned_controls(rows):
    """A table of controls in which each decided claim has one that turns it."""
    other = {"reproduced": "not reproduced", "not reproduced": "reproduced"}
    return pd.DataFrame(
        [
            {"claim": row["name"], "fault": "a fault", "place": "in the program", "outcome": other[row["outcome"]]}
            | {"numbers": "n", "machine": "a", "versions": "b"}
            for row in rows
            if row["outcome"] in other
        ]
    )


def test_the_ledger_decides_every_claim_as_text_and_as_data(plan, tables, tmp_path):
    outputs = [tmp_path / "claims.md", tmp_path / "claims.json"]
    controls = tmp_path / "controls.csv"
    turned_controls(decided(CLAIMS, read(tables))).to_csv(controls, index=False)
    write_ledger(plan, {**tables, "controls": controls}, outputs)
    found = json.loads(outputs[1].read_text())
    rows, text = found["claims"], outputs[0].read_text()
    assert len({row["name"] for row in rows}) == len(CLAIMS) == len(rows)
    for row in rows:
        assert row["outcome"] in set(ClaimOutcome)
        assert row["numbers"] in text
    assert markdown(rows, found["made"]) == text
    assert found["made"]["machine"] in text


def test_a_ledger_with_a_claim_whose_control_turns_nothing_is_refused(plan, tables, tmp_path):
    controls = turned_controls(decided(CLAIMS, read(tables)))
    controls.loc[controls["claim"] == "contact converges", "outcome"] = "reproduced"
    controls.to_csv(tmp_path / "controls.csv", index=False)
    with pytest.raises(RefusedError, match="contact converges"):
        write_ledger(plan, {**tables, "controls": tmp_path / "controls.csv"}, [tmp_path / "claims.md"])
    assert not (tmp_path / "claims.md").exists()


def test_quotation_marks_hold_the_words_of_the_paper():
    """Paraphrases have none. The paper's text is not part of the repository: where it is at hand, it is looked up."""
    paper = shared_folder() / "paper" / "towing-an-object-with-a-rover.txt"
    for claim in CLAIMS:
        assert claim.statement.count("“") == claim.statement.count("”")
    if not paper.exists():
        pytest.skip("the paper's text is not at hand")
    words = plain(paper.read_text(encoding="utf-8"))
    quoted = [part for claim in CLAIMS for part in re.findall("“(.*?)”", claim.statement)]
    pieces = [piece.strip(" .,") for part in quoted for piece in part.split("[…]")]
    assert [piece for piece in pieces if plain(piece) not in words] == []


def plain(text):
    """Letters and digits alone, for the text at hand has lost its mathematics."""
    return re.sub(r"[\W_]+", "", text).casefold()


def test_claims_that_depend_on_the_stretch_of_the_tether_are_decided_for_both_readings(tables):
    rows = {row["name"]: row["outcome"] for row in decided(CLAIMS, read(tables))}
    assert rows["stiffer is closer, hinge at rest length"] == "reproduced"
    assert rows["stiffer is closer, hinge at stretched length"] == "not reproduced"
    assert rows["time step does not matter"] == "reproduced"
    assert rows["feedforward falls with speed"] == "reproduced"
    assert rows["experiments agree with simulation"] == "cannot be decided"


def test_the_equation_of_motion_of_the_law_shapes_is_that_of_the_package(plan):
    """With the smooth law, which both take."""
    scene, speed, times = paper_scene(plan), 0.05, np.linspace(0, 0.2, 5)
    smooth = law_shapes.laws(scene)["smooth"]
    own = solve_ivp(law_shapes.equation_of_motion(scene, smooth, speed), times[[0, -1]], np.zeros(6), "Radau", times,
                    rtol=1e-9, atol=1e-12)  # fmt: skip
    heading = own.y[2]
    back = -scene.towed.centre_of_mass
    # Its state is about the centre of mass, that of the package about the body frame.
    turned = np.column_stack([np.cos(heading), -np.sin(heading), np.sin(heading), np.cos(heading)]).reshape(-1, 2, 2)
    place = own.y[:2].T + turned @ back - back
    hinge = scene.towed.anchor + np.outer(scene.tether.rest_length + speed * times, [1.0, 0.0])
    law = fitted_law(scene.friction).law
    patch = meshed_patch(law_shapes.cube_pressure(scene), law)
    motion = feedback(scene.towed, patch, scene.tether, TimedPath(times, hinge), np.zeros(3), times)
    assert np.ptp(place[:, 0]) > 5e-3
    assert heading[-1] > 0.02
    np.testing.assert_allclose(motion.pose[:, :2], place, atol=2e-6)
    np.testing.assert_allclose(motion.pose[:, 2], heading, atol=2e-5)


def test_a_check_fails_where_the_numbers_contradict_the_claim(tables):
    reversed_speeds = read(tables)
    speeds = reversed_speeds["speeds"]
    speeds["feedforward_rms_m"] = speeds["feedforward_rms_m"].to_numpy()[::-1]
    assert model_checks.feedforward_falls(reversed_speeds)[0] is ClaimOutcome.NOT_REPRODUCED


@pytest.mark.parametrize("control", CONTROLS, ids=lambda control: control.claim)
def test_a_planted_fault_makes_the_check_of_its_claim_fail(control):
    plan = quick_plan()
    plan["sensitivity"]["thresholds_m"] = [0.02, 0.103, 0.2, 0.227, 0.6]
    rows = control_rows(plan, control.claim, control.fault)
    assert rows[0]["outcome"] == "not reproduced"


@pytest.mark.parametrize("control", OPPOSITES, ids=lambda control: control.claim)
def test_a_claim_that_is_not_reproduced_would_be_with_the_opposite_change(control):
    plan = quick_plan()
    surface = {"surface_thresholds_m": [0.1, 1.2, 4], "surface_look_aheads_steps": [0, 350, 2]}
    if control.fault.startswith("six thresholds and seven look-aheads"):
        surface = {"surface_thresholds_m": [0.1, 1.5, 6], "surface_look_aheads_steps": [0, 600, 7]}
    plan["sensitivity"] |= {"thresholds_m": [0.02, 0.103, 0.2, 0.227, 0.6]} | surface
    rows = control_rows(plan, control.claim, control.fault)
    assert rows[0]["outcome"] == "reproduced"


def test_every_claim_that_can_be_decided_has_a_control(tables):
    outcomes = {row["name"]: row["outcome"] for row in decided(CLAIMS, read(tables))}
    decidable = {name for name, outcome in outcomes.items() if outcome != "cannot be decided"}
    assert decidable == {control.claim for control in (*CONTROLS, *OPPOSITES)}


def test_what_a_control_gives_in_the_ledger_is_not_what_the_claim_is(repository):
    """A control with the outcome of the claim itself shows nothing of its check."""
    found = json.loads((repository / "docs" / "claims.json").read_text(encoding="utf-8"))["claims"]
    alike = [
        row["name"]
        for row in found
        if row["control"] and re.search(r": ((not )?reproduced) \(", row["control"])[1] == row["outcome"]
    ]
    assert alike == []


def test_other_settings_decide_the_claims_again():
    variant = Variant("κ = 1000 N/m", ("tether", "stiffness_n_m"), 1e3, ("starts",))
    plan = quick_plan()
    plan["tether"]["stiffness_n_m"] = variant.value
    rows = variant_rows(plan, variant.name, list(variant.studies))
    assert [row["claim"] for row in rows] == [claim.name for claim in CLAIMS if "from rest" in claim.name]


def test_the_ledger_shows_controls_and_other_settings(tables):
    given = read(tables)
    claim = "feedforward falls with speed"
    given["controls"] = pd.DataFrame(
        [{"claim": claim, "fault": "a fault", "place": "in the program", "outcome": "not reproduced", "numbers": "n"}]
    )
    given["variants"] = pd.DataFrame(
        [
            {"claim": claim, "setting": f"κ = {k}", "outcome": outcome}
            for k, outcome in ((1, "reproduced"), (2, "not reproduced"))
        ]
    )
    text = markdown(decided(CLAIMS, given), dict.fromkeys(("date", "commit", "machine", "versions"), ""))
    assert "- Control: a fault, in the program: not reproduced (n)" in text
    assert "- Other settings: the same with κ = 1; otherwise with κ = 2" in text


def test_an_empty_axis_of_the_surface_is_refused():
    with pytest.raises(InputError, match="axis"):
        surface_grid(1.0, 0.5, 10)
