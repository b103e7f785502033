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


def test_faults_of_all_campaigns_are_told_at_once_each_with_its_name(lab_small, tmp_path):
    for name in "xyz":
        shutil.copytree(lab_small, tmp_path / name)
    for name, key in (("x", "bogus"), ("z", "unheard")):
        with (tmp_path / name / "campaign.yaml").open("a") as stream:
            stream.write(f"\n{key}: 3\n")
    with pytest.raises(InputError) as caught:
        Campaigns([tmp_path / name for name in "xyz"]).check()
    assert "the list of campaigns has 2 faults" in str(caught.value)
    assert "- x: campaign.yaml: unknown key bogus" in str(caught.value)
    assert "- z: campaign.yaml: unknown key unheard" in str(caught.value)
    with pytest.raises(InputError, match=r"^z: campaign.yaml: unknown key unheard"):
        Campaigns([tmp_path / "y", tmp_path / "z"]).check()
    with pytest.raises(InputError, match=r"^campaign.yaml: unknown key bogus"):
        Campaigns([tmp_path / "x"]).check()
