import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera, ceiling, small_camera, standard_scene
from towval.model import Body
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.relocalisation import Relocaliser


def test_a_body_is_found_wherever_it_went():
    scene = standard_scene(31, **small_camera())
    film, motion = CeilingCamera(scene), scene.motions[0]
    finder = Relocaliser(scene.target(0), film.picture(0.0), motion(0.0))
    for time_s in (2.0, 8.0):
        found = finder.find(film.picture(time_s))
        # Good enough to start an alignment from: two pixels of 4.7 mm, and of 1 % of the body's half length in heading.
        assert np.linalg.norm(found[:2] - motion(time_s)[:2]) < 9e-3
        assert np.sin(found[2] - motion(time_s)[2]) == pytest.approx(0.0, abs=0.02)


def test_where_it_is_not_it_is_not_found():
    scene = standard_scene(31, **small_camera(), hidden=lambda t: ("rover",) if t > 1 else ())
    film = CeilingCamera(scene)
    finder = Relocaliser(scene.target(0), film.picture(0.0), scene.motions[0](0.0))
    assert finder.find(film.picture(2.0)) is None


def test_a_plain_top_has_nothing_to_be_found_by():
    camera, floor = ceiling()
    flat = np.full((1080, 1920), 128, np.uint8)
    body = Body("rover", 0.3, np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]))
    assert Relocaliser(PlanarTarget(body, camera, floor), flat, np.zeros(3)).find(flat) is None
