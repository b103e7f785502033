"""Inputs fitted to measured runs, and what they predict for the run that was left out."""

from dataclasses import dataclass

from towval.model.checks import Array, lock
from towval.model.findings import Finding


@dataclass(frozen=True)
class Prediction:
    """One run, predicted with the values that were fitted to all others.

    ``run`` its name; ``values`` (p,) fitted without it; ``time_s`` (n,) and ``pose`` (n, 3) the predicted motion of
    the object [m, m, rad]; ``given_rms_m`` the path error with what campaign.yaml says, ``predicted_rms_m`` with the
    values.
    """

    run: str
    values: Array
    time_s: Array
    pose: Array
    given_rms_m: float
    predicted_rms_m: float

    def __post_init__(self) -> None:
        lock(self, values=(None,), time_s=(None,), pose=(len(self.time_s), 3))


@dataclass(frozen=True)
class Identification:
    """Inputs identified from the runs of a campaign. Not validation: what was fitted cannot confirm itself.

    ``parameters`` (p) names with their units; ``given`` (p,) and ``given_std`` (p,) of campaign.yaml; ``values`` (p,)
    fitted to all ``runs``, with ``covariance`` (p, p); ``identifiable`` (p) whether the runs fix each value;
    ``predictions`` one for each run, empty where there is only one.
    """

    parameters: tuple[str, ...]
    runs: tuple[str, ...]
    given: Array
    given_std: Array
    values: Array
    covariance: Array
    identifiable: tuple[bool, ...]
    predictions: tuple[Prediction, ...]
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        p = len(self.parameters)
        lock(self, given=(p,), given_std=(p,), values=(p,))
        lock(self, finite=False, covariance=(p, p))
