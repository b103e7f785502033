"""The stage plan: the closed loop, its invariance, and plans as files that drive the dynamics again."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib.figure import Figure

from paper_plan import WORKFLOW, paper_plan, quick_plan
from studies.paper.scene import paper_scene
from towval.cli import main
from towval.commands.plan import run, run_tow
from towval.io.mcap_file import read_mcap
from towval.io.plan_files import JOINT_NAMES, read_path, read_tow, write_plan_csv, write_plan_mcap
from towval.io.records import read_simulated
from towval.io.records.details import findings_in
from towval.io.schema import check, packaged_schema
from towval.model import Sliding, TimedPath
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import compose, transform
from towval.physics.quasistatic import quasistatic_plan
from towval.planning import paths
from towval.planning.plan import close_loop, hinge_of_poses, tow
from towval.planning.planner import PlanOutcome
from towval.planning.scene import friction_under, plan_scene, resting_patch

SAMPLE = Path(__file__).parents[2] / "data_samples" / "lab_small"
STEP_S = 0.2


@pytest.fixture(scope="module")
def scene():
    return paper_scene(paper_plan())


@pytest.fixture(scope="module")
def patch(scene):
    return resting_patch(scene)


@pytest.fixture(scope="module")
def wanted(scene):
    return paths.timed(scene.curves["lemniscate"], STEP_S, duration=600.0)


@pytest.fixture(scope="module")
def nominal(scene, patch, wanted):
    return quasistatic_plan(scene.towed, patch, wanted, scene.tether)


@pytest.fixture(scope="module")
def loop(scene, patch, nominal):
    return close_loop(nominal, scene.towed, patch, scene.tether, scene.rover, scene.planner, report_stride=5)


def test_the_object_follows_the_lemniscate_behind_the_planned_rover(loop):
    assert loop.rover.outcome is PlanOutcome.ARRIVED
    assert loop.towed.outcome == "converged"
    assert loop.rover.rms < 0.02
    assert loop.object_rms < 0.01


def test_behind_the_nominal_hinge_the_object_stays_on_its_path(scene, patch, nominal):
    motion = tow(
        nominal.time_s,
        nominal.hinge.position,
        scene.towed,
        patch,
        scene.tether,
        start_pose=nominal.pose[0],
        start_twist=nominal.twist[0],
    )
    gap = np.linalg.norm(motion.pose[:, :2] - nominal.pose[:, :2], axis=1)
    # Inertia at 9 mm/s is all that the quasi-static model leaves out: v²/(μ g) is 24 µm.
    assert gap.max() < 1e-4


def test_a_turned_and_moved_wish_gives_the_turned_and_moved_loop(scene, patch, wanted, loop):
    frame = np.array([2.0, -3.0, 0.7])
    moved_wanted = TimedPath(wanted.time_s, transform(frame, wanted.position))
    moved_nominal = quasistatic_plan(scene.towed, patch, moved_wanted, scene.tether)
    moved = close_loop(moved_nominal, scene.towed, patch, scene.tether, scene.rover, scene.planner, report_stride=5)
    np.testing.assert_allclose(moved.rover.hinge, transform(frame, loop.rover.hinge), atol=1e-6)
    # The integrator's own tolerance: its steps are not the same in another frame.
    expected = compose(frame, loop.towed.pose)
    np.testing.assert_allclose(moved.towed.pose[:, :2], expected[:, :2], atol=1e-5)


def test_a_plan_written_as_mcap_drives_the_same_object_motion(tmp_path, scene, patch, nominal, loop):
    file = tmp_path / "plan.mcap"
    write_plan_mcap(file, loop.rover, loop.towed, {"versions": "{}"})
    times, poses, start = read_tow(file)
    np.testing.assert_allclose(poses, loop.rover.pose, atol=1e-12)
    hinge = hinge_of_poses(poses, scene.rover)
    np.testing.assert_allclose(start, nominal.pose[0], atol=1e-12)
    again = tow(
        times,
        hinge,
        scene.towed,
        patch,
        scene.tether,
        start_pose=nominal.pose[0],
        start_twist=nominal.twist[0],
        stride=5,
    )
    np.testing.assert_allclose(again.pose, loop.towed.pose, atol=1e-8)


def test_the_mcap_holds_wheel_angles_and_rates_by_name(tmp_path, loop):
    file = tmp_path / "plan.mcap"
    write_plan_mcap(file, loop.rover, loop.towed, {})
    content = read_mcap(file)
    assert set(content.topics) == {
        "/rover/pose",
        "/rover/joint_states",
        "/object/pose_simulated",
        "/tether/wrench",
        "/tf",
    }
    state = content.values("/rover/joint_states")[7]
    assert tuple(state.name) == JOINT_NAMES
    np.testing.assert_allclose(state.position[:4], loop.rover.steering[7])
    np.testing.assert_allclose(state.velocity[4:], loop.rover.wheel_rates[7])
    assert content.details["outcome"] == "arrived"
    assert len(content.details["case"]) == len(loop.rover.time_s)


@pytest.mark.parametrize(
    "data", [b"", b"x_m,y_m\n0,here\n", b"x_m,y_m\n\xfc,0\n", b"x_m,y_m\n0,0\n0,0,0,0\n", b"x_m,y_m\n0,0,0\n1,2,0\n"]
)
def test_a_path_file_that_is_no_table_of_numbers_is_refused(tmp_path, data):
    file = tmp_path / "bad.csv"
    file.write_bytes(data)
    with pytest.raises(InputError, match="is no table of numbers"):
        read_path(file)


@pytest.mark.parametrize("text", ["x_m,y_m\n", "x_m,y_m,time_s\n", "x_m,y_m,time_s\n0,0,0\n"])
def test_a_path_file_of_less_than_two_points_is_refused(tmp_path, text):
    file = tmp_path / "short.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=r"rows below the names(.|\n)*2 or more"):
        read_path(file)


@pytest.mark.parametrize(("cell", "got"), [("", "nan"), ("inf", "inf")])
def test_a_point_of_a_path_that_lacks_a_number_is_told_with_its_file(tmp_path, cell, got):
    file = tmp_path / "gap.csv"
    file.write_text(f"x_m,y_m\n0,0\n1,{cell}\n2,1\n")
    with pytest.raises(InputError, match=rf"gap\.csv lacks a number\n  got: point 2: 1, {got}\n"):
        read_path(file)


def test_a_missing_path_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv is missing(.|\n)*columns x_m and y_m"):
        read_path(tmp_path / "none.csv")


@pytest.mark.parametrize("start_s", [0.0, 1.7e9])
def test_a_path_in_seconds_since_1970_is_planned_like_one_from_zero(scene, patch, start_s):
    curve = paths.timed(scene.curves["line"], STEP_S, duration=20.0)
    at_zero = quasistatic_plan(scene.towed, patch, curve, scene.tether)
    later = quasistatic_plan(scene.towed, patch, TimedPath(start_s + curve.time_s, curve.position), scene.tether)
    assert later.time_s[0] == start_s
    np.testing.assert_allclose(later.hinge.position, at_zero.hinge.position, atol=1e-5)  # times are good to 0.2 µs


def test_the_csv_has_a_row_a_step(tmp_path, loop):
    file = tmp_path / "plan.csv"
    write_plan_csv(file, loop.rover, loop.towed)
    table = pd.read_csv(file)
    assert len(table) == len(loop.rover.time_s)
    np.testing.assert_allclose(table["front_left_steering_rad"], loop.rover.steering[:, 0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(table["object_x_m"].to_numpy()[::5][:100], loop.towed.pose[:100, 0], atol=1e-9)
    assert set(table["case"]) <= {"A", "B", "C"}


def test_a_path_from_a_file_is_planned_like_any_other(tmp_path, scene, patch):
    angle = np.linspace(0, np.pi, 40)
    file = tmp_path / "arc.csv"
    pd.DataFrame({"x_m": 1.5 * np.sin(angle), "y_m": 1.5 - 1.5 * np.cos(angle)}).to_csv(file, index=False)
    wanted = paths.timed(paths.through_points(read_path(file)), STEP_S, mean_speed=0.01)
    nominal = quasistatic_plan(scene.towed, patch, wanted, scene.tether)
    loop = close_loop(nominal, scene.towed, patch, scene.tether, scene.rover, scene.planner, report_stride=5)
    assert loop.rover.outcome is PlanOutcome.ARRIVED
    assert loop.object_rms < 0.01


def test_a_timed_path_from_a_file_keeps_its_times(tmp_path):
    file = tmp_path / "timed.csv"
    pd.DataFrame({"time_s": [0.0, 1.0, 3.0], "x_m": [0.0, 1.0, 2.0], "y_m": 0.0}).to_csv(file, index=False)
    assert read_path(file).time_s.tolist() == [0.0, 1.0, 3.0]


@pytest.mark.parametrize("name", ["t_s", "Time", "Time_s", " time_s", "t [ms]", "stamp_ns"])
def test_times_of_another_name_are_not_passed_over(tmp_path, name):
    """The path was planned as if it had none, at the duration of the scene."""
    file = tmp_path / "timed.csv"
    pd.DataFrame({name: [0.0, 1.0, 3.0], "x_m": [0.0, 1.0, 2.0], "y_m": 0.0}).to_csv(file, index=False)
    with pytest.raises(InputError, match=rf"column {re.escape(name)}(.|\n)*name the column time_s"):
        read_path(file)


@pytest.mark.parametrize("text", ["x,y\n0,0\n1,0\n", "x_m,y_m,x_m\n0,0,5\n1,0,6\n"])
def test_a_path_file_without_its_columns_or_with_one_twice_is_refused(tmp_path, text):
    """Of two columns of one name the first was taken."""
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(InputError, match="no path"):
        read_path(file)


def test_the_commands_plan_a_curve_and_tow_behind_the_recorded_rover(tmp_path):
    plan, towed = tmp_path / "line.mcap", tmp_path / "towed.mcap"
    planned = run(quick_plan(), "line", plan, tmp_path / "line.csv")
    assert planned.files == (plan, tmp_path / "line.csv")
    # How long the plan lasts: the rover ends within its tolerance of the end, before the path's own time is over.
    duration_s = np.ptp(pd.read_csv(tmp_path / "line.csv").time_s)
    assert planned.numbers["duration_s"] == pytest.approx(duration_s)
    assert planned.text.startswith(
        f"arrived after {duration_s:.1f} s, path of 1.40 m; the object deviates from its path"
    )
    assert run_tow(quick_plan(), plan, towed).numbers["path_length_m"] == pytest.approx(_path_length(towed))
    assert read_simulated(towed).time_s == pytest.approx(read_tow(plan)[0])  # every pose drives the tether
    # The recording starts the object at rest, the plan at the nominal velocity: the tether soon makes them one.
    gap = read_simulated(towed).pose[-1] - _last_object_pose(tmp_path / "line.csv")
    assert np.abs(gap[:2]).max() < 1e-4


def test_the_file_of_a_plan_says_what_the_command_says_of_it(tmp_path):
    """It held no finding at all, and who drives by it read none."""
    scene = quick_plan()
    scene["planner"]["look_ahead_steps"] = 10**6
    planned = run(scene, "line", tmp_path / "line.mcap", tmp_path / "line.csv")
    assert "look_ahead_exceeds_path" in {found.code for found in planned.findings}
    assert findings_in(read_mcap(tmp_path / "line.mcap").details["findings"]) == planned.findings


def test_a_path_shorter_than_two_steps_of_the_planner_is_refused(tmp_path):
    """As one whose times are in minutes; what followed from it was refused in words of the simulation."""
    file = tmp_path / "path.csv"
    pd.DataFrame({"x_m": [0.0, 0.5, 1.0], "y_m": 0.0, "time_s": [0.0, 0.01, 0.02]}).to_csv(file, index=False)
    with pytest.raises(InputError, match=r"too short in time for the planner\n.*0\.02 s\n.*2 to 200000 steps of"):
        run(quick_plan(), str(file), tmp_path / "p.mcap", tmp_path / "p.csv")


def test_a_path_that_takes_too_many_steps_of_the_planner_is_refused(tmp_path):
    """Its times are in milliseconds: it was planned for minutes and gigabytes."""
    file = tmp_path / "path.csv"
    pd.DataFrame({"x_m": [0.0, 0.5, 1.0], "y_m": 0.0, "time_s": [0.0, 1e5, 2e5]}).to_csv(file, index=False)
    with pytest.raises(InputError, match=r"too long for the planner\n.*0 s\n.*200000 steps of(.|\n)*in seconds"):
        run(quick_plan(), str(file), tmp_path / "p.mcap", tmp_path / "p.csv")


def test_a_scene_of_too_many_steps_is_refused_before_there_are_as_many_points(tmp_path):
    """A duration in milliseconds or more had filled the memory."""
    scene = quick_plan()
    scene["quasi_static"]["duration_s"] = 1e12
    with pytest.raises(InputError, match=r"takes too long for the planner(.|\n)*quasi_static\.duration_s"):
        run(scene, "line", tmp_path / "p.mcap", tmp_path / "p.csv")


def test_a_path_of_a_tenth_of_a_millimetre_is_refused(tmp_path):
    """The rover had circled for minutes, and its plan had filled the memory."""
    file = tmp_path / "path.csv"
    pd.DataFrame({"x_m": [0.0, 1e-4], "y_m": 0.0}).to_csv(file, index=False)
    with pytest.raises(InputError, match=r"too short to be planned(.|\n)*0\.0001\d* m(.|\n)*in metres"):
        run(quick_plan(), str(file), tmp_path / "p.mcap", tmp_path / "p.csv")


def test_a_path_that_all_but_turns_back_on_itself_is_planned_to_an_end(tmp_path):
    """Panels had shrunk at its turn until they advanced by rounding alone, without an end."""
    file = tmp_path / "zigzag.csv"
    x, y = [0.2242, 0.5577, 0.2799, 0.4547, 0.2199], [0.0581, -0.0035, 0.1717, 0.1073, 0.176]
    pd.DataFrame({"x_m": x, "y_m": y}).to_csv(file, index=False)
    with pytest.raises(RefusedError, match="the rover does not arrive"):
        run(quick_plan(), str(file), tmp_path / "p.mcap", tmp_path / "p.csv")


@pytest.mark.parametrize("name", ["my lab", "my lab/campaign.yaml"])
def test_a_campaign_in_place_of_the_scene_is_told(tmp_path, name):
    """Its folder was no plain file, and its campaign.yaml had thirty faults."""
    (tmp_path / "my lab").mkdir()
    (tmp_path / "my lab" / "campaign.yaml").touch()
    with pytest.raises(InputError, match=r"scene is a campaign(.|\n)*: paper --campaign '.*my lab'$"):
        run(tmp_path / name, "line", tmp_path / "plan.mcap", tmp_path / "plan.csv")
    assert not (tmp_path / "plan.mcap").exists()


def test_a_folder_called_paper_is_no_scene(tmp_path, monkeypatch):
    """That of somebody who writes one: the scene of the package could not be used from there."""
    (tmp_path / "paper").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="unknown path nowhere"):
        run(Path("paper"), "nowhere", tmp_path / "plan.mcap", tmp_path / "plan.csv")


def test_a_map_shows_the_wanted_path_and_whose_each_bend_is(tmp_path):
    plan, drawn, towed = (tmp_path / name for name in ("p.mcap", "plan.svg", "tow.svg"))
    planned = run(quick_plan(), "lemniscate", plan, tmp_path / "p.csv", map_file=drawn)
    assert 0.02 < planned.numbers["limited_share"] < 0.5  # two bends are tighter than the rover's tightest turn
    for _ in range(2):  # over the map of the first call
        run_tow(quick_plan(), plan, tmp_path / "t.mcap", map_file=towed)
    texts = [set(re.findall(r"<!-- (.*?) -->", file.read_text())) for file in (drawn, towed)]
    assert {"object, desired", "bend due to the rover's limit"} <= texts[0]
    assert not {"object, desired", "bend due to the rover's limit"} & texts[1]


def test_a_path_of_few_points_with_times_is_as_long_and_drawn_as_it_is_planned(tmp_path, monkeypatch):
    """The map drew chords, which the object left by 15 cm, and the length was theirs."""
    angle, drawn = np.linspace(0, np.pi, 5), []
    columns = {"x_m": 2 * np.cos(angle), "y_m": 2 * np.sin(angle), "time_s": np.linspace(0, 120, 5)}
    pd.DataFrame(columns).to_csv(tmp_path / "half.csv", index=False)
    monkeypatch.setattr("towval.report.figures.plan.plan_figure", lambda *given: drawn.append(given[3]) or Figure())
    plan, table, drawing = (tmp_path / name for name in ("p.mcap", "p.csv", "p.svg"))
    planned = run(quick_plan(), str(tmp_path / "half.csv"), plan, table, map_file=drawing)
    assert planned.numbers["path_length_m"] == pytest.approx(2 * np.pi, rel=5e-3)  # chords: 2.6 % less
    assert np.hypot(*drawn[0].T) == pytest.approx(2, abs=0.02)


def test_a_map_replaces_only_a_map(tmp_path):
    mine = tmp_path / "drawing.svg"
    Figure().savefig(mine)  # by the library that draws the maps, too
    before = mine.read_bytes()
    folder = tmp_path / "folder.svg"
    folder.mkdir()
    for name in (mine, folder, tmp_path / "map.pdf"):
        with pytest.raises(InputError, match=re.escape(name.name)):
            run(quick_plan(), "line", tmp_path / "p.mcap", tmp_path / "p.csv", map_file=name)
    assert mine.read_bytes() == before
    assert {each.name for each in tmp_path.iterdir()} == {"drawing.svg", "folder.svg"}  # and no plan without its map


def _path_length(file):
    return float(np.hypot(*np.diff(read_simulated(file).pose[:, :2], axis=0).T).sum())


def _last_object_pose(file):
    return pd.read_csv(file)[["object_x_m", "object_y_m", "object_heading_rad"]].to_numpy()[-1]


def test_an_unknown_curve_is_refused_with_those_that_are_known(tmp_path):
    with pytest.raises(InputError, match="lemniscate"):
        run(quick_plan(), "spiral", tmp_path / "a.mcap", tmp_path / "a.csv")


def test_the_command_line_plans_for_the_object_of_a_campaign(tmp_path, capsys):
    scene, lab = str(WORKFLOW / "plan.yaml"), str(SAMPLE)
    plan, table, towed = (str(tmp_path / name) for name in ("plan.mcap", "plan.csv", "towed.mcap"))
    # By the name that also works after pip install, where nobody knows the path of the scene.
    main(["plan", "paper", "--path", "circle", "--campaign", lab, "-o", plan, "--csv", table])
    assert " s, path of 6.28 m; the object deviates" in capsys.readouterr().out
    force = pd.read_csv(table)[["tether_force_x_n", "tether_force_y_n"]].to_numpy()
    # The sample's object weighs 5.8 kg with its load, and its friction goes from 0.396 down to 0.35 with the speed; the
    # cube of the scene would take 17.2 N.
    assert 0.35 < np.linalg.norm(force[-1]) / (5.8 * 9.81) < 0.396
    main(["tow", scene, plan, "--campaign", lab, "-o", towed])
    # Started at rest instead of moving, the object sticks and slips in another phase: less than one slip between them.
    assert np.abs(read_simulated(Path(towed)).pose[-1] - _last_object_pose(table))[:2].max() < 0.01


def test_a_plan_knows_heights_and_slope_of_a_campaign(tmp_path):
    """Along the line, uphill all the way: T cos = μ (N − T sin) + m g s, to what μ(v) at that speed leaves."""
    lab = tmp_path / "lab"
    shutil.copytree(SAMPLE, lab)
    document = yaml.safe_load((lab / "campaign.yaml").read_text())
    pulls = []
    for slope, rise in ((0.0, 0.0), (0.02, 0.2)):
        document["floor"]["slope_mm_per_m"] = [float(1e3 * slope / np.sqrt(2))] * 2
        document["rover"]["tether_hinge_height_m"] = rise
        (lab / "campaign.yaml").write_text(yaml.safe_dump(document))
        files = ["-o", str(tmp_path / "plan.mcap"), "--csv", str(tmp_path / "plan.csv")]
        main(["plan", str(WORKFLOW / "plan.yaml"), "--path", "line", "--campaign", str(lab), *files])
        force = pd.read_csv(tmp_path / "plan.csv")[["tether_force_x_n", "tether_force_y_n"]].to_numpy()
        pulls.append(np.linalg.norm(force[-1]))
    weight = 5.8 * 9.81
    mu, tangent = pulls[0] / weight, 0.2 / np.sqrt((0.6 + pulls[0] / 800) ** 2 - 0.2**2)
    assert pulls[1] == pytest.approx(weight * (mu + 0.02) / (1 + mu * tangent), rel=0.02)
    assert abs(pulls[1] / pulls[0] - 1) > 0.04


def test_a_scene_has_keys_for_what_leaves_the_plane():
    document = quick_plan()
    document["cube"] |= {"anchor_height_m": 0.1, "centre_of_mass_height_m": 0.2}
    document["rover"] |= {"hinge_height_m": 0.15}
    document |= {"slope_mm_per_m": [1.0, -2.0], "tether": document["tether"] | {"mass_kg_per_m": 0.01}}
    check(document, packaged_schema("plan.schema.yaml"), "plan.yaml")
    scene = plan_scene(document)
    assert (scene.towed.anchor_height, scene.towed.centre_of_mass_height, scene.hinge_height) == (0.1, 0.2, 0.15)
    assert scene.ground.slope.tolist() == [0.001, -0.002]
    assert scene.tether.mass_per_length == 0.01
    assert isinstance(friction_under(scene), Sliding)


def test_a_plan_with_which_the_rover_does_not_arrive_is_refused_and_not_written(tmp_path, capsys):
    cusp = tmp_path / "cusp.csv"
    cusp.write_text("x_m,y_m,time_s\n0,0,0\n2,0,100\n0,0.2,200\n")
    made = [tmp_path / "plan.mcap", tmp_path / "plan.csv"]
    arguments = ["plan", WORKFLOW / "plan.yaml", "--path", cusp, "-o", made[0], "--csv", made[1]]
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert ended.value.code == 1
    assert "the rover does not arrive" in capsys.readouterr().err
    assert not any(file.exists() for file in made)


@pytest.mark.parametrize(
    ("stated", "slip", "told"),
    [
        ("wheelbase_m:", "wheel_base_m:", "unknown key rover.wheel_base_m; did you mean wheelbase_m?"),
        ("outward_deg:", "outward_deg: 1e-9 #", "rover.outward_deg is 1e-09; allowed: at least 1 and below 90"),
    ],
)
def test_a_scene_with_a_slip_is_refused_by_its_key(tmp_path, capsys, stated, slip, told):
    scene = tmp_path / "scene.yaml"
    scene.write_text((WORKFLOW / "plan.yaml").read_text().replace(stated, slip))
    with pytest.raises(SystemExit):
        main(["plan", str(scene), "--path", "line", "-o", str(tmp_path / "a.mcap"), "--csv", str(tmp_path / "a.csv")])
    assert told in capsys.readouterr().err


def test_a_plan_of_one_pose_cannot_tow(scene, patch, nominal):
    with pytest.raises(InputError, match="without moving"):
        tow(np.zeros(1), np.zeros((1, 2)), scene.towed, patch, scene.tether, start_pose=nominal.pose[0])


@pytest.mark.parametrize("stride", [0, 2.5, True])
def test_a_stride_that_is_no_count_is_refused(scene, patch, stride):
    with pytest.raises(InputError, match="stride of a tow"):
        tow([0.0, 1.0], np.zeros((2, 2)), scene.towed, patch, scene.tether, start_pose=(0, 0, 0), stride=stride)


@pytest.mark.parametrize("times", [[0.0, 1.0], [0.0, 1.0, 2.0, 3.0]])
def test_times_and_points_of_a_tow_must_be_as_many(scene, patch, times):
    with pytest.raises(InputError, match="shape"):
        tow(times, np.zeros((3, 2)), scene.towed, patch, scene.tether, start_pose=(0, 0, 0))


def test_names_of_files_are_checked_before_anything_is_planned_and_written(tmp_path):
    mine, plan = tmp_path / "mine.csv", tmp_path / "plan.mcap"
    mine.write_text("x_m,y_m\n0,0\n1,0\n2,1\n")
    for table, map_file in ((mine, None), (plan, None), (tmp_path / "new.svg", tmp_path / "new.svg")):
        with pytest.raises(InputError, match=table.name):
            run(quick_plan(), "line", plan, table, map_file=map_file)
    assert [each.name for each in tmp_path.iterdir()] == ["mine.csv"]
