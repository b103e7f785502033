"""campaign.yaml: what is read, and one clear message for each way of getting it wrong."""

import copy
import shutil
from dataclasses import replace

import numpy as np
import pytest
import shapely
import yaml

from towval.io.campaign import campaign_schema, load_campaign
from towval.model import Load
from towval.model.errors import InputError, InputErrors
from towval.model.inputs import INPUTS, Realisation, is_left_out
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


def test_a_real_labs_file_arrives_whole_in_the_scene(shared_dir):
    """Every number of lab_c's campaign.yaml that is about the tow, found again where the simulation reads it."""
    lab_c = shared_dir / "footage" / "lab_c"
    document = yaml.safe_load((lab_c / "campaign.yaml").read_text())
    campaign = load_campaign(lab_c)
    scene, std = campaign.scene, campaign.deviations
    rover, towed, tether, friction = (document[key] for key in ("rover", "object", "tether", "friction"))
    assert scene.ground.gravity == document["gravity_m_per_s2"]
    assert scene.ground.slope == pytest.approx(1e-3 * np.array(document["floor"]["slope_mm_per_m"]))
    assert std["slope"] == pytest.approx(1e-3 * document["floor"]["slope_std_mm_per_m"])
    assert scene.hinge_height == rover["tether_hinge_height_m"]
    assert scene.anchor_height == towed["tether_anchor_height_m"]
    assert scene.centre_of_mass_height == towed["centre_of_mass_height_m"]
    assert [ring.tolist() for ring in scene.patch.outlines] == towed["footprint_m"]
    assert (scene.tether.damping, std["damping"]) == (tether["damping_Ns_per_m"], tether["damping_std_Ns_per_m"])
    for row, key in (
        ("hinge_height", rover["tether_hinge_height_std_m"]),
        ("stiffness", tether["stiffness_std_N_per_m"]),
    ):
        assert std[row] == key
    for name, row in (("static", "static_friction"), ("stiction_velocity", ""), ("across_over_along", "")):
        key = f"{name}_m_per_s" if "velocity" in name else name
        std_key = f"{name}_std_m_per_s" if "velocity" in name else f"{name}_std"
        assert (getattr(scene.friction, name), std[row or name]) == (friction[key], friction[std_key])


@pytest.mark.parametrize(
    ("change", "key", "value"),
    [
        (lambda d: d["floor"].update(slope_mm_per_m=[2.0, -1.0]), "ground.slope", [0.002, -0.001]),
        (lambda d: d["rover"].update(tether_hinge_height_m=0.2), "hinge_height", 0.2),
        (lambda d: d["object"].update(tether_anchor_height_m=0.05), "anchor_height", 0.05),
        (lambda d: d["object"].update(tether_anchor_height_m=0.05), "centre_of_mass_height", 0.125),
        (lambda d: d["object"].update(centre_of_mass_height_m=0.1), "centre_of_mass_height", 0.1),
        (lambda d: d["friction"].update(across_over_along=1.04), "friction.across_over_along", 1.04),
        (lambda d: d["friction"].update(radius_over_planar=0.9), "friction.radius_over_planar", 0.9),
        (lambda d: d["tether"].update(stiffening=0.2), "tether.stiffening", 0.2),
        (lambda d: d["tether"].update(stiffening=0.2), "tether.full_load", 0.396 * 5.8 * 9.81),
        (lambda d: d["tether"].update(mass_kg_per_m=0.3), "tether.mass_per_length", 0.3),
        (lambda d: None, "centre_of_mass_height", 0.0),
    ],
)
def test_each_key_of_a_lab_arrives(campaign, change, key, value):
    found = load_campaign(campaign(change)).scene
    for part in key.split("."):
        found = getattr(found, part)
    assert found == pytest.approx(value)


