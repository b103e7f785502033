"""campaign.yaml: what is read, and one clear message for each way of getting it wrong."""

import copy
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

from towval.io.campaign import campaign_schema, load_campaign
from towval.model import Load
from towval.model.errors import InputError
from towval.physics.mass import towed_object


@pytest.fixture
def campaign(tmp_path, lab_small):
    """A function that writes a changed campaign beside the sample's files and returns its folder."""
    document = yaml.safe_load((lab_small / "campaign.yaml").read_text())

    def changed(change):
        folder = tmp_path / "lab"
        folder.mkdir(exist_ok=True)
        if not (folder / "calibration").exists():
            (folder / "calibration").symlink_to(lab_small / "calibration")
            for run in "ab":
                (folder / f"{run}.mp4").symlink_to(lab_small / f"{run}.mp4")
        new = copy.deepcopy(document)
        change(new)
        (folder / "campaign.yaml").write_text(yaml.safe_dump(new))
        return folder

    return changed


def test_sample_is_read_as_written(lab_small):
    campaign = load_campaign(lab_small)
    assert campaign.name == "lab_small"
    assert campaign.resolution_px == (960, 540)
    assert len(campaign.calibration_images) == 20
    assert [path.name for path in campaign.floor_images] == ["floor.jpg"] + [f"floor_{i}.jpg" for i in range(6)]
    assert campaign.scene.body_mass == 4.0
    np.testing.assert_allclose(campaign.object.obstructions[0][0], [-0.23, 0.06])
    assert campaign.runs["b"].clicks_px["rover"].shape == (4, 2)


def test_the_floor_image_is_not_counted_twice(campaign):
    folder = campaign(lambda d: d["floor"].update(more_images="calibration/floor*.jpg"))
    assert len(load_campaign(folder).floor_images) == 7


def feet(side=0.04):
    """Four feet of the sample's object, as rings."""
    square = side / 2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    return [(square + np.array([0.215, 0.14]) * corner).round(6).tolist() for corner in corners]


def test_feet_carry_a_mass_that_is_spread_over_the_top(campaign):
    """Unless said otherwise; four feet are nearer to the rim than the mass."""
    scene = load_campaign(campaign(lambda d: d["object"].update(footprint_m=feet()))).scene
    assert len(scene.patch.outlines) == 4
    assert scene.spread.gyration**2 == pytest.approx((0.5**2 + 0.35**2) / 12, rel=1e-12)
    stated = load_campaign(campaign(lambda d: d["object"].update(footprint_m=feet(), mass_over="footprint"))).scene
    about_a_foot = (0.04**2 + 0.04**2) / 12
    inertia = towed_object(replace(stated, load=Load(0.0, (0.0, 0.0), (0.0, 0.0, 0.0)))).inertia
    assert inertia == pytest.approx(4.0 * (0.215**2 + 0.14**2 + about_a_foot), rel=1e-12)


def test_one_ring_is_the_same_as_a_list_of_it(campaign):
    ring = [[-0.25, -0.175], [0.25, -0.175], [0.25, 0.175], [-0.25, 0.175]]
    listed = load_campaign(campaign(lambda d: d["object"].update(footprint_m=[ring]))).scene
    plain = load_campaign(campaign(lambda d: None)).scene
    assert towed_object(listed).inertia == towed_object(plain).inertia
    assert (listed.patch.outline == plain.patch.outline).all()


def test_measured_mass_properties_are_those_of_the_object_without_its_load(campaign):
    change = {"centre_of_mass_m": [0.01, -0.02], "moment_of_inertia_kg_m2": 0.2}
    scene = load_campaign(campaign(lambda d: d["object"].update(change))).scene
    towed = towed_object(replace(scene, load=Load(0.0, (0.0, 0.0), (0.0, 0.0, 0.0))))
    assert towed.centre_of_mass == pytest.approx([0.01, -0.02])
    assert towed.inertia == pytest.approx(0.2, rel=1e-12)


