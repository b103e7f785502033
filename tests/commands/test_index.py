"""The command ``towval index``."""

import sqlite3
from contextlib import closing

import pandas as pd
import pytest

from result_folders import make_run
from towval.cli import main
from towval.io.results_index import read_results


def test_writes_both_files_and_says_what_it_found(tmp_path, capsys):
    make_run(tmp_path / "results" / "lab" / "a")
    main(["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite")])
    assert "1 run (agrees 1)" in capsys.readouterr().out
    assert (tmp_path / "index.sqlite").is_file()
    assert (tmp_path / "index.html").is_file()


def test_a_campaign_that_two_folders_lead_to_counts_once(tmp_path, capsys):
    results = tmp_path / "results"
    make_run(results / "lab" / "a")
    (tmp_path / "link").symlink_to(results)
    folders = [results, results, tmp_path / "link", results / "lab"]
    main(["index", *map(str, folders), "-o", str(tmp_path / "index.sqlite")])
    assert "1 run (agrees 1)" in capsys.readouterr().out


def test_campaigns_have_the_names_by_which_a_folder_holds_them(tmp_path, capsys):
    """Results of last year, linked beside those of this year, may have the same name where they are."""
    make_run(tmp_path / "results" / "lab" / "a")
    make_run(tmp_path / "old" / "lab" / "a", verdict="not judged")
    (tmp_path / "results" / "lab of last year").symlink_to(tmp_path / "old" / "lab")
    main(["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite")])
    assert "2 runs (agrees 1, not judged 1)" in capsys.readouterr().out
    index = read_results([tmp_path / "results"])
    assert index.runs["campaign"].tolist() == ["lab", "lab of last year"]


def test_fails_on_a_verdict_after_writing(tmp_path, capsys):
    make_run(tmp_path / "results" / "lab" / "a", verdict="not judged")
    make_run(tmp_path / "results" / "lab" / "b")
    arguments = ["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite"), "--fail-on"]
    main([*arguments, "unfinished"])
    with pytest.raises(SystemExit) as stopped:
        main([*arguments, "not-judged,unfinished"])
    assert stopped.value.code == 1
    assert "1 of 2 runs: lab/a (not judged)" in capsys.readouterr().err
    assert (tmp_path / "index.html").is_file()


def test_a_run_that_is_unfinished_fails_on_any_verdict(tmp_path, capsys):
    """As help and documents say: footage whose run ended with an error had passed as what does not disagree."""
    make_run(tmp_path / "results" / "lab" / "a", up_to="simulate")
    arguments = ["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite")]
    main(arguments)
    with pytest.raises(SystemExit) as stopped:
        main([*arguments, "--fail-on", "disagrees"])
    assert stopped.value.code == 1
    assert "1 of 1 runs: lab/a (unfinished)" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["index.sqlite", "index.html"])
def test_files_of_others_are_not_taken_for_an_index_or_its_page(name, tmp_path, capsys):
    """A table "runs" that pandas made, or a page with a content security policy, was enough to be replaced."""
    make_run(tmp_path / "results" / "lab" / "a")
    mine = tmp_path / name
    if name.endswith("html"):
        mine.write_text('<meta http-equiv="Content-Security-Policy" content="default-src \'self\'">')
    else:
        with closing(sqlite3.connect(mine)) as database:
            pd.DataFrame({"speed": [1.0]}).to_sql("runs", database, index=False)
    before = mine.read_bytes()
    with pytest.raises(SystemExit):
        main(["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite")])
    assert f"{name} is not replaced" in capsys.readouterr().err
    assert mine.read_bytes() == before


def test_an_index_replaces_its_earlier_self(tmp_path):
    make_run(tmp_path / "results" / "lab" / "a")
    for _ in range(2):
        main(["index", str(tmp_path / "results"), "-o", str(tmp_path / "index.sqlite")])


def test_an_unknown_verdict_is_refused_before_anything_is_read(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["index", str(tmp_path / "none"), "-o", str(tmp_path / "index.sqlite"), "--fail-on", "wrong"])
    assert "--fail-on names no verdict" in capsys.readouterr().err