def test_regions_arrive_and_their_factors_share_a_deviation(campaign):
    regions = [
        {"outline_m": [[0, 0], [1, 0], [1, 1]], "factor": 1.1},
        {"outline_m": [[1, 0], [2, 0], [1, 1]], "factor": 0.9},
    ]
    given = load_campaign(campaign(lambda d: d["friction"].update(regions=regions)))
    assert [region.factor for region in given.scene.ground.regions] == [1.1, 0.9]
    assert given.deviations["regions"] == 0.02
    real = INPUTS["regions"].acts(Realisation.nominal(given.scene), np.array([0.05]))
    assert [region.factor for region in real.scene.ground.regions] == pytest.approx([1.15, 0.95])
    assert load_campaign(campaign(lambda d: None)).deviations["regions"] == 0


def test_what_is_left_out_has_a_deviation_and_a_name(campaign):
    given = load_campaign(campaign(lambda d: d["rover"].update(tether_hinge_height_m=0.0)))
    left_out = {name for name, row in INPUTS.items() if is_left_out(row, given.document)}
    assert {"anchor_height", "slope", "across_over_along", "radius_over_planar"} <= left_out
    assert "hinge_height" not in left_out
    assert given.deviations["hinge_height"] == 0.002
    assert given.deviations["anchor_height"] == 0.03