def test_static_below_kinetic_within_their_deviations_means_no_peak(campaign):
    friction = load_campaign(campaign(lambda d: d["friction"].update(static=0.345))).scene.friction
    assert friction.static == friction.kinetic == 0.35


def test_gravity_is_that_of_the_file(campaign):
    assert load_campaign(campaign(lambda d: d.update(gravity_m_per_s2=1.62))).scene.ground.gravity == 1.62
    assert load_campaign(campaign(lambda d: None)).scene.ground.gravity == 9.81


def test_deviations_stand_for_what_is_left_out(campaign):
    """Damping: by itself, with a value, with a deviation alone, with both."""
    cases = {(): 0.05 * 2 * np.sqrt(800 * 5.8), (12.5,): 2.5, (None, 1.0): 1.0, (12.5, 2.4): 2.4}
    for stated, expected in cases.items():

        def change(document, stated=stated):
            document["tether"].pop("damping_Ns_per_m", None)
            keys = zip(("damping_Ns_per_m", "damping_std_Ns_per_m"), stated, strict=False)
            document["tether"].update({key: value for key, value in keys if value is not None})

        assert load_campaign(campaign(change)).deviations["damping"] == pytest.approx(expected), stated


WRONG = {
    "mistyped key": (
        lambda d: d["tether"].update(rest_lenght_m=1),
        ["tether.rest_lenght_m", "did you mean rest_length_m"],
    ),
    "missing key": (lambda d: d["object"].pop("mass_kg"), ["object.mass_kg is missing", "kg"]),
    "wrong unit": (
        lambda d: d["rover"].update(tracked_plane_height_m=42),
        ["rover.tracked_plane_height_m", "42", "at most 3"],
    ),
    "negative tether": (lambda d: d["tether"].update(rest_length_m=-0.6), ["tether.rest_length_m", "-0.6", "above 0"]),
    "text for a number": (lambda d: d["object"].update(mass_kg="heavy"), ["object.mass_kg", "heavy", "a number"]),
    "three numbers for a point": (
        lambda d: d["object"].update(tether_anchor_m=[1, 2, 3]),
        ["tether_anchor_m", "exactly 2"],
    ),
    "missing video": (lambda d: d["runs"]["a"].update(video="z.mp4"), ["runs.a.video", "z.mp4"]),
    "missing floor image": (lambda d: d["floor"].update(image="calibration/flor.jpg"), ["floor.image", "flor.jpg"]),
    "pattern without pictures": (
        lambda d: d["camera"].update(calibration_images="calib/*.jpg"),
        ["camera.calibration_images", "calib/*.jpg"],
    ),
    "load beside the top": (lambda d: d["object"]["load"].update(at_m=[0.9, 0.0]), ["object.load.at_m", "0.9"]),
    "weight beside the footprint": (
        lambda d: d["object"].update(footprint_m=[[0.05, -0.1], [0.25, -0.1], [0.25, 0.1], [0.05, 0.1]]),
        ["object.footprint_m", "0.002 m outside", "object.load"],
    ),
    "static below kinetic": (
        lambda d: d["friction"].update(static=0.2),
        ["friction.static", "0.2 ± 0.01", "kinetic 0.35 ± 0.005", "static >= kinetic"],
    ),
    "footprint of two corners": (
        lambda d: d["object"].update(footprint_m=[[0, 0], [1, 0]]),
        ["object.footprint_m", "one ring of 3 to 200 corners", "list of such rings"],
    ),
    "feet in millimetres": (
        lambda d: d["object"].update(footprint_m=[feet()[0], (10 * np.array(feet()[1])).tolist(), feet()[2]]),
        ["object.footprint_m[1]", "not under the object", "(2.15, -1.4)"],
    ),
    "mass spread over something else": (lambda d: d["object"].update(mass_over="load"), ["top, footprint"]),
    "centre of mass without inertia": (
        lambda d: d["object"].update(centre_of_mass_m=[0, 0]),
        ["object.centre_of_mass_m", "moment_of_inertia_kg_m2"],
    ),
    "mass spread in two ways": (
        lambda d: d["object"].update(centre_of_mass_m=[0, 0], moment_of_inertia_kg_m2=0.1, mass_over="top"),
        ["object.mass_over", "not clear"],
    ),
    "no gravity": (lambda d: d.update(gravity_m_per_s2=0), ["gravity_m_per_s2", "at least 0.1"]),
    "velocities swapped": (
        lambda d: d["friction"].update(stiction_velocity_m_per_s=0.1),
        ["stiction_velocity_m_per_s", "0.1"],
    ),
    "a corner too few": (
        lambda d: d["runs"]["b"]["first_frame_clicks_px"]["rover"].pop(),
        ["runs.b", "rover", "allowed: 4"],
    ),
    "clicks of another video": (
        lambda d: d["runs"]["b"]["first_frame_clicks_px"].update(rover=[[9000, 1], [9001, 1], [9001, 50], [9000, 50]]),
        ["runs.b.first_frame_clicks_px.rover", "outside the image"],
    ),
    "no floor frame": (lambda d: d["floor"].pop("origin_corner_px"), ["floor frame is not fixed", "origin_corner_px"]),
    "charuco without markers": (lambda d: d["camera"]["board"].update(type="charuco"), ["charuco", "marker_m"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_one_message_names_the_key(campaign, name):
    change, words = WRONG[name]
    with pytest.raises(InputError) as caught:
        load_campaign(campaign(change))
    for word in words:
        assert word in str(caught.value)


def test_all_faults_are_told_at_once(campaign):
    def change(document):
        document["tether"]["rest_length_m"] = -1
        document["objekt"] = {}

    with pytest.raises(InputError, match="2 faults") as caught:
        load_campaign(campaign(change))
    assert "objekt" in str(caught.value)
    assert "rest_length_m" in str(caught.value)


def test_a_key_given_twice_is_an_error(campaign):
    folder = campaign(lambda d: None)
    text = (folder / "campaign.yaml").read_text()
    (folder / "campaign.yaml").write_text(text + "\ntether: {rest_length_m: 1, stiffness_N_per_m: 1}\n")
    with pytest.raises(InputError, match="'tether' is given twice"):
        load_campaign(folder)


def test_a_missing_folder_and_a_missing_file_are_told(tmp_path):
    with pytest.raises(InputError, match="campaign folder is missing"):
        load_campaign(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"campaign\.yaml is missing"):
        load_campaign(tmp_path)


def test_broken_yaml_names_the_line(campaign):
    folder = campaign(lambda d: None)
    (folder / "campaign.yaml").write_text("camera: [1, 2\nfloor: x\n")
    with pytest.raises(InputError, match="line 2"):
        load_campaign(folder)


def _leaves(schema, path=""):
    for name, sub in schema.get("properties", {}).items():
        yield f"{path}.{name}", sub
        yield from _leaves(sub, f"{path}.{name}")
    for key in ("items", "additionalProperties"):
        if isinstance(schema.get(key), dict):
            yield from _leaves(schema[key], f"{path}[]")


def test_every_key_of_the_schema_has_a_meaning_and_lengths_have_a_unit():
    for path, schema in _leaves(campaign_schema()):
        if "[]" not in path.rsplit(".", 1)[-1]:
            assert "description" in schema, path
        if "properties" not in schema and path.endswith(("_m", "_px", "_kg", "_N_per_m", "_m_per_s")):
            assert "unit" in schema, path


def test_videos_elsewhere_are_fine(campaign, tmp_path, lab_small):
    shutil.copy(lab_small / "a.mp4", tmp_path / "far.mp4")
    folder = campaign(lambda d: d["runs"]["a"].update(video=str(tmp_path / "far.mp4")))
    assert load_campaign(folder).run("a").video == tmp_path / "far.mp4"
