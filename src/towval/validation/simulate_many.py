"""Many simulations of one run on all cores: the draws of the uncertainty, or scenes to compare.

The loop over time is compiled and releases the interpreter's lock, so threads share the cores. The result of a draw
depends on the draw alone: it is bit-identical for any number of threads.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from towval.model import Array, SimulatedMotion, TowingScene
from towval.model.errors import TowvalError
from towval.physics.dynamics import Outcome
from towval.physics.ladder import DYNAMICS
from towval.validation.hinge_trajectory import trajectory_of
from towval.validation.scene_model import SceneModel

_WAITING = 4  # draws prepared ahead per thread, which bounds the memory


class Drawn(NamedTuple):
    """A simulation to be run.

    The scene; poses and rates (m, 6) of the rover [m, m, rad; per s]; the object's start pose (3,) [m, m, rad].
    """

    scene: TowingScene
    rover: Array
    start: Array


@dataclass(frozen=True)
class Batch:
    """What many simulations have in common.

    ``rover_times`` (m,) of the rover's poses and ``times`` (n,) of the output [s]; ``rung`` of the ladder for planar
    scenes (all others are simulated by the dynamics); whether objects are ``sticking``; ``tolerance_m`` of a step [m];
    number of simulation ``threads``.
    """

    rover_times: Array
    times: Array
    rung: str = DYNAMICS
    sticking: bool = False
    tolerance_m: float = 3e-6
    threads: int = 1

    def simulate(self, draws: Iterable[Drawn | None]) -> Iterator[Array]:
        """Poses (n, 3) of the object for each of the draws, in their order.

        NaN where a draw is None, where its scene is refused or where its simulation ends early.
        """
        if self.threads == 1:
            yield from map(self._poses, draws)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            waiting: deque[Future[Array]] = deque()
            for drawn in draws:
                waiting.append(pool.submit(self._poses, drawn))
                if len(waiting) >= _WAITING * self.threads:
                    yield waiting.popleft().result()
            yield from (future.result() for future in waiting)

    def failure(self, drawn: Drawn | None) -> str:
        """Why a draw for which :meth:`simulate` gives NaN could not be simulated."""
        if drawn is None:
            return "its values are impossible"
        try:
            return f"the simulation ended with: {self._motion(drawn).outcome}"
        except TowvalError as error:
            return str(error)

    def _poses(self, drawn: Drawn | None) -> Array:
        missing = np.full((len(self.times), 3), np.nan)
        if drawn is None:
            return missing
        try:
            motion = self._motion(drawn)
        except TowvalError:
            return missing
        return motion.pose if motion.outcome in (Outcome.CONVERGED, Outcome.SLACK_ALL_ALONG) else missing

    def _motion(self, drawn: Drawn) -> SimulatedMotion:
        hinge = trajectory_of(drawn.scene.hinge, self.rover_times, drawn.rover)
        model = SceneModel(drawn.scene, sticking=self.sticking)
        rung = self.rung if model.planar else DYNAMICS  # The other rungs apply to planar scenes only.
        return model.motion(rung, hinge, drawn.start, self.times, self.tolerance_m)