def test_a_damping_may_be_known_to_be_small_and_no_more(campaign):
    given = load_campaign(campaign(lambda d: d["tether"].update(damping_Ns_per_m=1.0, damping_std_Ns_per_m=2.0)))
    assert given.deviations["damping"] == 2.0


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
    "section of the settings": (
        lambda d: d.update(compare={"tolerance_m": 0.01}),
        ["unknown key compare", "belongs to the settings", "--set compare.KEY=VALUE"],
    ),
    "missing key": (lambda d: d["object"].pop("mass_kg"), ["object.mass_kg is missing", "kg"]),
    "wrong unit": (
        lambda d: d["rover"].update(tracked_plane_height_m=42),
        ["rover.tracked_plane_height_m", "42", "at most 3"],
    ),
    "negative tether": (lambda d: d["tether"].update(rest_length_m=-0.6), ["tether.rest_length_m", "-0.6", "above 0"]),
    "text for a number": (lambda d: d["object"].update(mass_kg="heavy"), ["object.mass_kg", "heavy", "a number"]),
    "decimal comma": (lambda d: d["object"].update(mass_kg="4,5"), ["object.mass_kg", "'4,5'", "with a point: 4.5"]),
    "three numbers for a point": (
        lambda d: d["object"].update(tether_anchor_m=[1, 2, 3]),
        ["tether_anchor_m", "exactly 2"],
    ),
    "missing video": (lambda d: d["runs"]["a"].update(video="z.mp4"), ["runs.a.video", "z.mp4"]),
    "name with a space": (lambda d: d["runs"].update({"my run": d["runs"].pop("b")}), ["letters, digits, - and _"]),
    "long name": (lambda d: d["runs"].update({300 * "b": d["runs"].pop("b")}), ["a text of at most 200 characters"]),
    "missing floor image": (lambda d: d["floor"].update(image="calibration/flor.jpg"), ["floor.image", "flor.jpg"]),
    "pattern without pictures": (
        lambda d: d["camera"].update(calibration_images="calib/*.jpg"),
        ["camera.calibration_images", "calib/*.jpg"],
    ),
    "pattern as on Windows": (
        lambda d: d["camera"].update(calibration_images="calibration\\*.jpg"),
        ["camera.calibration_images", "write / between folders"],
    ),
    "video as on Windows": (
        lambda d: d["runs"]["a"].update(video="C:\\lab\\a.mp4"),
        ["runs.a.video", "write / between folders"],
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
    "sole in centimetres": (
        lambda d: d["object"].update(footprint_m=(10 * np.array(d["object"]["footprint_m"])).tolist()),
        ["object.footprint_m does not go with object.top_corners_m", "outside a top of 0.61 m"],
    ),
    "centre of mass above the load": (
        lambda d: d["object"].update(centre_of_mass_height_m=1.2),
        ["object.centre_of_mass_height_m is above the object", "at most 0.33 m"],
    ),
    "inertia in grams": (
        lambda d: d["object"].update(centre_of_mass_m=[0, 0], moment_of_inertia_kg_m2=120.0),
        ["object.moment_of_inertia_kg_m2 does not go with", "4 kg at 5.48 m", "0.031 to 0.61 m"],
    ),
    "inertia in tonnes": (
        lambda d: d["object"].update(centre_of_mass_m=[0, 0], moment_of_inertia_kg_m2=0.00012),
        ["object.moment_of_inertia_kg_m2 does not go with", "4 kg at 0.00548 m"],
    ),
    "deviation in grams": (
        lambda d: d["object"].update(mass_std_kg=20),
        ["object.mass_std_kg is not below the value", "4 ± 20 kg"],
    ),
    "deviation of a length in millimetres": (
        lambda d: d["tether"].update(rest_length_std_m=1),
        ["tether.rest_length_std_m is not below the value", "0.6 ± 1 m"],
    ),
    "rest length in kilometres": (
        lambda d: d["tether"].update(rest_length_m=0.0006),
        ["tether.rest_length_m and tether.stiffness_N_per_m", "on 0.0006 m"],
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
    "hinge below the floor": (
        lambda d: d["rover"].update(tether_hinge_height_m=-0.05),
        ["rover.tether_hinge_height_m", "-0.05", "at least 0", "above the floor"],
    ),
    "slope of five degrees": (
        lambda d: d["floor"].update(slope_mm_per_m=[87.5, 0.0]),
        ["floor.slope_mm_per_m[0]", "87.5", "at most 50", "mm/m"],
    ),
    "floor steeper than friction": (
        lambda d: (d["floor"].update(slope_mm_per_m=[45.0, 0.0]), d["friction"].update(static=0.04, kinetic=0.03)),
        ["slides down the floor by itself", "45 mm per m", "0.04"],
    ),
    "anchor so high that it tips": (
        lambda d: (d["object"].update(tether_anchor_height_m=1.2), d["rover"].update(tether_hinge_height_m=1.2)),
        ["tips over when it is towed", "anchor 1.2 m", "object.tether_anchor_height_m"],
    ),
    "tether that does not reach": (
        lambda d: d["rover"].update(tether_hinge_height_m=0.7),
        ["tether.rest_length_m 0.6", "0.7 and 0 m"],
    ),
    "tether heavier than the object": (
        lambda d: d["tether"].update(mass_kg_per_m=12.0),
        ["heavier than the object", "tether.mass_kg_per_m 12 over 0.6 m", "5.8 kg"],
    ),
    "stiffening of the whole": (lambda d: d["tether"].update(stiffening=1.0), ["tether.stiffening", "below 1"]),
    "regions that overlap": (
        lambda d: d["friction"].update(regions=[{"outline_m": [[0, 0], [1, 0], [1, 1]], "factor": 1.1}] * 2),
        ["friction.regions[1].outline_m", "overlaps"],
    ),
    "region that crosses itself": (
        lambda d: d["friction"].update(regions=[{"outline_m": [[0, 0], [1, 1], [1, 0], [0, 1]], "factor": 1.1}]),
        ["friction.regions[0].outline_m", "no simple polygon"],
    ),
    "hole over the rim": (
        lambda d: d["object"].update(footprint_holes_m=[[[0.0, 0.0], [5.0, 0.0], [5.0, 0.1]]]),
        ["object.footprint_m with its footprint_holes_m", "no simple polygon", "holes inside their outline"],
    ),
    "feet that overlap": (
        lambda d: d["object"].update(footprint_m=[feet()[0], feet()[0], feet()[2]], mass_over="top"),
        ["object.footprint_m", "no simple polygon", "parts apart"],
    ),
    "corners that are not whole": (
        lambda d: d["camera"]["board"].update(inner_corners=[9.5, 6]),
        ["inner_corners[0]", "9.5", "a whole number"],
    ),
    "braces in a name": (lambda d: d.update(repeats=[["{b}", "{b}"]]), ["repeats[0]", "{b}"]),
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


def test_where_marks_fix_the_frame_the_board_on_the_floor_needs_no_corner_pointed_at(campaign):
    def change(document):
        for key in ("origin_corner_px", "x_axis_end_corner_px"):
            del document["floor"][key]
        at = [(100, 100), (1800, 100), (1800, 1000), (100, 1000)]
        document["floor"]["surveyed_marks"] = [{"at_px": [*px], "at_m": [px[0] / 1e3, -px[1] / 1e3]} for px in at]

    read = load_campaign(campaign(change))
    assert len(read.floor_images) >= 1
    assert read.floor_reference.origin_corner_px is None


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


def test_each_missing_key_is_told_once(campaign):
    def change(document):
        document["friction"] = {}

    with pytest.raises(InputErrors) as caught:
        load_campaign(campaign(change))
    assert len(caught.value.faults) == 4


def test_faults_of_values_files_and_geometry_are_told_together(campaign):
    """Those that a schema sees, files that are missing, and numbers that contradict each other."""

    def change(document):
        document["camera"]["calibration_images"] = "nothing_*.jpg"
        document["floor"].pop("origin_corner_px")
        document["object"]["load"]["at_m"] = [2.0, 0.0]
        document["object"]["mass_kg"] = 0.1
        document["runs"]["a"]["video"] = "gone.mp4"
        document["runs"]["a"]["first_frame_clicks_px"]["rover"].pop()
        document["runs"]["b"]["video"] = ""

    with pytest.raises(InputErrors) as caught:
        load_campaign(campaign(change))
    texts = [str(fault) for fault in caught.value.faults]
    for words in (
        "camera.calibration_images finds no picture",
        "floor frame is not fixed",
        "object.load.at_m is not on",
        "object.footprint_m",
        "runs.a.video is missing",
        "runs.a.first_frame_clicks_px.rover has another number",
        "runs.b.video is ''",
    ):
        assert sum(words in text for text in texts) == 1, words
    assert len(texts) == 7


def test_a_soft_tether_is_as_long_as_it_gets_before_the_object_slides(campaign):
    """At its length at rest it slopes so much that the object would tip over."""

    def change(document):
        document["object"].pop("load")
        square = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]
        document["object"].update(mass_kg=2.0, footprint_m=square, mass_over="footprint")
        document["object"].update(tether_anchor_m=[0.25, 0.0], tether_anchor_height_m=0.02)
        document["rover"]["tether_hinge_height_m"] = 0.27
        document["tether"].update(rest_length_m=0.3, stiffness_N_per_m=stiffness)

    stiffness = 25.0
    assert load_campaign(campaign(change)).scene.tether.stiffness == stiffness
    stiffness = 800.0
    with pytest.raises(InputError, match="tips over when it is towed"):
        load_campaign(campaign(change))


def test_regions_side_by_side_may_overlap_by_rounding(campaign):
    """Along a slanted seam the corner of one tile lies within the edge of the other."""
    tiles = [
        [[0.0, 1.8], [-0.72, 2.7], [-1.17, 2.34], [-0.45, 1.44]],
        [[-0.36, 2.25], [0.0, 1.8], [0.45, 2.16], [0.09, 2.61]],
    ]
    areas = [shapely.Polygon(tile) for tile in tiles]
    assert 0 < areas[0].intersection(areas[1]).area < 1e-15
    regions = [{"outline_m": tile, "factor": 1.1} for tile in tiles]
    read = load_campaign(campaign(lambda d: d["friction"].update(regions=regions)))
    assert len(read.scene.ground.regions) == 2


def test_the_full_load_of_a_tether_is_what_the_friction_that_counts_allows(campaign):
    """Static below kinetic friction means no peak."""

    def change(document):
        document["friction"].update(static=0.34, kinetic=0.35, static_std=0.02)
        document["tether"]["stiffening"] = 0.3

    scene = load_campaign(campaign(change)).scene
    assert scene.friction.static == 0.35
    assert scene.tether.full_load == pytest.approx(0.35 * scene.weight)


def test_whole_numbers_with_a_point_count(campaign):
    def change(document):
        document["camera"]["resolution_px"] = [960.0, 540.0]
        document["camera"]["board"]["inner_corners"] = [9.0, 6.0]

    read = load_campaign(campaign(change))
    assert [type(number) for number in (*read.resolution_px, *read.board.inner_corners)] == [int] * 4


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"- 1\n", r"the document is \[1\]; allowed: keys"),
        (b"", "the document is empty; allowed: keys"),
        ("camera: {}\n".encode("utf-16"), "save it as UTF-8"),
    ],
)
def test_a_document_that_is_no_mapping_is_one_fault(campaign, data, words):
    folder = campaign(lambda d: None)
    (folder / "campaign.yaml").write_bytes(data)
    with pytest.raises(InputError, match=words):
        load_campaign(folder)


