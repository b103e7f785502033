"""A summary that pandas wrote is read without it, value for value."""

import numpy as np
import pandas as pd

from towval.io.summary import COLUMNS
from towval.io.summary_rows import read_summary


def test_what_pandas_wrote_is_read_value_for_value(tmp_path):
    numbers = {name: [0.00123456789, np.nan] for name in COLUMNS}
    texts = {"run": ["a", "007"], "verdict": ["cannot tell", "agrees"], "findings": ['one, "two"\nthree', ""]}
    table = pd.DataFrame({**numbers, **texts, "tracked_frames": [600, 0], "ratio_max": [np.inf, 1e-9]})
    table[list(COLUMNS)].to_csv(tmp_path / "summary.csv", index=False)
    found = read_summary(tmp_path / "summary.csv")
    wanted = table[list(COLUMNS)].drop(columns="findings").set_index("run", drop=False)
    pd.testing.assert_frame_equal(pd.DataFrame.from_dict(found, orient="index"), wanted, check_names=False)
