"""Several campaigns at once: names, order, and that each is read once, when it is asked for."""

import shutil

import pytest

from towval.io import campaigns
from towval.io.campaigns import Campaigns
from towval.model.errors import InputError


def test_campaigns_are_read_once_when_they_are_asked_for(lab_small, tmp_path, monkeypatch):
    read = []
    load = campaigns.load_campaign
    monkeypatch.setattr(campaigns, "load_campaign", lambda folder: read.append(folder) or load(folder))
    many = Campaigns([str(tmp_path / "missing"), lab_small])
    assert (list(many), len(many), read) == (["missing", "lab_small"], 2, [])
    assert many["lab_small"] is many["lab_small"]
    assert (many["lab_small"].name, read) == ("lab_small", [lab_small])
    with pytest.raises(InputError, match="the campaign folder is missing"):
        many["missing"]


def test_two_folders_of_one_name_are_refused(lab_small, tmp_path):
    shutil.copytree(lab_small, tmp_path / "lab_small")
    with pytest.raises(InputError, match="two campaigns have the folder name lab_small"):
        Campaigns([lab_small, tmp_path / "lab_small"])
