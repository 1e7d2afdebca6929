"""Decentralised real-time iterations of ADMM on a coupled formation cost (Stomberg et al. 2024).

All vehicles together minimise

    sum_i task_weight / 2 |p_i - r_i|^2 + effort_weight / 2 |a_i|^2 + coupling / 2 sum_j |p_i - p_j - d_ij|^2

over the positions p of the next stages; r_i is the reference of vehicles with a task of their own. Vehicle i
has copies w_ij of the positions of its neighbours, and all copies of a vehicle agree with their average z:

    local:    p_i, w_ij minimise the own terms + penalty / 2 (|p_i - z_i + u_i|^2 + |w_ij - z_j + u_ij|^2)
    average:  z_i = mean of p_i + u_i and w_ji + u_ji
    dual:     u_i += p_i - z_i,  u_ij += w_ij - z_j

Local problems and averages alternate from exchange to exchange. They concern the stages after the present
one, whose acceleration stays; after each stage the first planned acceleration is flown and all shift by one.
Losses and delays are met by the newest values there are (arXiv 2409.13334; ADMM: Boyd et al. 2011, 7.2).
Vehicles with another number of stages are ignored.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from rcopterx.control.interfaces import Estimate
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.schemes.messages import Linked, Samples, linked
from rcopterx_studies.schemes.planner import WayPlanner
from rcopterx_studies.schemes.tracked import INSTANT_S, Gain, SchemePath, TrackedScheme, TrackedSettings


class AdmmSettings(TrackedSettings, frozen=True, kw_only=True):
    """Settings of the scheme."""

    stages: Annotated[int, Meta(ge=2, le=50)] = 12
    stage_s: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1
    task_weight: Gain = 10.0
    coupling: Gain = 10.0
    effort_weight: Gain = 0.1
    penalty: Gain = 10.0
    exchanges: Annotated[int, Meta(ge=1, le=8)] = 2
    """Per control period; two are an iteration."""


class Iterate(Struct, frozen=True):
    """Average of the sender's positions, and its copies of its neighbours' positions with their duals."""

    stage: int  # number of the first stage on the fleet's clock
    average: Samples
    copies: dict[str, Samples]


class AdmmScheme(TrackedScheme[AdmmSettings]):
    """Consensus ADMM over planned positions; the cascade tracks the plan."""

    Settings = AdmmSettings
    Message = Iterate

    def __init__(self, model: Model, period_s: float, settings: AdmmSettings) -> None:
        super().__init__(model, period_s, settings)
        self.exchanges = settings.exchanges
        self._planner = lru_cache(maxsize=16)(self._new_planner)
        self._start()

    def _new_planner(self, position_weight: float) -> WayPlanner:
        """Return the local problem with a weight of the positions, which depends on the neighbours."""
        given = self._settings
        return WayPlanner(
            given.stages, given.stage_s, self._reach, self._speed, position_weight, given.effort_weight,
            end="stage",
        )  # fmt: skip

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle."""
        super().reset(estimate, last_input)
        self._start()

    def _start(self) -> None:
        rows = np.zeros((self._settings.stages, 3))
        self._stage: int | None = None
        self._positions, self._average, self._dual = rows, rows.copy(), rows.copy()
        self._copies: dict[str, Array] = {}
        self._duals: dict[str, Array] = {}
        self._averages_next = False

    def _exchange(self, situation: Situation) -> Iterate:
        self._pass_stages(situation.time_s)
        links = [link for link in linked(situation, Iterate) if self._usable(link.message)]
        if self._averages_next:
            self._form_average(situation.vehicle, links)
        else:
            self._solve(situation, links)
        self._averages_next = not self._averages_next
        assert self._stage is not None
        copies = {name: Samples.of(copy + self._duals[name]) for name, copy in self._copies.items()}
        return Iterate(self._stage, Samples.of(self._average), copies)

    def _usable(self, message: Iterate) -> bool:
        """Whether a message has as many stages as the own plan, and some in common with it."""
        assert self._stage is not None
        K = self._settings.stages
        equally_long = all(len(rows) == K for rows in (message.average, *message.copies.values()))
        return equally_long and abs(message.stage - self._stage) < K

    def _pass_stages(self, time_s: float) -> None:
        """Begin at the first stage after this time; what is planned shifts with the stages that passed."""
        h, K = self._settings.stage_s, self._settings.stages
        stage = int(time_s / h + INSTANT_S) + 1
        passed = K if self._stage is None else min(stage - self._stage, K)
        if passed == 0:
            return
        begins_s = h * (stage - 1)
        if self._stage is None:
            rest, velocity = self._state(h * stage)
            self._positions = rest + h * np.arange(1.0, K + 1.0)[:, None] * velocity
            self._average, accelerations = self._positions.copy(), np.zeros((K + 1, 3))
        else:
            assert self._path is not None
            accelerations = shifted(self._path.acceleration_m_s2, passed)
            self._positions, self._average = shifted(self._positions, passed), shifted(self._average, passed)
            self._dual = shifted(self._dual, passed)
            self._copies = {name: shifted(rows, passed) for name, rows in self._copies.items()}
            self._duals = {name: shifted(rows, passed) for name, rows in self._duals.items()}
        self._fly(SchemePath(*self._state(begins_s), accelerations, h), begins_s)
        self._stage = stage

    def _solve(self, situation: Situation, links: Sequence[Linked[Iterate]]) -> None:
        """Solve the local problem; the copies are eliminated from it."""
        given, stage = self._settings, self._stage
        assert stage is not None
        assert self._path is not None
        joint = given.coupling * given.penalty / (given.coupling + given.penalty)
        terms = [(given.penalty, self._average - self._dual)]
        agreed = {}
        for name, message, _, offset_m, _ in links:
            average = shifted(message.average.to_numpy(), stage - message.stage)
            dual = self._duals.get(name, np.zeros_like(average))
            dual = dual + self._copies.get(name, average) - average
            self._duals[name], agreed[name] = dual, average - dual
            terms.append((joint, agreed[name] + offset_m))
        if not situation.follows:
            terms.append((given.task_weight, self._task(situation)))
        weight = sum(weight for weight, _ in terms)
        targets = sum(weight * rows for weight, rows in terms) / weight
        begins_s = given.stage_s * stage
        position, velocity = self._state(begins_s)
        path = self._planner(round(weight, 9)).plan(position, velocity, np.vstack((position, targets)))
        self._positions = path.at(given.stage_s * np.arange(1.0, given.stages + 1.0))[0]
        offsets = {name: offset_m for name, _, _, offset_m, _ in links}
        self._copies = {
            name: (given.coupling * (self._positions - offsets[name]) + given.penalty * rows)
            / (given.coupling + given.penalty)
            for name, rows in agreed.items()
        }
        self._duals = {name: self._duals[name] for name in agreed}
        accelerations = np.vstack((self._path.acceleration_m_s2[:1], path.acceleration_m_s2))
        self._fly(SchemePath(*self._state(self._began_s), accelerations, given.stage_s), self._began_s)

    def _form_average(self, vehicle: str, links: Sequence[Linked[Iterate]]) -> None:
        """Average the own positions and the copies that the neighbours have of them."""
        assert self._stage is not None
        proposals = [self._positions + self._dual]
        for _, message, _, _, _ in links:
            if vehicle in message.copies:
                copy = message.copies[vehicle].to_numpy()
                proposals.append(shifted(copy, self._stage - message.stage))
        self._average = np.mean(proposals, axis=0)
        self._dual = self._dual + self._positions - self._average

    def _task(self, situation: Situation) -> Array:
        """Return the reference at the stages to plan."""
        assert self._stage is not None
        given, reference = self._settings, situation.reference
        ahead_s = given.stage_s * (self._stage + 1) - situation.time_s
        return reference.resampled(ahead_s, given.stage_s, given.stages).position_m


def shifted(rows: Array, stages: int) -> Array:
    """Return rows of stages that begin some stages later, continued as at their ends."""
    k = np.arange(len(rows)) + float(stages)
    inside = np.clip(k, 0, len(rows) - 1).astype(int)
    slope = np.where((k > inside)[:, None], rows[-1] - rows[-2], rows[1] - rows[0])
    return np.asarray(rows[inside] + (k - inside)[:, None] * slope)