def test_a_key_given_twice_is_an_error(campaign):
    folder = campaign(lambda d: None)
    text = (folder / "campaign.yaml").read_text()
    (folder / "campaign.yaml").write_text(text + "\ntether: {rest_length_m: 1, stiffness_N_per_m: 1}\n")
    with pytest.raises(InputError, match="'tether' is given twice"):
        load_campaign(folder)


def test_a_missing_folder_and_a_missing_file_are_told(tmp_path):
    with pytest.raises(InputError, match="campaign folder is missing"):
        load_campaign(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"campaign folder is a file(.|\n)*what to do: give its folder"):
        load_campaign(tmp_path / "file")
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


def test_repeats_are_groups_of_runs(campaign):
    assert load_campaign(campaign(lambda d: None)).repeats == ()
    assert load_campaign(campaign(lambda d: d.update(repeats=[["a", "b"]]))).repeats == (("a", "b"),)


@pytest.mark.parametrize("groups", [[["a", "z"]], [["a", "b"], ["b", "a"]]])
def test_repeats_of_no_run_or_twice_are_refused(campaign, groups):
    with pytest.raises(InputError, match=r"repeats names(.|\n)*each of a, b"):
        load_campaign(campaign(lambda d: d.update(repeats=groups)))


def test_a_run_that_is_left_out_is_not_read(campaign):
    """Neither its video nor its clicks; groups of repeats may still name it."""

    def change(document):
        document["runs"]["b"] = {"video": "lost.mp4", "left_out": "the tether was touched"}
        document["repeats"] = [["a", "b"]]

    read = load_campaign(campaign(change))
    assert [*read.runs] == ["a"]
    assert read.left_out == {"b": "the tether was touched"}
    assert read.repeats == (("a", "b"),)
    with pytest.raises(InputError, match=r"run b .* is left out\n  got: the tether was touched"):
        read.run("b")


def test_leaving_out_every_run_is_refused(campaign):
    def change(document):
        for run in document["runs"].values():
            run["left_out"] = "bad light"

    with pytest.raises(InputError, match="every run is left out"):
        load_campaign(campaign(change))


def test_faults_of_a_run_that_is_left_out_hide_no_others(campaign):
    def change(document):
        document["runs"]["b"] = {"video": "lost.mp4", "left_out": 3}
        document["runs"]["a"]["video"] = "missing.mp4"

    with pytest.raises(InputErrors) as caught:
        load_campaign(campaign(change))
    text = str(caught.value)
    assert "runs.b.left_out is 3" in text
    assert "missing.mp4" in text
    assert "lost.mp4" not in text
